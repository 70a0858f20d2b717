"""Damaged checkpoints are refused and kept as they are."""

from collections.abc import Callable

import numpy as np
import pytest
import yaml
from support.evolve import EVALUATIONS, arrays_of, contents_of, evolve

from sim_node.errors import InvalidInput
from snca_ros.evolution.checkpoint import RunFolder


def damaged_checkpoints() -> dict[str, Callable[[dict], object]]:
    """Return ways to damage a checkpoint: what to do with its arrays, or the bytes instead."""

    def without(name):
        return lambda arrays: {k: v for k, v in arrays.items() if k != name}

    def with_(name, change):
        return lambda arrays: {**arrays, name: change(arrays[name].copy())}

    def with_value(name, index, value):
        def change(array):
            array[index] = value
            return array

        return with_(name, change)

    return {
        'empty': lambda arrays: b'',
        'no archive': lambda arrays: b'PK\x03\x04 half of',
        'nothing in it': lambda arrays: {},
        **{f'no {name}': without(name) for name in ('individuals', 'fitness', 'generation',
                                                    'history')},
        'pickled': with_('history', lambda a: a.astype(object)),
        'individuals of another robot': with_('individuals', lambda a: a[:, :-1]),
        'no individuals': with_('individuals', lambda a: a[:0]),
        'individuals in one row': with_('individuals', lambda a: a[0]),
        'individuals of another type': with_('individuals', lambda a: a.astype(str)),
        'individuals not finite': with_value('individuals', (1, 2), np.nan),
        'fitness too short': with_('fitness', lambda a: a[:-1]),
        'fitness not a number': with_value('fitness', 0, np.nan),
        'fitness not sorted': with_('fitness', lambda a: a[::-1]),
        'generation in the past': with_('generation', lambda a: a - 1),
        'generations': with_('generation', lambda a: np.tile(a, 2)),
        'history too narrow': with_('history', lambda a: a[:, :-1]),
        'history empty': with_('history', lambda a: a[:0]),
        'history of text': with_('history', lambda a: a.astype(str)),
        'history not finite': with_value('history', (-1, 1), np.nan),
        'population too small': lambda arrays: {
            **arrays, 'population': arrays['population'][:-1],
            'population_fitness': arrays['population_fitness'][:-1],
        },
        'population without its fitness': without('population_fitness'),
        'population of another robot': with_('population', lambda a: a[:, :-1]),
        'population not finite': with_value('population', (1, 2), np.inf),
        'population not sorted': with_('population_fitness', lambda a: a[::-1]),
        'other engine twice': with_('other_engine', lambda a: np.tile(a, 2)),
        'other engine of text': with_('other_engine', lambda a: a.astype(str)),
        'config of another kind': lambda arrays: {**arrays, 'config': np.zeros(3)},
        'config cut': with_('config', lambda a: np.array(str(a)[:200])),
        'unknown entry': lambda arrays: {**arrays, 'more': np.zeros(1)},
    }


@pytest.mark.parametrize('damage', damaged_checkpoints())
def test_damaged_checkpoint_is_refused_and_kept(begun, here, damage):
    path = begun / 'checkpoint.npz'
    result = damaged_checkpoints()[damage](arrays_of(path))
    if isinstance(result, bytes):
        path.write_bytes(result)
    else:
        np.savez(path, **result)
    before = contents_of(begun)
    code, out, err = here.run('--resume', begun)
    assert (code, out) == (2, '')
    assert 'Traceback' not in err
    last = err.splitlines()[-1]
    assert last.startswith(f'snca evolve: error: {path}: ')
    assert ', expected ' in last
    assert contents_of(begun) == before
    RunFolder.resume(begun).close()  # nobody holds it


def test_truncated_checkpoint_as_a_process(begun):
    path = begun / 'checkpoint.npz'
    path.write_bytes(path.read_bytes()[:-1000])
    before = contents_of(begun)
    run = evolve('--resume', begun)
    assert run.returncode == 2
    assert 'Traceback' not in run.stderr
    assert run.stderr.splitlines()[-1].startswith(f'snca evolve: error: {path}: ')
    assert contents_of(begun) == before


@pytest.mark.parametrize('part', [0.0, 0.01, 0.3, 0.5, 0.9, 0.99, 0.999])
def test_truncated_checkpoint(begun, part):
    path = begun / 'checkpoint.npz'
    content = path.read_bytes()
    path.write_bytes(content[: int(part * len(content))])
    folder = RunFolder.resume(begun)
    try:
        with pytest.raises(InvalidInput, match=r'checkpoint\.npz: '):
            folder.load()
    finally:
        folder.close()


def load(folder):
    opened = RunFolder.resume(folder)
    try:
        return opened.load()
    finally:
        opened.close()


def test_config_edited_under_its_checkpoint_is_refused(begun):
    path = begun / 'config.yaml'
    values = yaml.safe_load(path.read_text())
    for key, other in (('shape', 'worm-6x1'), ('seed', 4), ('terrain', 'uphill-10'),
                       ('episodes', 1000), ('solver', {**values['solver'], 'substeps': 2})):
        path.write_text(yaml.safe_dump({**values, key: other}))
        before = contents_of(begun)
        with pytest.raises(InvalidInput, match=rf'config\.yaml: {key}: got .* the run began$'):
            load(begun)
        assert contents_of(begun) == before
    path.write_text(f'# a comment\n{yaml.safe_dump(values)}')  # the same settings
    assert load(begun).episodes == EVALUATIONS


def test_checkpoint_of_an_earlier_version_has_no_config(begun):
    path = begun / 'checkpoint.npz'
    arrays = arrays_of(path)
    assert 'config' in arrays
    del arrays['config']
    np.savez(path, **arrays)
    assert load(begun).episodes == EVALUATIONS
