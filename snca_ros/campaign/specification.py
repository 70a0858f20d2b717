"""The campaign file, which specifies the runs of a campaign as products of lists."""

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

from sim_node.errors import InvalidInput, check_keys
from snca_ros.campaign.columns import check_comparable
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.config_keys import present_keys
from snca_ros.yaml_file import read_yaml

_NEEDED = ('shape', 'architecture', 'neuron_model')
_KEYS = (
    *_NEEDED, 'as_printed', 'terrain', 'episodes', 'seed', 'population', 'sigma',
    'duration', 'transient', 'engine', 'strategy', 'physics', 'task', 'faults', 'starts', 'draw',
    'score',
)


def read_campaign(path: Path) -> list[RunConfig]:
    """Return the configurations of a campaign file's runs, each once, in the order of their seeds.

    Each key has a value or a list of values; a list means several runs, and a text such as
    'biped,comb' one run on several bodies. Each of the `cases` is the product of its own lists
    and of those outside `cases`; without `cases`, the file is one product. The defaults are those
    of `evolve`.

    Raises:
        InvalidInput: the file cannot be read, or a key or value in it is invalid.
    """
    values = read_yaml(path, 'a campaign')
    try:
        runs = {config.name: config for config in _runs(values)}
    except InvalidInput as error:
        raise error.found_in(str(path)) from None
    return sorted(runs.values(), key=lambda config: config.seed)


def _runs(values: Any) -> Iterator[RunConfig]:
    if not isinstance(values, dict):
        raise InvalidInput('campaign', values, 'keys and values')
    values = present_keys(values)
    check_keys('key', values, (*_KEYS, 'cases'))
    cases = values.get('cases', [{}])
    if not isinstance(cases, list) or not all(isinstance(case, dict) for case in cases):
        raise InvalidInput('cases', cases, 'a list of keys and values')
    shared = {key: value for key, value in values.items() if key != 'cases'}
    for i, case in enumerate(map(present_keys, cases)):
        check_keys(f'cases[{i}]', case, _KEYS)
        for combination in _product({**shared, **case}):
            yield _run(**combination)
    if not cases:
        raise InvalidInput('cases', cases, 'at least one')


def _product(values: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for key in _NEEDED:
        if key not in values:
            raise InvalidInput(key, None, 'a value or a list of values')
    lists = [value if isinstance(value, list) else [value] for value in values.values()]
    for key, choices in zip(values, lists, strict=True):
        if not choices:
            raise InvalidInput(key, choices, 'at least one value')
    for choice in product(*lists):
        yield dict(zip(values, choice, strict=True))


def _run(shape: Any, architecture: Any, neuron_model: Any, **options: Any) -> RunConfig:
    if isinstance(shape, int) and not isinstance(shape, bool):
        shape = str(shape)  # a grid of one row, such as 111
    config = RunConfig.named(shape, architecture, neuron_model, **options)
    check_comparable(config)
    return config
