"""The search for bodies: its archive, its files, and searches that were stopped."""

import csv
import json
import signal
import sys

import numpy as np
import pytest
from support.bodies import EPISODES, OPTIONS, WORM, bodies, contents_of, save_worm, start
from support.limits import LIMIT
from support.processes import offspring, wait_until, wait_until_gone

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from sim_node.simulation import Simulation
from snca_ros.bodies.archive import BodySearch, ScoredBody
from snca_ros.bodies.figures import draw_archive
from snca_ros.bodies.folder import SearchFolder
from snca_ros.bodies.search import search_bodies
from snca_ros.bodies.settings import SearchSettings
from snca_ros.bundled import find_controller
from snca_ros.cli import main
from snca_ros.controller import Controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.tasks import TASKS
from snca_ros.evolution.workers import IN_PROCESS

pytest.importorskip('ribs')

SETTINGS = SearchSettings(
    episodes=EPISODES, starts=2, voxels=6, width=5, height=2, batch=4, seed=3, duration=5.5,
    engine='batched',
)


HOME = '\n0,11111,'
"""Begin of the first row of bodies.csv."""


def searched(path, trained, stop_after=()):
    """Search bodies in a folder, interrupted after these numbers of bodies; return the search."""
    for n in (*stop_after, None):
        folder = SearchFolder(path, SETTINGS, trained)

        def report(search, n=n):
            if n is not None and len(search.scored) >= n:
                raise KeyboardInterrupt

        try:
            return search_bodies(folder, IN_PROCESS, report)
        except KeyboardInterrupt:
            assert n is not None
        finally:
            folder.close()
    raise AssertionError


@pytest.fixture(scope='module')
def trained():
    return load_controller(find_controller(WORM))


@pytest.fixture(scope='module')
def whole(trained, tmp_path_factory):
    """Return the folder of a search that nobody stopped, and the search."""
    path = tmp_path_factory.mktemp('search') / 'a' / 'bodies'
    return path, searched(path, trained)


def rows_of(path):
    with path.open(newline='') as file:
        return list(csv.DictReader(file))


def test_tables_have_all_bodies_and_the_best_of_each_cell(whole, trained):
    path, search = whole
    rows = rows_of(path / 'bodies.csv')
    assert [row['generation'] for row in rows] == [*'00001111222']
    assert rows[0]['grid'] == '11111' == trained.morphology.grid_string
    assert len({row['grid'] for row in rows}) == 11
    best: dict[tuple[int, int], tuple[float, str]] = {}
    for row in rows:
        grid = row['grid']
        size, feet = grid.count('1'), len(grid.rpartition('-')[2].replace('0', ' ').split())
        assert (row['size'], row['feet']) == (str(size), str(feet))
        mean = (float(row['start_1']) + float(row['start_2'])) / 2
        if mean > best.get((size, feet), (-np.inf, ''))[0]:
            best[size, feet] = mean, grid
    archive = rows_of(path / 'archive.csv')
    assert [(int(row['size']), int(row['feet'])) for row in archive] == sorted(best)
    for row in archive:
        mean, grid = best[int(row['size']), int(row['feet'])]
        assert (row['grid'], float(row['mean'])) == (grid, mean)
        elite = load_controller(path / row['controller'])
        assert elite.morphology.grid_string == grid
        assert np.array_equal(elite.parameters, trained.parameters)
        assert (elite.fitness, elite.scores) == (mean, {'batched': mean})
    files = {p.name for p in path.glob('size-*.npz')}
    assert files == {row['controller'] for row in archive}
    assert len(search.elites) == len(archive) > 2


def test_scores_are_those_of_episodes_from_pushed_starts(whole, trained):
    path, _ = whole
    row = rows_of(path / 'bodies.csv')[-1]
    body = parse_morphology(row['grid'])
    for start_ in (1, 2):
        simulation = Simulation(body, 'flat', engine='batched', push=start_)
        controller = Controller(trained.architecture, body, trained.parameters)
        assert float(row[f'start_{start_}']) == run_episode(simulation, controller, 5.5).velocity()


def test_an_elite_is_a_controller_like_any_other(whole, tmp_path, capsys):
    path, search = whole
    elite = search.elites[-1]
    result = tmp_path / 'scores.json'
    assert main([
        'assess', str(path / f'{elite.name}.npz'), '--terrains', 'flat', '--starts', '2',
        '--duration', '5.5', '--engine', 'batched', '--workers', '1', '--json', str(result),
    ]) == 0
    capsys.readouterr()
    rows = json.loads(result.read_text())['scores']
    scores = {row['start']: row['v_x'] for row in rows if row['terrain'] == 'flat'}
    assert (scores[1], scores[2]) == elite.scores


def test_a_stopped_search_goes_on_as_if_never_stopped(whole, trained, tmp_path):
    searched(tmp_path, trained, stop_after=(4, 8, 11))
    assert contents_of(tmp_path) == contents_of(whole[0])
    searched(tmp_path, trained)
    assert contents_of(tmp_path) == contents_of(whole[0])


@pytest.mark.parametrize('lost', ['archive.csv', 'controller.npz', 'size-5-feet-1.npz'])
def test_what_a_kill_kept_from_being_written_is_written_again(whole, trained, tmp_path, lost):
    before = contents_of(whole[0])
    for name, content in before.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / lost).unlink()
    (tmp_path / '.bodies.csv.snca-0123456789abcdef.tmp').write_text('generation,gr')
    folder = SearchFolder(tmp_path, SETTINGS, trained)
    folder.load()
    folder.close()
    assert contents_of(tmp_path) == before


@pytest.mark.slow
def test_a_killed_search_leaves_no_process_and_goes_on_to_the_same_files(whole, tmp_path, capsys):
    """And the number of workers does not matter."""
    arguments = [WORM, '--out', tmp_path, *OPTIONS, '--episodes', EPISODES]
    process = start(*arguments, '--workers', 2)
    wait_until(lambda: (tmp_path / 'bodies.csv').exists() or process.poll() is not None, 'a batch')
    process.send_signal(signal.SIGSTOP)
    workers = offspring(process.pid)
    assert len(workers) >= 2
    process.kill()
    process.communicate(timeout=LIMIT)
    wait_until_gone(workers)
    code, out, err = bodies(*arguments, '--workers', 1, capsys=capsys)
    assert code == 0, err
    assert out.startswith(f'{tmp_path / "archive.csv"}: ')
    assert 'its own body' in out
    assert (tmp_path / 'archive.png').read_bytes().startswith(b'\x89PNG')
    assert contents_of(tmp_path) == contents_of(whole[0])


def test_a_search_ends_when_there_are_no_other_bodies():
    """In a frame of two columns and one row there are two."""
    settings = SearchSettings(episodes=50, starts=1, voxels=2, width=2, height=1)
    search = BodySearch(settings, parse_morphology('1111-1001'))
    found = search.ask()
    assert sorted(body.grid_string for body in found) == ['1', '11']
    search.tell(ScoredBody(0, body, (1.0,)) for body in found)
    assert search.ask() == []


def test_bodies_that_diverge_are_no_elites():
    search = BodySearch(SETTINGS, parse_morphology('111'))
    one, other = parse_morphology('111'), parse_morphology('11-10')
    search.tell([ScoredBody(0, one, (5.0, -np.inf)), ScoredBody(0, other, (-2.0, -1.0))])
    assert [elite.body for elite in search.elites] == [other]
    search.tell([ScoredBody(1, parse_morphology('11-01'), (-1.5, -1.5))])  # no better
    assert [elite.body for elite in search.elites] == [other]


def refused(folder, *words, settings=SETTINGS, trained=None):
    with pytest.raises(InvalidInput) as caught:
        SearchFolder(folder, settings, trained).load()
    for word in (str(folder), *words):
        assert word in str(caught.value)


@pytest.fixture
def begun(whole, tmp_path):
    """Return a copy of the folder of the whole search."""
    for name, content in contents_of(whole[0]).items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


def test_other_settings_controllers_and_files_are_refused(begun, trained, tmp_path_factory):
    other = SearchSettings(**{**vars(SETTINGS), 'seed': 4})
    refused(begun, 'seed: got 4, expected 3', settings=other, trained=trained)
    path = tmp_path_factory.mktemp('other')
    worm = load_controller(save_worm(path / 'worm.npz', seed=1))
    refused(begun, 'controller.npz', trained=worm)
    refused(path, 'other files', trained=trained)
    held = SearchFolder(begun, SETTINGS, trained)
    refused(begun, 'no other process', trained=trained)
    held.close()


@pytest.mark.parametrize(('old', 'new'), [
    (f'{HOME}5,1,', '\n0,11111,5,2,'), (HOME, '\n0,1111111,'), (HOME, '\n1,11111,'),
    (HOME, '\n0,10111,'), ('\n1,', '\n3,'), ('feet', 'legs'), (f'{HOME}5,1,,', f'{HOME}5,1'),
    (f'{HOME}5,1,,', f'{HOME}5,1,,nan,'), (f'{HOME}5,1,,', f'{HOME}5,1,,x'),
])
def test_a_changed_table_is_refused(begun, trained, old, new):
    table = begun / 'bodies.csv'
    text = table.read_text()
    assert old in text
    table.write_text(text.replace(old, new))
    refused(begun, 'bodies.csv', 'row' if old != 'feet' else 'legs', trained=trained)


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--episodes', '4'], ['episodes', 'at least 8']), (['--duration', '5'], ['duration']),
    (['--terrain', 'flatt'], ["did you mean 'flat'?"]), (['--voxels', '0'], ['voxels']),
    (['--figure', 'a.xyz'], ['figure']),
])
def test_invalid_options_are_one_line_and_no_folder(tmp_path, capsys, arguments, words):
    worm, out = save_worm(tmp_path / 'worm.npz'), tmp_path / 'out'
    code, _, err = bodies(worm, '--out', out, *arguments, capsys=capsys)
    assert (code, err.count('\n')) == (2, 1)
    assert [word for word in words if word not in err] == []
    assert not out.exists()


def test_cells_of_one_body_and_a_missing_package_are_one_line(tmp_path, capsys, monkeypatch):
    worm, out = save_worm(tmp_path / 'worm.npz', 'nU-D'), tmp_path / 'out'
    code, _, err = bodies(worm, '--out', out, capsys=capsys)
    assert (code, err.count('\n')) == (2, 1)
    assert 'uniform' in err
    save_worm(worm)
    monkeypatch.setitem(sys.modules, 'ribs.archives', None)
    code, _, err = bodies(worm, '--out', out, capsys=capsys)
    assert (code, err.count('\n')) == (2, 1)
    assert "pip install 'snca_ros[bodies]'" in err
    assert not out.exists()


def test_figure_has_a_number_per_elite_and_an_outline_per_possible_cell(whole):
    _, search = whole
    figure = draw_archive('worm_$x$', search.elites, SETTINGS.frame, TASKS['walk'])
    axes = figure.axes[0]
    texts = [text.get_text() for text in axes.texts]
    assert '-0.0' not in texts
    np.testing.assert_allclose(np.float64(texts), [e.score for e in search.elites], atol=0.05001)
    outlines, *drawn = axes.collections
    assert len(outlines.get_paths()) == len(SETTINGS.frame.cells)
    assert [len(one.get_paths()) for one in drawn] == [e.body.n_voxels for e in search.elites]
    for one, elite in zip(drawn, search.elites, strict=True):
        box = np.concatenate([path.vertices for path in one.get_paths()])
        assert (np.abs(box - elite.cell) < 0.48).all()  # inside of its cell
    assert axes.get_title(loc='left').startswith('worm_$x$: ')
    draw_archive('none', [], SETTINGS.frame, TASKS['walk'])
