"""Controller files (.npz): trained parameters and the data that is needed to run them.

The body part of the format is read by `sim_node.model.body_file`.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sim_node.engine import ENGINES
from sim_node.errors import InvalidInput, check_keys, check_name
from sim_node.model.body_file import (
    FORMAT_VERSION,
    body_of,
    check_size,
    check_version,
    field_of,
    header_of_morphology,
    morphology_of,
    read_archive,
)
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.episode_set import EpisodeSet
from snca_ros.evolution.tasks import DEFAULT_TASK
from snca_ros.files import write_atomically
from snca_ros.trained_controller import TrainedController
from snca_ros.versions import package_versions

if TYPE_CHECKING:
    pass

_FIELDS = (
    'format_version', 'architecture', 'morphology', 'terrain', 'material', 'solver',
    'fitness', 'seed', 'evaluations', 'versions', 'chosen_by', 'sensors', 'task', 'scores',
    'wall_time', 'home', 'episode_set',
)
_FIELDS_1 = (*_FIELDS[:-6], 'v_x')  # version 1, whose task is walking


def save_controller(path: Path | str, trained: TrainedController) -> None:
    """Write `trained` to `path`, atomically.

    Raises:
        InvalidInput: it has more parameters than a controller file may hold.
        OSError: `path` cannot be written.
    """
    check_size(len(trained.parameters))
    cells = trained.architecture.to_dict()
    header = {
        'format_version': FORMAT_VERSION,
        'sensors': cells.pop('sensors'),
        'architecture': cells,
        'morphology': header_of_morphology(trained.morphology),
        'terrain': trained.terrain,
        'material': asdict(trained.material),
        'solver': asdict(trained.solver),
        'fitness': float(trained.fitness),
        'seed': int(trained.seed),
        'evaluations': int(trained.evaluations),
        'versions': trained.versions or package_versions(),
        'chosen_by': trained.chosen_by,
        'task': trained.task,
        'scores': trained.scores,
    }
    if trained.wall_time is not None:
        header['wall_time'] = float(trained.wall_time)
    if trained.home is not None:
        header['home'] = header_of_morphology(trained.home)
    if trained.episode_set is not None:
        header['episode_set'] = {**trained.episode_set.as_dict(), 'scored': trained.n_episodes}
    text = np.array(json.dumps(header))
    write_atomically(
        Path(path), lambda file: np.savez_compressed(file, header=text, theta=trained.parameters)
    )


def load_controller(path: Path | str) -> TrainedController:
    """Read and check the controller file at `path`.

    Raises:
        InvalidInput: the file is missing, damaged, pickled or of another version, or a field is
            invalid; the error names file, field, value and expectation.
    """
    try:
        header, arrays = read_archive(Path(path), 'theta')
        return _checked(header, arrays['theta'])
    except InvalidInput as error:
        raise error.found_in(str(path)) from None


def _count(header: dict, name: str) -> int:
    value = field_of(header, name, int)
    if value < 0:
        raise InvalidInput(name, value, 'an integer from 0')
    return value


def _engine(name: Any) -> str:
    check_name('chosen_by', name, ENGINES)
    return name


def _scores(values: Any, field: str) -> dict[str, float]:
    if not isinstance(values, dict):
        raise InvalidInput(field, values, 'a score per engine')
    check_keys(field, values, ENGINES)
    return {name: field_of(values, name, float, f'{field}.') for name in values}


def _episode_set(header: dict) -> tuple[EpisodeSet | None, int]:
    """Return the set of episodes in a header, and the number of episodes of the fitness."""
    if 'episode_set' not in header:
        return None, 1
    values = dict(field_of(header, 'episode_set', dict))
    n = field_of(values, 'scored', int, 'episode_set.')
    if n < 1:
        raise InvalidInput('episode_set.scored', n, 'an integer from 1')
    del values['scored']
    return EpisodeSet.from_dict(values), n


def _checked(header: dict, theta: np.ndarray) -> TrainedController:
    check_version(header)
    is_old = header['format_version'] == 1
    check_keys('header', header, _FIELDS_1 if is_old else _FIELDS)
    cells, body = field_of(header, 'architecture', dict), body_of(header)
    architecture = Architecture.from_dict({**cells, 'sensors': body.sensors})
    expected = architecture.n_parameters(body.morphology.n_voxels)
    if theta.dtype != np.float64 or theta.shape != (expected,):
        shown = f'{theta.dtype} of shape {theta.shape}'
        raise InvalidInput('theta', shown, f'float64 of shape ({expected},)')
    if not np.isfinite(theta).all():
        bad = int(np.flatnonzero(~np.isfinite(theta))[0])
        raise InvalidInput(f'theta[{bad}]', float(theta[bad]), 'a finite number')
    episode_set, n_episodes = _episode_set(header)
    return TrainedController(
        architecture=architecture,
        morphology=body.morphology,
        parameters=theta,
        terrain=body.terrain,
        material=body.material,
        solver=body.solver,
        fitness=field_of(header, 'fitness', float),
        seed=_count(header, 'seed'),
        evaluations=_count(header, 'evaluations'),
        versions={str(k): str(v) for k, v in field_of(header, 'versions', dict).items()},
        chosen_by=_engine(header.get('chosen_by', 'pymunk')),  # missing in older files
        task=DEFAULT_TASK if is_old else field_of(header, 'task', str),
        scores=_scores(header.get('v_x', {}), 'v_x') if is_old
        else _scores(header.get('scores'), 'scores'),
        wall_time=field_of(header, 'wall_time', float) if 'wall_time' in header else None,
        home=morphology_of(header, 'home') if 'home' in header else None,
        episode_set=episode_set,
        n_episodes=n_episodes,
    )
