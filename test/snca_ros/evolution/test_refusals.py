"""Bad input to `snca evolve` is refused in one line, and changes nothing."""

import os

import pytest
from support.evolve import TASK, assert_one_line, contents_of, evolve

from snca_ros.evolution.checkpoint import RunFolder


def test_run_is_not_overwritten(begun):
    before = contents_of(begun)
    assert_one_line(evolve(*TASK, '--run', begun), str(begun), 'new or empty', '--resume')
    assert contents_of(begun) == before


def test_folder_of_something_else_is_not_touched(tmp_path, here):
    (tmp_path / 'letter.txt').write_text('Dear')
    here.refuses(*TASK, '--run', tmp_path, words=[str(tmp_path), 'new or empty'])
    assert [p.name for p in tmp_path.iterdir()] == ['letter.txt']


def test_second_process_is_refused(begun):
    folder = RunFolder.resume(begun)
    try:
        before = contents_of(begun)
        run = evolve('--resume', begun)
        assert_one_line(run, str(begun), 'no other process')
        assert contents_of(begun) == before
    finally:
        folder.close()
    RunFolder.resume(begun).close()


@pytest.mark.parametrize(
    'option',
    ['--shape worm', '--architecture U-D', '--neuron-model snn', '--n-c 4', '--hidden 3',
     '--as-printed', '--terrain flat', '--episodes 300', '--seed 3', '--population 8',
     '--sigma 0.35', '--duration 1', '--transient 0', '--run x'],
)
def test_resumed_run_cannot_be_changed(begun, here, option):
    before = contents_of(begun)
    code, out, err = here.run('--resume', begun, *option.split())
    assert (code, out) == (2, '')
    assert err.splitlines()[-1].startswith('snca evolve: error: --resume')
    assert option.split()[0] in err.splitlines()[-1]
    assert contents_of(begun) == before


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ('--shape bipd', ["'bipd'", "did you mean 'biped'?"]),
        ('--shape 101', ["'101'", 'connected']),
        ('--terrain hily-1-10-0', ["'hily-1-10-0'", "did you mean 'hilly'?"]),
        ('--neuron-model snn_h', ["'snn_h'", "did you mean 'snn-h'?"]),
        ('--episodes 0', ['episodes', '0', 'from 1 to']),
        ('--hidden a,b', ['hidden', "'a'", 'layer sizes']),
        ('--resume nowhere', ['nowhere', 'no folder', 'earlier run']),
    ],
)
def test_bad_input_is_one_line_and_no_folder(tmp_path, arguments, words):
    assert_one_line(evolve(*arguments.split(), cwd=tmp_path), *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ('--shape worm-0x1', ["'worm-0x1'"]),
        ('--shape 11-1', ["'11-1'", 'equal length']),
        ('--shape 000', ["'000'", 'at least one']),
        ('--shape ../worm', ["'../worm'"]),
        ('--shape 110-001', ["'110-001'", 'connected']),
        ('--terrain hilly-1-10', ["'hilly-1-10'", 'hilly-<h>-<w>-<seed>']),
        ('--terrain uphill-61', ["'uphill-61'", '60']),
        ('--architecture U-ND', ["'U-ND'", "did you mean 'U-nD'?"]),
        ('--architecture snn', ["'snn'", 'U-nD, U-D, nU-D']),
        ('--neuron-model MLP', ["'MLP'", "did you mean 'mlp'?"]),
        ('--n-c 0', ['n_c', '0', 'from 1 to']),
        ('--n-c 65', ['n_c', '65']),
        ('--hidden 0,5', ['hidden', '(0, 5)']),
        ('--hidden 5,', ['hidden']),
        ('--hidden -5', ['hidden', "'-5'"]),
        ('--hidden ²', ['hidden', "'²'"]),
        ('--hidden 1,1,1,1,1,1,1,1,1', ['hidden', 'up to 8']),
        ('--episodes -1', ['episodes', '-1']),
        ('--episodes 1000000001', ['episodes', '1000000001']),
        (f'--episodes 1{"0" * 400}', ['episodes', 'from 1 to']),
        ('--seed -1', ['seed', '-1']),
        (f'--seed 1{"0" * 400}', ['seed', 'from 0 to']),
        ('--population 3', ['population', '3', 'from 4 to']),
        ('--sigma nan', ['sigma', 'nan']),
        ('--sigma -0.1', ['sigma', '-0.1']),
        ('--strategy cma --sigma 0', ['--sigma: got 0.0', '1e-09 to 100']),
        ('--sigma inf', ['sigma', 'inf']),
        ('--duration 0', ['duration', '0.0', 'from 0.1 to']),
        ('--duration 1 --transient 2', ['transient', '2.0', 'below the duration', '1 s']),
        ('--duration 5', ['transient', '5.0', 'below the duration', '5 s']),
        ('--duration 5.001', ['transient', '5.0', 'below the duration']),  # as many steps
        ('--transient nan', ['transient', 'nan']),
    ],
)
def test_bad_value_is_one_line_and_no_folder(here, arguments, words):
    # '=' lets values begin with a minus sign.
    parts = arguments.split()
    here.refuses(*(f'{o}={v}' for o, v in zip(parts[::2], parts[1::2], strict=True)), words=words)


@pytest.mark.parametrize(
    'arguments', ['--workers 0', '--workers -1', '--workers x', '--episodes 1.5', '--seed x',
                  '--sigma x', '--nonsense', 'nonsense', '--shape']
)
def test_bad_option_is_told_in_the_last_line_and_no_folder(here, arguments):
    code, out, err = here.run(*arguments.split())
    assert (code, out) == (2, '')
    assert 'Traceback' not in err
    assert err.splitlines()[-1].startswith('snca evolve: error: ')
    assert arguments.split()[0] in err.splitlines()[-1]
    assert list(here.folder.iterdir()) == []


def test_unwritable_folder(tmp_path, here):
    (tmp_path / 'file').write_text('text')
    here.refuses(*TASK, '--run', tmp_path / 'file' / 'run', words=['run', 'can be written'])
    here.refuses(*TASK, '--run', '/proc/nowhere/run', words=['/proc/nowhere/run', 'can be written'])
    assert (tmp_path / 'file').read_text() == 'text'
    assert [p.name for p in tmp_path.iterdir()] == ['file']


def test_file_in_place_of_the_folder(tmp_path, here):
    (tmp_path / 'file').write_text('text')
    here.refuses(*TASK, '--run', tmp_path / 'file', words=[str(tmp_path / 'file')])
    assert (tmp_path / 'file').read_text() == 'text'


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write everywhere')
def test_folder_without_permission(tmp_path, here, begun):
    tmp_path.chmod(0o500)
    here.refuses(*TASK, '--run', tmp_path / 'run', words=['Permission denied'])
    begun.chmod(0o500)
    (begun / '.lock').chmod(0o400)
    here.refuses('--resume', begun, words=['Permission denied'])
    tmp_path.chmod(0o700)
    begun.chmod(0o700)


def test_long_path_is_told_in_full(tmp_path, here, begun):
    folder = begun.rename(tmp_path / ('long' * 40))
    here.refuses(*TASK, '--run', folder, words=[str(folder), 'new or empty'])
    here.refuses(*TASK, '--run', folder / 'best.npz' / 'x', words=[str(folder), 'Not a directory'])
    here.refuses('--resume', folder / 'nowhere', words=[str(folder / 'nowhere'), 'no folder'])
    held = RunFolder.resume(folder)
    try:
        here.refuses('--resume', folder, words=[str(folder), 'no other process'])
    finally:
        held.close()


def test_lock_that_cannot_be_opened(begun, here):
    (begun / '.lock').unlink()
    (begun / '.lock').mkdir()
    here.refuses('--resume', begun, words=[str(begun), 'can be written'])


def test_file_that_cannot_be_replaced_is_one_line(begun, here):
    (begun / 'history.csv').unlink()
    (begun / 'history.csv').mkdir()
    code, out, err = here.run('--resume', begun)
    assert code in (1, 2)
    assert out == ''
    last = err.splitlines()[-1]
    assert last.startswith('snca evolve: error: ')
    assert 'history.csv' in last
    assert 'directory' in last
