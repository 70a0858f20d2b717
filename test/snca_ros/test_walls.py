"""An episode that meets a wall says so wherever it is scored, shown or evolved.

The ground of these tests is shorter than the real one, so that robots reach its end soon.
"""

import contextlib
import csv
import json

import numpy as np
import pytest

import snca_ros as snca
from sim_node.batched.engine import Robots
from sim_node.model import terrain
from sim_node.simulation import Simulation
from sim_node.walls import NO_WALLS, Walls
from snca_ros.assessment.trials import Trial, score
from snca_ros.bundled import DEFAULT_CONTROLLER
from snca_ros.cli import main
from snca_ros.controller_file import load_controller
from snca_ros.evolution.episode import mean_velocity, run_episode, run_step_by_step
from snca_ros.evolution.episode_lanes import run_episodes
from snca_ros.evolution.workers import IN_PROCESS
from snca_ros.recording.gait import measure_gait
from snca_ros.recording.offline import record_offline
from snca_ros.recording.report import as_dict, report_lines
from snca_ros.web.page import walk_page

END = 75.0  # x of the foot of the wall at the end [m]
SECONDS = 13.0


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(terrain, 'LENGTH', END + terrain.WALL_WIDTH)


@pytest.fixture
def here(monkeypatch):
    """Let commands evaluate in this process, which has the short ground."""
    for command in ('assess', 'evolve'):
        workers = contextlib.nullcontext(IN_PROCESS)
        monkeypatch.setattr(f'snca_ros.commands.{command}.open_workers', lambda args, w=workers: w)


@pytest.fixture(scope='module')
def robot():
    return snca.load(DEFAULT_CONTROLLER)


def test_a_wall_is_met_where_a_corner_is_beyond_its_foot(robot):
    episode = robot.run(SECONDS, record='corners')
    x = episode.corners[::2, :, :, 0]  # of the steps with an outline
    behind, ahead = (
        2 * int(np.argmax(met.any(axis=(1, 2)))) for met in (x < terrain.WALL_WIDTH, x > END)
    )
    assert episode.walls == Walls(behind or None, ahead)
    assert 300 < ahead < 60 * SECONDS
    assert episode.v_x == mean_velocity(episode.centers[: ahead + 1, 0])
    assert episode.v_x > mean_velocity(episode.centers[:, 0]) + 0.5
    assert f'met the wall at the end of the ground at {ahead / 60:.2f} s' in repr(episode)


@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
def test_each_way_to_run_an_episode_meets_it_at_the_same_step(robot, engine):
    trained = robot.trained
    simulation = trained.simulation('flat', engine)
    whole = run_step_by_step(simulation, trained.controller(), round(60 * SECONDS))
    assert whole.walls.ahead is not None
    if engine == 'pymunk':
        others = [run_episode(simulation, trained.controller(), SECONDS), robot.run(SECONDS)]
    else:
        robots = Robots(
            trained.morphology, simulation.terrain, trained.material, trained.solver, 4
        )
        still = np.zeros_like(trained.parameters)
        candidates = np.stack([still, trained.parameters])
        idle, other = run_episodes(
            robots, trained.architecture, trained.morphology, candidates, SECONDS
        )
        assert idle.walls == NO_WALLS
        others = [other]
    for other in others:
        np.testing.assert_array_equal(other.centers, whole.centers)
        assert (other.walls, other.velocity()) == (whole.walls, whole.velocity())
    found = score(Trial(trained, 'flat', engine, duration=SECONDS))
    assert found == (whole.velocity(), whole.walls)


def test_a_reset_and_a_shorter_episode_meet_none(robot):
    simulation = robot.trained.simulation('flat')
    simulation.meetings[:] = 7
    assert run_episode(simulation, robot.trained.controller(), 0.1).walls == NO_WALLS


def test_a_wall_behind_the_start_holds_the_robot_and_is_named():
    simulation = Simulation('1')
    simulation.backend.world.corners[..., 0] -= 2.0
    simulation.step(np.zeros(1))
    assert simulation.walls == NO_WALLS  # outlines are looked at in every second step
    walls = Walls(behind=30, ahead=None)
    assert walls.describe() == ['met the wall behind its start at 0.50 s']
    rows = np.arange(60)
    assert walls.free_part(rows) is rows


def test_a_recording_its_report_and_its_page_say_so(robot, tmp_path):
    recording, _ = record_offline(robot.trained, tmp_path, SECONDS)
    episode, gait = robot.run(SECONDS), measure_gait(recording)
    assert recording.walls == episode.walls == gait.walls
    assert recording.v_x == episode.v_x == gait.velocity
    text = f'met the wall at the end of the ground at {episode.walls.ahead / 60:.2f} s'
    assert f'wall       {text}' in report_lines(recording, gait)
    found = json.loads(json.dumps(as_dict(recording, gait)))['walls_met']
    assert tuple(found.values()) == episode.walls.times
    assert text in walk_page(recording, 'title')
    assert text in repr(recording)


def test_pictures_say_so(tmp_path, capsys):
    out = tmp_path / 'poses.png'
    assert main(['render', DEFAULT_CONTROLLER, str(out), '--duration', str(SECONDS)]) == 0
    assert f'{DEFAULT_CONTROLLER} met the wall at the end of the ' in capsys.readouterr().out


def test_an_assessment_says_so(here, robot, tmp_path, capsys):
    table, results = tmp_path / 'scores.csv', tmp_path / 'scores.json'
    arguments = ['--terrains', 'flat', '--duration', str(SECONDS), '--json', str(results)]
    assert main(['assess', DEFAULT_CONTROLLER, *arguments, '--csv', str(table)]) == 0
    printed = capsys.readouterr().out
    assert 'in 1 of 1 episodes the robot met the wall at the end of the ground' in printed
    row = next(csv.DictReader(table.open()))
    ahead = robot.run(SECONDS).walls.ahead
    assert float(row['wall_ahead']) == pytest.approx(ahead / 60)
    scored = json.loads(results.read_text())['scores'][0]
    assert (scored['wall_behind'], scored['wall_ahead']) == (None, float(row['wall_ahead']))
    scores = snca.assess(robot, 'flat', duration=SECONDS)
    assert scores.wall_times.shape == (1, 1, 1, 1, 2)
    assert scores.wall_times[0, 0, 0, 0, 1] == ahead / 60
    assert '1 met the wall at the end of the ground' in repr(scores)


def test_evolution_says_so_and_its_files_keep_it(here, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(terrain, 'LENGTH', 20.3 + terrain.WALL_WIDTH)  # 0.3 m ahead of the robot
    run = tmp_path / 'run'
    arguments = ['--shape', 'worm-3x1', '--duration', '1', '--transient', '0.1',
                 '--episodes', '12', '--population', '4']
    assert main(['evolve', *arguments, '--run', str(run)]) == 0
    trained = load_controller(run / 'best.npz')
    assert trained.wall_time is not None
    time = f'{trained.wall_time:.2f} s'
    assert f'met the wall at the end of the ground at {time}' in capsys.readouterr().out
    assert f'(met the wall at {time})' in repr(snca.load(run))
    again = Trial(trained, 'flat', duration=1.0, transient=0.1)
    assert (score(again).score, score(again).walls.times[1]) == (trained.fitness, trained.wall_time)
    assert main(['history', str(run)]) == 0
    assert f'met the wall at the end of the ground at {time}' in capsys.readouterr().out
    assert main(['evolve', '--resume', str(run)]) == 0  # from the checkpoint
    assert load_controller(run / 'best.npz').wall_time == trained.wall_time
