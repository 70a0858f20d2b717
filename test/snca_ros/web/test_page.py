"""The page in a browser: it loads, plays, scrubs, and shows the right thing at the right time."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from support.made_recording import made_recording
from support.synthetic_bag import Walk, messages_of_walk, write_messages

from sim_node.model.morphology import parse_morphology
from sim_node.model.physics import PHYSICS
from sim_node.model.solver import Solver
from snca_ros.cell.architecture import Architecture
from snca_ros.cli import main
from snca_ros.command_line import BAD_INPUT
from snca_ros.controller_file import save_controller
from snca_ros.recording.offline import record_offline
from snca_ros.recording.outcomes import Outcome
from snca_ros.trained_controller import TrainedController
from snca_ros.web.page import walk_page

DURATION = 3.0


@pytest.fixture(scope='module')
def trained():
    architecture, morphology = Architecture.named('U-D', 'snn-h'), parse_morphology('11-10')
    theta = np.random.default_rng(0).uniform(-1, 1, architecture.n_parameters(3))
    return TrainedController(architecture, morphology, theta)


@pytest.fixture(scope='module')
def controller(trained, tmp_path_factory):
    path = tmp_path_factory.mktemp('controller') / 'duo.npz'
    save_controller(path, trained)
    return path


@pytest.fixture(scope='module')
def recording(trained, tmp_path_factory):
    return record_offline(trained, tmp_path_factory.mktemp('walk'), DURATION, 'hilly-1-10-0')[0]


@pytest.fixture(scope='module')
def bag(recording, tmp_path_factory):
    """The walk as a recorder would have written it."""
    n = recording.n_steps - 1
    walk = Walk(
        recording.voxel_names, recording.centers, recording.readings[:n], recording.actuation[:n],
        recording.spikes[:n], corners=recording.poses.corners, ground=recording.poses.ground,
    )
    return write_messages(tmp_path_factory.mktemp('bags') / 'bag', messages_of_walk(walk, 'duo'))


@pytest.fixture(scope='module')
def address(bag, controller):
    assert main(['report', str(bag), '--html', '--controller', str(controller)]) == 0
    return (bag / 'replay.html').as_uri()


@pytest.fixture
def page(address, open_page):
    return open_page(address)


@pytest.mark.parametrize('step', [0, 60, 119, 180])
def test_the_right_position_at_the_right_time(page, recording, step):
    page.evaluate('step => player.seek(step / 60)', step)
    state = page.evaluate('player.state()')
    assert state['step'] == step
    before, after = recording.centers[step // 2 * 2], recording.centers[(step + 1) // 2 * 2]
    np.testing.assert_allclose([state['x'], state['y']], (before + after) / 2, atol=1e-3)
    if step % 2 == 0:
        corners = page.evaluate('t => [0, 1, 2].map((i) => player.walk.corners(i, t))', step / 60)
        np.testing.assert_allclose(corners, recording.poses.corners[step], atol=2e-3)
    assert page.text_content('#time') == f'{step / 60:.2f} s'
    assert page.text_content('#place') == f'x {state["x"]:.1f} m'


def test_the_canvas_shows_a_voxel_in_the_colour_of_its_area_where_it_is(page, recording):
    page.evaluate('player.seek(1)')
    found = page.evaluate("""() => {
      const shape = player.stage.shapes[1], [x, y] = [0, 1].map(
        (i) => 0.9 * shape[0][i] + 0.1 * shape[2][i]);
      const pixel = player.stage.canvas.getContext('2d').getImageData(x, y, 1, 1).data;
      return {at: player.stage.voxelAt(x, y), pixel: [...pixel].slice(0, 3), shape,
              want: areaColor(player.walk.at('area', 30, 1)),
              scale: player.stage.scale, left: player.stage.left};
    }""")
    assert found['at'] == 1
    wanted = [int(n) for n in re.findall(r'\d+', found['want'])]
    np.testing.assert_allclose(found['pixel'], wanted, atol=3)
    x = np.array(found['shape'])[:, 0] / found['scale'] + found['left']
    np.testing.assert_allclose(x, recording.poses.corners[60, 1, :, 0], atol=2e-3)


def test_it_plays_pauses_and_stops_at_the_end(page):
    page.click('#play')
    page.wait_for_function('player.time > 0.3')
    assert page.get_attribute('#play', 'aria-label') == 'pause'
    page.click('#play')
    stopped = page.evaluate('player.time')
    page.evaluate('() => new Promise(requestAnimationFrame)')
    assert page.evaluate('player.time') == stopped
    page.select_option('#speed', '8')
    page.click('#play')
    page.wait_for_function('!player.playing')
    assert page.evaluate('player.time') == DURATION
    page.click('#play')
    page.wait_for_function('player.time < 1')


def test_speed_is_that_of_time(page):
    page.select_option('#speed', '0.5')
    simulated, wall = page.evaluate("""async () => {
      const frame = () => new Promise(requestAnimationFrame);
      player.toggle();
      const begin = await frame(), first = player.time;
      let now = begin;
      while (now - begin < 500) now = await frame();
      return [player.time - first, (now - begin) / 1000];
    }""")
    assert simulated == pytest.approx(0.5 * wall, abs=0.05)


def test_scrubbing_by_slider_and_by_plot(page):
    page.fill('#scrub', '90')
    assert page.evaluate('player.time') == 1.5
    box = page.locator('#plot-v_x .u-over').bounding_box()
    page.mouse.click(box['x'] + box['width'] / 3, box['y'] + 5)
    assert page.evaluate('player.time') == pytest.approx(DURATION / 3, abs=0.02)
    assert page.input_value('#scrub') == str(page.evaluate('Math.round(player.time * 60)'))


def test_keys(page):
    def state_after(*keys):
        for key in keys:
            page.keyboard.press(key)
        return page.evaluate('player.state()')

    assert state_after('ArrowRight', '.')['step'] == 61
    assert state_after('ArrowLeft', ',')['step'] == 0
    assert state_after('End')['step'] == 180
    assert state_after('Home')['step'] == 0
    assert state_after('+')['speed'] == 2
    assert state_after('-', '-')['speed'] == 0.5
    assert state_after('n')['from'] == 0
    assert state_after('p')['from'] == 2
    assert 'from' not in state_after('Escape')
    assert state_after(' ')['playing']
    assert not state_after(' ')['playing']


def test_voxels_and_connections_are_selected(page, recording):
    assert page.evaluate('player.raster.groups(player.selection).length') == 3
    place = page.evaluate('middle(player.stage.shapes[1])')
    page.locator('#stage').click(position={'x': place[0], 'y': place[1]})
    assert page.evaluate('player.state().from') == 1
    assert page.input_value('#choice') == '1'
    page.select_option('#choice', '1>2')
    groups = page.evaluate('player.raster.groups(player.selection)')
    assert groups == [{'label': '0,1', 'voxel': 1, 'channels': [3]}]  # the cell on its right
    page.evaluate('player.seek(2)')
    drawn = page.evaluate("""() => {
      const {canvas} = player.raster, context = canvas.getContext('2d');
      const line = context.getImageData(0, canvas.height / 2, canvas.width, 1).data;
      return [...Array(canvas.width).keys()].filter((x) => x >= 34 && line[4 * x + 3] > 0);
    }""")
    trains = recording.spikes[:, 1, 3].reshape(-1)
    times = np.flatnonzero(trains) / 960.0
    width = page.evaluate('player.raster.canvas.width')
    ticks = 34 + (times - 0.5) * (width - 34) / 2.0
    inside = ticks[(ticks > 36) & (ticks < width - 4)]
    assert len(inside) > 5
    assert all(np.abs(np.array(drawn) - tick).min() <= 2 for tick in inside)
    needle = 34 + 1.5 * (width - 34) / 2.0
    marks = np.append(ticks, needle)
    assert all(np.abs(marks - x).min() <= 3 for x in drawn)


def test_a_death_is_seen_on_slider_raster_and_robot(open_page, tmp_path):
    outcomes = np.zeros((120, 3), dtype=np.uint8)
    outcomes[30:60, 1], outcomes[60:90, 1] = Outcome.HELD, Outcome.LIMP
    late = outcomes > 0
    recording = made_recording(outcomes=outcomes, late=late, heard=~late)
    (tmp_path / 'page.html').write_text(walk_page(recording, 'dead'))
    page = open_page((tmp_path / 'page.html').as_uri())
    shades = page.evaluate('[10, 40, 70, 100].map((step) => player.walk.shade(step, 1) ?? "")')
    assert shades == ['', 'held', 'limp', '']
    columns = page.evaluate('[{}, {from: 1}, {from: 0}].map((s) => player.spans.columns(119, s))')
    assert columns[0] == columns[1] == [None] * 30 + ['held'] * 30 + ['limp'] * 30 + [None] * 29
    assert columns[2] == [None] * 119
    page.evaluate('player.select({from: 1}), player.seek(1.25)')
    strip, robot, ticks = page.evaluate("""() => {
      const read = (canvas, ...where) =>
        [...canvas.getContext('2d').getImageData(...where).data];
      const {spans, stage, raster} = player, shape = stage.shapes[1], {canvas} = raster;
      const row = read(spans.canvas, 0, 2, spans.canvas.width, 1);
      const alpha = (time) => row[4 * Math.round(spans.canvas.width * time / 1.98333) + 3];
      const [x, y] = [0, 1].map((i) => 0.9 * shape[0][i] + 0.1 * shape[2][i]);
      const area = areaColor(player.walk.at('area', 37, 1)).match(/[0-9]+/g).map(Number);
      const pixels = read(canvas, 0, 0, canvas.width, canvas.height), drawn = new Set();
      for (let i = 0; i < pixels.length; i += 4)
        drawn.add('#' + [0, 1, 2].map((j) => pixels[i + j].toString(16).padStart(2, '0')).join(''));
      return [
        [0.1, 0.75, 1.25].map(alpha),
        read(stage.canvas, x, y, 1, 1).slice(0, 3).some((c, i) => Math.abs(c - area[i]) > 20),
        ['spike', 'late'].map((name) => drawn.has(color(name))),
      ];
    }""")
    assert strip[0] == 0 < strip[1] < strip[2]
    assert robot, 'the voxel is not shaded'
    assert ticks == [True, True]


@pytest.mark.parametrize('size', ['phone', 'wide'])
@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_it_fits_and_follows_the_colour_scheme(open_page, recording, tmp_path, size, scheme):
    (tmp_path / 'page.html').write_text(walk_page(recording, 'duo'))
    page = open_page((tmp_path / 'page.html').as_uri(), size, scheme)
    assert page.evaluate('document.documentElement.scrollWidth <= innerWidth')
    paper = page.evaluate('getComputedStyle(document.body).backgroundColor')
    assert (sum(map(int, re.findall(r'\d+', paper))) < 200) == (scheme == 'dark')
    small = page.evaluate("""() => [...document.querySelectorAll('button, select')]
      .filter((e) => e.offsetParent && e.offsetHeight < 36).length""")
    assert small == 0


def test_ten_minutes_load_within_three_seconds(open_page, tmp_path):
    recording = made_recording(36_001, 10)  # random numbers: nothing to compress
    page_file = tmp_path / 'page.html'
    page_file.write_text(walk_page(recording, 'ten', thresholds=np.zeros((36_001, 10))))
    seconds = []
    for _ in range(3):  # others may use the machine meanwhile
        page = open_page(page_file.as_uri())
        seconds.append(page.evaluate('performance.now()') / 1000)
        page.evaluate('player.seek(600)')
        assert page.evaluate('player.state().x') == pytest.approx(1800.0, abs=0.01)
    assert min(seconds) < 3.0


def test_a_run_has_its_history(tmp_path, open_page, capsys):
    run = tmp_path / 'run'
    evolve = ['evolve', '--shape', '11', '--episodes', '8', '--population', '4', '--duration',
              '1', '--transient', '0', '--workers', '1', '--run', str(run)]
    assert main(evolve) == 0
    assert main(['replay', str(run), '--duration', '1']) == 0
    page = open_page((run / 'replay.html').as_uri())
    assert page.evaluate('header.history.episodes') == [4, 7, 8]
    assert page.evaluate('header.historyLabel') == 'v_x [m/s]'
    assert page.locator('#plot-history canvas').is_visible()
    assert page.evaluate('player.walk.duration') == 1
    capsys.readouterr()


@pytest.mark.parametrize('model', ['mlp', 'snn'])
def test_messages_of_the_cells_of_a_controller(tmp_path, monkeypatch, open_page, capsys, model):
    architecture = Architecture.named('U-nD', model)
    theta = np.random.default_rng(0).uniform(-1, 1, architecture.n_parameters(3))
    trained = TrainedController(architecture, parse_morphology('11-10'), theta)
    save_controller(tmp_path / 'duo.npz', trained)
    monkeypatch.chdir(tmp_path)
    assert main(['replay', 'duo.npz', '--duration', '1', '--faults', 'loss=0.5']) == 0
    page = open_page((tmp_path / 'duo.html').as_uri(), 'phone')
    for panel in ('rate', 'threshold'):
        assert page.locator(f'#panel-{panel}').is_visible() == (model == 'snn')
    page.select_option('#choice', '0')
    capsys.readouterr()


def test_names_cannot_break_the_page(open_page, recording, tmp_path):
    name = '</script><b onclick="x">$title & \'so\''
    (tmp_path / 'page.html').write_text(walk_page(recording, name, facts=[name]))
    page = open_page((tmp_path / 'page.html').as_uri())
    assert page.text_content('h1') == page.title() == name


def test_a_bag_becomes_a_page_beside_it(bag, capsys):
    assert main(['replay', str(bag)]) == 0
    assert f'page: {bag / "replay.html"}' in capsys.readouterr().out
    assert not re.search(r'(src|href)="(?!data:)', (bag / 'replay.html').read_text())


@pytest.mark.parametrize('command', [['replay'], ['report', '--html']])
@pytest.mark.parametrize('physics', PHYSICS)
def test_a_controller_of_another_physics_than_the_bag_gives_a_warning(
    trained, bag, tmp_path, capsys, command, physics
):
    path, words = tmp_path / 'c.npz', 'evolved in the physics first, the bag was recorded in'
    save_controller(path, replace(trained, solver=Solver(physics=physics)))
    assert main([command[0], str(bag), *command[1:], '--controller', str(path)]) == 0
    err, page = capsys.readouterr().err, (bag / 'replay.html').read_text()
    assert 'voxels, physics reference</p>' in page
    assert f'evolved on flat in the physics {physics} for' in page
    assert err.count('\n') == err.count(words) == page.count(words) == (physics == 'first')


def test_page_of_a_controller_in_another_body(controller, trained, tmp_path, capsys):
    page = tmp_path / 'page.html'
    assert main(['replay', str(controller), str(page), '--shape', '111-101', '--without',
                 'voxel_0_0', '--duration', '0.5']) == 0
    text = page.read_text()
    assert '<title>duo as 111-101 without voxel_0_0 on flat' in text
    assert '111-101 without voxel_0_0, 4 voxels, U-D snn-h, evolved as 11-10 on flat' in text
    expected, _ = record_offline(trained.in_body('111-x01'), page, 0.5)
    names = 'voxel_2_0', 'voxel_0_1', 'voxel_1_1', 'voxel_2_1'
    assert f'"voxels": {json.dumps(names)}' in text
    assert f'v_x {expected.v_x:.3f} m/s' in text
    with pytest.raises(SystemExit):
        main(['replay', str(tmp_path), '--shape', 'biped'])
    assert 'are for controllers and runs, not for bags' in capsys.readouterr().err


def test_bad_input_is_reported_in_one_line(bag, controller, tmp_path, capsys):
    other = tmp_path / 'other.npz'
    architecture = Architecture.named('U-nD', 'snn')
    save_controller(other, TrainedController(
        architecture, parse_morphology('111'), np.zeros(architecture.n_parameters(3))
    ))
    cases = (
        ['replay', str(tmp_path / 'nowhere')],
        ['replay', str(bag), str(tmp_path / 'nowhere' / 'page.html')],
        ['replay', str(bag), '--controller', str(other)],
        ['replay', str(controller), '--duration', '0'],
        ['replay', str(controller), '--shape', 'bipd'],
        ['replay', str(controller), '--without', 'voxel_0_1'],
        ['replay', str(controller), '--terrain', 'hily-1-10-0'],
    )
    for case in cases:
        assert main(case) == BAD_INPUT
        err = capsys.readouterr().err
        assert err.startswith('snca replay: error: ')
        assert err.count('\n') == 1
    assert not list(tmp_path.rglob('*.html'))
