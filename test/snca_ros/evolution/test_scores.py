"""The scores of this project's tasks, in episodes whose scores are known."""

from dataclasses import replace

import numpy as np
import pytest

import snca_ros as snca
from sim_node.errors import InvalidInput
from sim_node.walls import NO_WALLS, Walls
from snca_ros import cli
from snca_ros.campaign.specification import read_campaign
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.evaluator import evaluate
from snca_ros.evolution.tasks import TASKS, Episode
from snca_ros.evolution.workers import IN_PROCESS

RATE = 60


def score(task, x=None, y=None, touching=None, work=None, transient=0.0, walls=NO_WALLS):
    """Return the score of an episode with these rows."""
    n = len(x if y is None else y)
    centers = np.column_stack([np.zeros(n) if x is None else x, np.zeros(n) if y is None else y])
    rows = {'touching': touching, 'work': work}
    records = {name: np.array(rows[name], dtype=float) for name in TASKS[task].records}
    assert all(len(array) == n - 1 for array in records.values())
    return TASKS[task].score(
        Episode(centers, diverged=False, records=records, walls=walls), transient
    )


# --- jump -------------------------------------------------------------------------------------


def grounded(n, *flights):
    """Return `touching` of two voxels, one of which touches except in the flights [begin, end)."""
    touching = np.zeros((n, 2))
    touching[:, 1] = 1.0
    for begin, end in flights:
        touching[begin:end] = 0.0
    return touching


def test_a_jump_is_the_rise_since_the_last_contact():
    y = [1.0, 1.5, 2.5, 2.75, 2.0, 1.0]  # row k + 1 is after step k
    assert score('jump', y=y, touching=grounded(5, (1, 4))) == 1.25  # since y[1]
    assert score('jump', y=y, touching=grounded(5, (2, 3))) == 0.25
    assert score('jump', y=y, touching=grounded(5)) == 0.0  # it stood up
    assert score('jump', y=y, touching=grounded(5, (4, 5))) == 0.0  # it fell


def test_the_highest_of_several_jumps_counts_and_each_from_its_own_take_off():
    y = [0.0, 0.0, 1.0, 0.5, 5.0, 5.0, 5.5, 5.0]
    touching = grounded(7, (1, 2), (5, 6))
    assert score('jump', y=y, touching=touching) == 1.0
    assert score('jump', y=y, touching=touching, transient=3 / RATE) == 0.5


def test_a_flight_at_the_end_of_the_transient_counts_from_there():
    y = [0.0, 1.0, 2.0, 3.0, 2.5]
    assert score('jump', y=y, touching=grounded(4, (0, 4))) == 3.0
    assert score('jump', y=y, touching=grounded(4, (0, 4)), transient=2 / RATE) == 1.0
    assert score('jump', y=y, touching=grounded(4, (0, 4)), transient=4 / RATE) == 3.0  # all of it


def test_a_jump_at_the_wall_does_not_count():
    y = [0.0, 0.0, 0.5, 0.0, 4.0, 0.0]
    touching = grounded(5, (1, 2), (3, 4))
    assert score('jump', y=y, touching=touching) == 4.0
    assert score('jump', y=y, touching=touching, walls=Walls(None, 3)) == 0.5


def test_a_thrown_body_rises_by_v_squared_over_2_g():
    v, g = 3.0, 9.8
    t = np.arange(61) / RATE
    y = np.maximum(v * t - g / 2 * t**2, 0.0)
    touching = grounded(60)
    touching[(y > 0.0)[1:]] = 0.0
    assert score('jump', y=y, touching=touching) == pytest.approx(v**2 / (2 * g), rel=1e-3)


# --- climb ------------------------------------------------------------------------------------


def test_a_climb_is_measured_from_the_start_to_the_end():
    x = [2.0, 5.0, 9.0, 8.0]
    assert score('climb', x=x) == score('climb', x=x, transient=2 / RATE) == 6.0
    assert score('climb', x=x, walls=Walls(None, 2)) == 7.0
    assert score('climb', x=x[::-1]) == -6.0


# --- economy ----------------------------------------------------------------------------------


def test_economy_is_distance_after_the_transient_over_all_positive_work():
    x = np.linspace(0.0, 4.0, 121)  # 2 m/s
    work = np.zeros((120, 2))
    work[0], work[30], work[90], work[91] = (100.0, 0.0), (50.0, -20.0), (7.0, 3.0), (-5.0, -5.0)
    total = 100.0 + 50.0 + 10.0
    assert score('economy', x=x, work=work) == pytest.approx(1e3 * 4.0 / total)
    assert score('economy', x=x, work=work, transient=1.0) == pytest.approx(1e3 * 2.0 / total)
    met = Walls(None, 90)  # row 90: what step 90 and later ones take does not count
    assert score('economy', x=x, work=work, walls=met) == pytest.approx(1e3 * 3.0 / 150.0)


@pytest.mark.parametrize(('v_x', 'scores'), [
    (0.11, True), (0.1 + 1e-9, True), (0.09, False), (0.0, False), (-3.0, False),
])
def test_a_robot_below_the_floor_scores_nothing(v_x, scores):
    x = v_x * np.arange(121) / RATE
    assert (score('economy', x=x, work=np.ones((120, 1))) > 0.0) == scores


def test_the_floor_is_that_of_the_time_after_the_transient():
    x = np.minimum(np.linspace(0.0, 4.0, 121), 2.0)  # stands still in the second second
    assert score('economy', x=x, work=np.ones((120, 1))) > 0.0
    assert score('economy', x=x, work=np.ones((120, 1)), transient=1.0) == 0.0


def test_a_robot_that_is_moved_without_work_scores_nothing():
    x = np.linspace(0.0, 4.0, 121)
    assert score('economy', x=x, work=np.zeros((120, 3))) == 0.0
    assert score('economy', x=x, work=-np.ones((120, 3))) == 0.0


# --- all --------------------------------------------------------------------------------------


@pytest.mark.parametrize('task', ['jump', 'climb', 'economy'])
def test_bundled_robots_have_sensible_scores_in_both_engines(task):
    robot = snca.load('biped-U-nD-snn-h').trained
    ranges = {'jump': (0.01, 3.0), 'climb': (10.0, 200.0), 'economy': (0.01, 100.0)}
    of = TASKS[task]
    for engine in ('pymunk', 'batched'):
        simulation = robot.simulation(of.terrain, engine)
        episode = run_episode(simulation, robot.controller(), 10.0, of.records)
        low, high = ranges[task]
        assert low < of.score(episode, 5.0) < high


def test_units():
    assert {name: TASKS[name].label for name in ('jump', 'climb', 'economy')} == {
        'jump': 'rise [m]', 'climb': 'distance [m]', 'economy': 'economy [m/kJ]',
    }


CONFIG = RunConfig(
    '11-10', Architecture.named('U-nD', 'mlp'), episodes=4, population=4, duration=1.0,
    transient=0.2,
)


@pytest.mark.parametrize('task', ['jump', 'climb', 'economy'])
@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
def test_side_by_side_and_alone_the_scores_are_the_same(task, engine):
    config = replace(CONFIG, engine=engine, task=task, terrain=TASKS[task].terrain)
    several = np.random.default_rng(4).uniform(-2.0, 2.0, (5, config.n_parameters))
    together = [one.score for one in evaluate(IN_PROCESS, config, several)]
    alone = [next(evaluate(IN_PROCESS, config, one[None])).score for one in several]
    assert together == alone
    assert len({*together}) > 1


# --- the terrain of a task --------------------------------------------------------------------


def test_a_run_is_on_the_terrain_of_its_task_unless_another_one_is_given(tmp_path):
    assert RunConfig.named(task='climb').terrain == 'stairs-0.1-10'
    assert RunConfig.named(task='climb', terrain='flat').terrain == 'flat'
    assert RunConfig.named(task='jump').terrain == RunConfig.named().terrain == 'flat'
    with pytest.raises(InvalidInput, match=r"task: got 'climp', .*did you mean 'climb'\?"):
        RunConfig.named(task='climp')
    small = {'episodes': 4, 'population': 4, 'duration': 1.0, 'transient': 0.2}
    run = snca.evolve('11-10', 'U-D', 'mlp', task='climb', run=tmp_path / 'run', **small)
    assert run.best.terrain == run.config.terrain == 'stairs-0.1-10'
    assert repr(run.best).endswith(' m)')
    swept = snca.assess(run.best, faults='death=0.5@1', starts=0, duration=5.1)
    assert swept.coords['terrain'] == ('stairs-0.1-10',)


def test_commands_say_terrain_quantity_and_unit(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ['--shape', '11-10', '--architecture', 'U-D', '--neuron-model', 'mlp',
                 '--episodes', '4', '--population', '4', '--duration', '1', '--transient',
                 '0.2', '--workers', '1', '--run', 'run', '--task', 'climb']
    assert cli.main(['evolve', *arguments]) == 0
    output = capsys.readouterr()
    assert '11-10 on stairs-0.1-10' in output.err
    assert 'best.npz: distance ' in output.out
    assert ' m in pymunk' in output.out
    faulty = ['--faults', 'death=0..1..1@1', '--starts', '0', '--duration', '5.1', '--workers', '1']
    assert cli.main(['assess', 'run', *faulty, '--csv', 'scores.csv']) == 0
    header, row, _ = (tmp_path / 'scores.csv').read_text().splitlines()
    assert header.split(',')[-1] == 'distance'
    assert 'stairs-0.1-10' in row


def test_campaign_files_take_it_from_the_task(tmp_path, monkeypatch):
    monkeypatch.setattr(TASKS['walk'], 'terrain', 'uphill-10', raising=False)
    path = tmp_path / 'campaign.yaml'
    path.write_text('{shape: worm, architecture: U-D, neuron_model: mlp}')
    assert [run.terrain for run in read_campaign(path)] == ['uphill-10']
    path.write_text('{shape: worm, architecture: U-D, neuron_model: mlp, terrain: [flat]}')
    assert [run.terrain for run in read_campaign(path)] == ['flat']
