"""The offline script as a person runs it: its folder, its repeatability, how it can be stopped.

Most tests start `python -m snca_ros evolve` on a short task; what depends on no process of its
own, such as the texts for bad input, calls the same command line in this process.
"""

import csv
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import snca_ros
from sim_node.errors import InvalidInput
from sim_node.simulation import Simulation
from snca_ros import cli
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint import HISTORY, RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import run_episode

ROOT = Path(snca_ros.__file__).parents[1]
LIMIT = 300.0  # s; only a hang reaches it

TASK = (
    '--shape', 'worm', '--duration', '1', '--transient', '0.2', '--population', '8', '--seed', '3',
)
EVALUATIONS = 200
"""Of the whole run: 8, then 27 generations of 7, then 3 that remain."""

FILES = {'config.yaml', 'history.csv', 'checkpoint.npz', 'best.npz'}
VISIBLE = sorted(FILES)


# --- processes --------------------------------------------------------------------------------


@pytest.fixture(scope='module', autouse=True)
def _children_hear_interrupts():
    """A shell without job control starts its background jobs, pytest too, with SIGINT ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def _command(*arguments: object) -> list[str]:
    return [sys.executable, '-m', 'snca_ros', 'evolve', *map(str, arguments)]


def _environment() -> dict[str, str]:
    return {**os.environ, 'PYTHONPATH': str(ROOT)}


def evolve(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
    """Run the command to its end."""
    return subprocess.run(
        _command(*arguments), cwd=cwd, env=_environment(),
        capture_output=True, text=True, timeout=LIMIT, check=False,
    )


@pytest.fixture
def start(tmp_path):
    """Return a function that starts the command in a process group of its own."""
    processes = []

    def start_one(*arguments: object) -> subprocess.Popen:
        process = subprocess.Popen(
            _command(*arguments), cwd=tmp_path, env=_environment(), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        )
        processes.append(process)
        return process

    yield start_one
    for process in processes:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=LIMIT)


def wait_until(condition: Callable[[], object], what: str, limit: float = LIMIT) -> None:
    pause, end = threading.Event(), time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, f'waited in vain for {what}'
        pause.wait(0.005)


def stat_of(pid: int) -> tuple[str, int, str] | None:
    """Return (state, parent, start time) of a process, or None if there is none."""
    try:
        fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return None
    return fields[0], int(fields[1]), fields[19]


def offspring(pid: int) -> dict[int, str]:
    """Return children, grandchildren and so on of a process: id to start time."""
    stats = {int(p.name): stat_of(int(p.name)) for p in Path('/proc').glob('[0-9]*')}
    found, parents = {}, {pid}
    while parents:
        new = {
            child: stat[2] for child, stat in stats.items() if stat and stat[1] in parents
        }
        found |= new
        parents = set(new)
    return found


def is_alive(pid: int, started: str) -> bool:
    stat = stat_of(pid)
    return stat is not None and stat[2] == started and stat[0] not in 'ZX'


def wait_until_gone(processes: dict[int, str]) -> None:
    def alive() -> list[int]:
        return [pid for pid, started in processes.items() if is_alive(pid, started)]

    try:
        wait_until(lambda: not alive(), f'the end of {sorted(processes)}', limit=60.0)
    finally:
        for pid in alive():
            os.kill(pid, signal.SIGKILL)


def evaluations_in(folder: Path) -> int:
    try:
        rows = (folder / 'history.csv').read_text().splitlines()
    except FileNotFoundError:
        return 0
    return int(rows[-1].split(',')[1])


def freeze_midway(process: subprocess.Popen, folder: Path) -> int:
    """Stop (SIGSTOP) the command after its second generation; return the evaluations done."""

    def is_midway() -> bool:
        assert process.poll() is None, process.communicate()[1]
        return evaluations_in(folder) >= 15

    wait_until(is_midway, 'two generations')
    process.send_signal(signal.SIGSTOP)
    wait_until(lambda: stat_of(process.pid)[0] == 'T', 'the process to stop')
    done = evaluations_in(folder)
    assert 15 <= done < EVALUATIONS
    return done


# --- files ------------------------------------------------------------------------------------


def history_of(folder: Path) -> list[dict[str, str]]:
    with (folder / 'history.csv').open(newline='') as file:
        return list(csv.DictReader(file))


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as data:
        return {name: data[name] for name in data.files}


def contents_of(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}


def assert_same_run(one: Path, two: Path) -> None:
    for name in ('config.yaml', 'history.csv', 'best.npz'):
        assert (one / name).read_bytes() == (two / name).read_bytes(), name
    a, b = arrays_of(one / 'checkpoint.npz'), arrays_of(two / 'checkpoint.npz')
    assert a.keys() == b.keys()
    for name, array in a.items():
        assert array.dtype == b[name].dtype
        assert array.tobytes() == b[name].tobytes(), name


@pytest.fixture(scope='module')
def whole(tmp_path_factory) -> Path:
    """Return the folder of a run that nobody stopped, one worker."""
    folder = tmp_path_factory.mktemp('whole') / 'a' / 'run'
    run = evolve(*TASK, '--evaluations', EVALUATIONS, '--workers', 1, '--run', folder)
    assert run.returncode == 0, run.stderr
    assert str(folder / 'best.npz') in run.stdout
    assert 'Traceback' not in run.stderr
    return folder


@pytest.fixture
def begun(whole, tmp_path) -> Path:
    """Return a copy of the folder of the whole run."""
    shutil.copytree(whole, tmp_path / 'begun')
    return tmp_path / 'begun'


# --- the run folder ---------------------------------------------------------------------------


def test_run_folder_holds_what_it_should(whole):
    assert {p.name for p in whole.iterdir()} - {'.lock'} == FILES
    config = RunConfig.from_yaml(whole / 'config.yaml')
    assert config == RunConfig(
        'worm', Architecture.named('U-nD', 'snn-h'), evaluations=EVALUATIONS, seed=3,
        population=8, duration=1.0, transient=0.2,
    )
    values = yaml.safe_load((whole / 'config.yaml').read_text())
    assert set(values) == set(RunConfig.__dataclass_fields__)


def test_history_has_a_row_a_generation_and_spends_the_evaluations_exactly(whole):
    rows = history_of(whole)
    assert tuple(rows[0]) == HISTORY
    assert [int(row['generation']) for row in rows] == list(range(29))
    spent = [int(row['evaluations']) for row in rows]
    assert spent == [*range(8, 198, 7), EVALUATIONS]
    best = -np.inf
    for row in rows:
        worst, median, top = (float(row[name]) for name in ('worst', 'median', 'best'))
        assert worst <= median <= top
        best = max(best, top)
        assert float(row['best_so_far']) == best
    assert best > float(rows[0]['best'])  # it learns


def test_best_scores_again_what_the_history_says(whole):
    config = RunConfig.from_yaml(whole / 'config.yaml')
    trained = load_controller(whole / 'best.npz')
    assert trained.fitness == float(history_of(whole)[-1]['best_so_far'])
    assert (trained.seed, trained.evaluations, trained.terrain) == (3, EVALUATIONS, 'flat')
    assert trained.architecture == config.architecture
    assert trained.morphology.name == 'worm'
    simulation = Simulation(
        trained.morphology, trained.terrain, material=trained.material, solver=trained.solver
    )
    episode = run_episode(simulation, trained.controller(), config.duration)
    assert episode.velocity(config.transient) == trained.fitness


def test_checkpoint_is_the_best_first(whole):
    arrays, best = arrays_of(whole / 'checkpoint.npz'), load_controller(whole / 'best.npz')
    assert arrays['fitness'][0] == arrays['fitness'].max() == best.fitness
    np.testing.assert_array_equal(arrays['individuals'][0], best.theta)
    assert arrays['individuals'].shape[1] == 500
    assert arrays['generation'] == 29
    # The last generation has 3 candidates: the population before it is kept.
    assert (len(arrays['individuals']), arrays['population'].shape) == (4, (8, 500))
    assert arrays['population_fitness'][0] == float(history_of(whole)[-2]['best_so_far'])
    assert arrays['other_engine'].tolist() == [best.v_x['batched']]


def test_number_of_workers_does_not_matter(whole, tmp_path):
    folder = tmp_path / 'run'
    run = evolve(*TASK, '--evaluations', EVALUATIONS, '--workers', 2, '--run', folder)
    assert run.returncode == 0, run.stderr
    assert_same_run(whole, folder)


@pytest.mark.parametrize('evaluations', [3, 8])
def test_budget_within_the_first_generation_and_default_folder(whole, tmp_path, evaluations):
    run = evolve(*TASK, '--evaluations', evaluations, '--workers', 1, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    settings = f'evaluations{evaluations}-population8-duration1-transient0.2'
    name = f'worm-U-nD-snn-h-flat-reference-{settings}-seed3'
    folder = tmp_path / 'runs' / name
    assert {p.name for p in folder.iterdir()} - {'.lock'} == FILES
    rows = history_of(folder)
    assert [int(row['evaluations']) for row in rows] == [evaluations]
    if evaluations == 8:
        assert rows[0] == history_of(whole)[0]


def test_diverging_physics_is_survived(tmp_path):
    folder = tmp_path / 'run'
    folder.mkdir()
    config = RunConfig('worm-2x1', Architecture.named('U-D', 'mlp'), evaluations=7, population=4)
    values = yaml.safe_load(config.to_yaml())
    values |= {'duration': 5.0, 'material': {'frequency': 30.0, 'damping_ratio': 0.0}}
    values['solver']['physics'] = 'first'
    (folder / 'config.yaml').write_text(yaml.safe_dump(values))
    run = evolve('--resume', folder, '--workers', 1)
    assert run.returncode == 0, run.stderr
    assert 'Traceback' not in run.stderr
    assert 'Warning' not in run.stderr
    rows = history_of(folder)
    assert [int(row['evaluations']) for row in rows] == [4, 7]
    assert {row['best_so_far'] for row in rows} == {'-inf'}
    assert load_controller(folder / 'best.npz').fitness == -np.inf


# --- stopped and resumed ----------------------------------------------------------------------


def assert_stopped(process: subprocess.Popen, folder: Path, workers: dict[int, str]) -> None:
    _, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 130
    assert 'Traceback' not in err
    assert err.splitlines()[-1] == f'stopped; go on with: snca evolve --resume {folder}'
    wait_until_gone(workers)
    assert sorted(p.name for p in folder.iterdir() if p.name != '.lock') == VISIBLE


def test_interrupted_run_goes_on_as_if_never_stopped(whole, tmp_path, start):
    folder = tmp_path / 'run'
    process = start(*TASK, '--evaluations', EVALUATIONS, '--workers', 2, '--run', folder)
    done = freeze_midway(process, folder)
    workers = offspring(process.pid)
    os.killpg(process.pid, signal.SIGINT)  # a terminal's Ctrl-C tells the whole group
    process.send_signal(signal.SIGCONT)
    assert_stopped(process, folder, workers)

    assert done <= evaluations_in(folder) < EVALUATIONS
    assert arrays_of(folder / 'checkpoint.npz')['history'][-1, 1] == evaluations_in(folder)
    run = evolve('--resume', folder, '--workers', 1)
    assert run.returncode == 0, run.stderr
    assert_same_run(whole, folder)


def test_running_run_is_refused_to_others_and_stops_at_sigterm(tmp_path, start, here):
    folder = tmp_path / 'run'
    process = start(*TASK, '--evaluations', EVALUATIONS, '--workers', 1, '--run', folder)
    freeze_midway(process, folder)
    workers, before = offspring(process.pid), contents_of(folder)
    here.refuses('--resume', folder, words=[str(folder), 'no other process'])
    here.refuses(*TASK, '--run', folder, words=[str(folder), '--resume'])
    assert contents_of(folder) == before
    process.send_signal(signal.SIGTERM)
    process.send_signal(signal.SIGCONT)
    assert_stopped(process, folder, workers)


def test_killed_run_leaves_no_process_and_goes_on_as_if_never_stopped(whole, tmp_path, start):
    folder = tmp_path / 'run'
    process = start(*TASK, '--evaluations', EVALUATIONS, '--workers', 2, '--run', folder)
    done = freeze_midway(process, folder)
    workers = offspring(process.pid)
    assert len(workers) >= 2
    assert all(is_alive(pid, started) for pid, started in workers.items())
    process.kill()  # kill -9 of the parent alone
    assert process.wait(LIMIT) == -signal.SIGKILL
    wait_until_gone(workers)
    assert done == evaluations_in(folder)

    run = evolve('--resume', folder, '--workers', 1)
    assert run.returncode == 0, run.stderr
    assert_same_run(whole, folder)


def test_kill_before_the_first_generation(whole, tmp_path):
    # Only config.yaml and the lock are there.
    folder = tmp_path / 'run'
    folder.mkdir()
    shutil.copy(whole / 'config.yaml', folder)
    values = yaml.safe_load((folder / 'config.yaml').read_text())
    (folder / 'config.yaml').write_text(yaml.safe_dump({**values, 'evaluations': 15}))
    run = evolve('--resume', folder, '--workers', 1)
    assert run.returncode == 0, run.stderr
    assert history_of(folder) == history_of(whole)[:2]


@pytest.mark.parametrize('lost', [['history.csv'], ['best.npz'], ['history.csv', 'best.npz']])
@pytest.mark.parametrize('how', ['older', 'missing', 'half'])
def test_kill_between_checkpoint_and_what_is_made_from_it(whole, begun, lost, how):
    for name in lost:
        path = begun / name
        if how == 'missing':
            path.unlink()
        elif how == 'half':
            path.write_bytes(path.read_bytes()[:100])
        else:
            path.write_bytes(b'generation,evaluations,best,median,worst,best_so_far\n')
    folder = RunFolder.resume(begun)
    try:
        assert folder.load().evaluations == EVALUATIONS
    finally:
        folder.close()
    assert_same_run(whole, begun)


def test_what_a_kill_left_half_written_is_cleared_away(begun):
    (begun / '.checkpoint.npz.ab12cd.tmp').write_bytes(b'PK\x03\x04 half of')
    folder = RunFolder.resume(begun)
    try:
        folder.load()
    finally:
        folder.close()
    assert sorted(p.name for p in begun.iterdir() if p.name != '.lock') == VISIBLE


def test_folder_of_a_run_killed_before_its_config_can_be_used_again(tmp_path):
    config = RunConfig('worm', Architecture.named('U-nD', 'snn-h'))
    (tmp_path / '.lock').touch()
    (tmp_path / '.config.yaml.ab12cd.tmp').write_text('shape: wo')
    RunFolder.create(tmp_path, config).close()
    assert RunConfig.from_yaml(tmp_path / 'config.yaml') == config


def test_resuming_a_finished_run_changes_nothing(begun, here):
    before = contents_of(begun)
    for workers in (1, 100):
        code, out, err = here.run('--resume', begun, '--workers', workers)
        assert (code, out.count('\n')) == (0, 1), err
        assert str(begun / 'best.npz') in out
    assert contents_of(begun) == before


# --- one run, one folder, one process ---------------------------------------------------------


def assert_one_line(run: subprocess.CompletedProcess, *words: str) -> None:
    assert run.returncode == 2, run.stderr
    assert run.stdout == ''
    assert run.stderr.count('\n') == 1, run.stderr
    assert run.stderr.startswith('snca evolve: error: ')
    for word in words:
        assert word in run.stderr


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
     '--as-printed', '--terrain flat', '--evaluations 300', '--seed 3', '--population 8',
     '--sigma 0.35', '--duration 1', '--transient 0', '--run x'],
)
def test_resumed_run_cannot_be_changed(begun, here, option):
    before = contents_of(begun)
    code, out, err = here.run('--resume', begun, *option.split())
    assert (code, out) == (2, '')
    assert err.splitlines()[-1].startswith('snca evolve: error: --resume')
    assert option.split()[0] in err.splitlines()[-1]
    assert contents_of(begun) == before


# --- bad input --------------------------------------------------------------------------------


class Here:
    """The command line, called in this process with an empty folder as working folder."""

    def __init__(self, folder: Path, capsys) -> None:
        self.folder, self.capsys = folder, capsys

    def run(self, *arguments: object) -> tuple[int, str, str]:
        """Return exit code, standard output and standard error."""
        try:
            code = cli.main(['evolve', *map(str, arguments)])
        except SystemExit as end:  # argparse
            code = end.code
        return code, *self.capsys.readouterr()

    def refuses(self, *arguments: object, words: list[str]) -> None:
        """Check: exit code 2, one line with all `words`, no folder."""
        code, out, err = self.run(*arguments)
        assert (code, out) == (2, '')
        assert err.startswith('snca evolve: error: ')
        assert err.endswith('\n')
        assert err.count('\n') == 1
        for word in words:
            assert word in err
        assert list(self.folder.iterdir()) == []


@pytest.fixture
def here(tmp_path_factory, capsys, monkeypatch):
    folder = tmp_path_factory.mktemp('here')
    monkeypatch.chdir(folder)
    before = signal.getsignal(signal.SIGTERM)
    yield Here(folder, capsys)
    signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ('--shape bipd', ["'bipd'", "did you mean 'biped'?"]),
        ('--shape 101', ["'101'", 'connected']),
        ('--terrain hily-1-10-0', ["'hily-1-10-0'", "did you mean 'hilly'?"]),
        ('--neuron-model snn_h', ["'snn_h'", "did you mean 'snn-h'?"]),
        ('--evaluations 0', ['evaluations', '0', 'from 1 to']),
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
        ('--evaluations -1', ['evaluations', '-1']),
        ('--evaluations 1000000001', ['evaluations', '1000000001']),
        (f'--evaluations 1{"0" * 400}', ['evaluations', 'from 1 to']),
        ('--seed -1', ['seed', '-1']),
        (f'--seed 1{"0" * 400}', ['seed', 'from 0 to']),
        ('--population 3', ['population', '3', 'from 4 to']),
        ('--sigma nan', ['sigma', 'nan']),
        ('--sigma -0.1', ['sigma', '-0.1']),
        ('--sigma inf', ['sigma', 'inf']),
        ('--duration 0', ['duration', '0.0', 'from 0.1 to']),
        ('--duration 1 --transient 2', ['transient', '2.0', 'from 0 to 1']),
        ('--transient nan', ['transient', 'nan']),
    ],
)
def test_bad_value_is_one_line_and_no_folder(here, arguments, words):
    # '=' lets values begin with a minus sign.
    parts = arguments.split()
    here.refuses(*(f'{o}={v}' for o, v in zip(parts[::2], parts[1::2], strict=True)), words=words)


@pytest.mark.parametrize(
    'arguments', ['--workers 0', '--workers -1', '--workers x', '--evaluations 1.5', '--seed x',
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


# --- damaged runs -----------------------------------------------------------------------------

GOOD = {'shape': 'worm', 'architecture': Architecture.named('U-nD', 'snn-h').to_dict()}


def test_damaged_config_as_a_process(begun):
    path = begun / 'config.yaml'
    path.write_text(path.read_text().replace('population', 'popluation'))
    before = contents_of(begun)
    hint = "did you mean 'population'?"
    assert_one_line(evolve('--resume', begun), str(path), "'popluation'", hint)
    assert contents_of(begun) == before


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', ['config', 'None']),
        ('shape', ['config', "'shape'"]),
        ('[1, 2]', ['config']),
        ('shape: worm', ['architecture', 'None']),
        ('architecture: {}', ['shape', 'None']),
        ('shape: worm\narchitecture: 3', ['architecture', '3']),
        ('shape: worm\narchitecture: {}', ['architecture.uniform', 'None']),
        ('shape: worm\narchitecture: {1: 2}', ['architecture', '1']),
        ('shape: [', ['file']),
        ('a: b: c', ['file']),
        ('\t', ['file']),
        ('!!python/object/apply:os.getcwd []', ['file']),
        ('shape: 2001-99-99', ['file']),
        (f'seed: {"9" * 5000}', ['file']),
        ('[' * 5000, ['file']),
        ('shape: \x00', ['file']),
    ],
)
def test_damaged_config(begun, here, text, words):
    (begun / 'config.yaml').write_text(text)
    before = contents_of(begun)
    here.refuses('--resume', begun, words=[str(begun / 'config.yaml'), *words])
    assert contents_of(begun) == before


@pytest.mark.parametrize('content', [b'\xff\xfe\x00', bytes(100), b'shape: \xe9'])
def test_config_that_is_no_text(begun, here, content):
    (begun / 'config.yaml').write_bytes(content)
    here.refuses('--resume', begun, words=[str(begun / 'config.yaml'), 'file'])


def test_config_that_is_a_folder(begun, here):
    (begun / 'config.yaml').unlink()
    (begun / 'config.yaml').mkdir()
    here.refuses('--resume', begun, words=[str(begun / 'config.yaml'), 'file'])


WRONG = {
    'shape': [None, 11111, ['worm'], 'bipd'],
    'terrain': [None, 3, 'hily-1-10-0'],
    'evaluations': [None, 0, 1.5, True, '10', 10**400],
    'seed': [None, -1, 1.5, True, 2**63],
    'population': [None, 3, 36.0, False],
    'sigma': [None, -1, float('nan'), 'x', True, 10**400],
    'duration': [None, 0, float('inf'), '30'],
    'transient': [None, -1, 31, float('nan')],
    'engine': [None, 3, [], 'batch'],
    'strategy': [None, 3, [], 'CMA-ES'],
    'material': [None, 3, [], {'gravity': 'x'}, {'gravity': -1}, {'gravty': 1}, {1: 2}],
    'solver': [None, 3, [], {'substeps': 0}, {'substeps': 1.0}, {'nothing': 1}, {1: 2}],
    'architecture': [
        None, 3, [], {}, {**GOOD['architecture'], 'n_c': 0}, {**GOOD['architecture'], 'x': 1},
        {**GOOD['architecture'], 'neuron_model': 'snn_h'},
    ],
    'other': [None, 1],
    3: [None],
}
_SAID = {'shape': 'morphology'}
_INNER = {'gravity', 'gravty', 'substeps', 'nothing', 'n_c', 'x', 'neuron_model'}


@pytest.mark.parametrize('key', WRONG)
def test_wrong_value_in_the_config_is_named(tmp_path, key):
    path = tmp_path / 'config.yaml'
    for value in WRONG[key]:
        path.write_text(yaml.safe_dump({**GOOD, key: value}))
        with pytest.raises(InvalidInput) as caught:
            RunConfig.from_yaml(path)
        text = str(caught.value)
        assert text.startswith(f'{path}: ')
        assert '\n' not in text
        inner = _INNER & set(value) if isinstance(value, dict) else set()
        names = [str(key), _SAID.get(key, '-'), *inner]
        assert any(name in text.removeprefix(str(path)) for name in names)


@settings(max_examples=200)
@given(
    key=st.sampled_from(sorted(RunConfig.__dataclass_fields__)),
    value=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
        lambda inner: st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=9) | st.integers(), inner, max_size=3),
    ),
)
def test_any_value_in_a_config_is_taken_or_refused(key, value):
    try:
        config = RunConfig.from_dict({**GOOD, key: value})
    except InvalidInput as error:
        complaint = str(error)
    else:
        complaint = ' '
        assert RunConfig.from_dict(yaml.safe_load(config.to_yaml())) == config
    assert complaint
    assert '\n' not in complaint


@settings(max_examples=100)
@given(text=st.text(max_size=60))
def test_any_text_as_config_is_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp('any') / 'config.yaml'
    path.write_bytes(text.encode('utf-8', 'surrogatepass'))
    with pytest.raises(InvalidInput, match=r'config\.yaml: '):
        RunConfig.from_yaml(path)


@pytest.mark.parametrize('key', ['shape', 'terrain', 'seed', 'architecture', 'material', 'other'])
def test_text_that_grows_without_end_is_refused_shortly(tmp_path, key):
    """Each line names the one before ten times: 10^30 words."""
    lines = ['a0: &a0 [x, x]']
    lines += [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 10)}]' for n in range(1, 30)]
    grown = '\n'.join('  ' + line for line in lines)
    path = tmp_path / 'config.yaml'
    path.write_text(f'{key}:\n{grown}\n')
    with pytest.raises(InvalidInput, match=r'config\.yaml: ') as refusal:
        RunConfig.from_yaml(path)
    assert len(str(refusal.value)) < 1000
    values = yaml.safe_load(path.read_text())
    with pytest.raises(InvalidInput) as refusal:
        RunConfig.from_dict({**GOOD, **values})
    assert len(str(refusal.value)) < 1000


def test_config_goes_both_ways(tmp_path):
    path = tmp_path / 'config.yaml'
    for shape, model in (('biped', 'snn'), ('11111', 'mlp'), ('1001-1111', 'snn-h')):
        architecture = Architecture.named('nU-D', model, n_c=2, hidden=(5, 3), as_printed=True)
        config = RunConfig(shape, architecture, 'hilly-0.5-10-3', seed=2**63 - 1, sigma=0.1)
        path.write_text(config.to_yaml())
        assert RunConfig.from_yaml(path) == config


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
