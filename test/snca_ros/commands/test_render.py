"""Pictures of a walk: colours, positions, and complete files."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from imageio_ffmpeg import read_frames
from PIL import Image
from support.synthetic_bag import Walk, make_walk, messages_of_walk, write_messages

from sim_node.drawing import View, area_colors, draw_frame
from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from sim_node.model.terrain import parse_terrain
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.cli import main
from snca_ros.command_line import BAD_INPUT
from snca_ros.controller_file import save_controller
from snca_ros.recording.offline import record_offline
from snca_ros.recording.storage import read_storage
from snca_ros.rendering.film import film_bag, film_offline
from snca_ros.rendering.scene import follow
from snca_ros.trained_controller import TrainedController

VIEW = View(left=10.0, bottom=0.0, scale=20.0, width=400, height=300)


@pytest.fixture(scope='module')
def trained():
    architecture, morphology = Architecture.named('U-D', 'mlp'), parse_morphology('worm-3x1')
    theta = np.random.default_rng(0).uniform(-1, 1, architecture.n_parameters(3))
    return TrainedController(architecture, morphology, theta)


@pytest.fixture
def controller(trained, tmp_path):
    save_controller(tmp_path / 'controller.npz', trained)
    return str(tmp_path / 'controller.npz')


def test_contraction_and_expansion_have_different_colours():
    (orange, pale, blue), clipped = (
        area_colors(np.array([0.75, 1.0, 1.25])), area_colors(np.array([0.1, 1.0, 9.0]))
    )
    assert orange[0] > 2 * orange[1] > orange[2]
    assert min(pale) > 0.8
    assert blue[2] > 1.5 * blue[1] > blue[0]
    np.testing.assert_array_equal(clipped, [orange, pale, blue])


@given(st.floats(10.0, 30.0), st.floats(0.0, 15.0))
def test_pixels_of_places(x, y):
    column, row = VIEW.pixels(np.array([x, y]))
    assert column == pytest.approx((x - 10.0) * 20.0)
    assert row == pytest.approx(300.0 - y * 20.0)


def test_a_frame_shows_sky_ground_and_voxels_where_they_are():
    terrain = parse_terrain('flat')
    square = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    corners = square + np.array([[[15.0, 8.0]], [[20.0, 8.0]]])
    image = draw_frame(corners, area_colors(np.array([0.7, 1.3])), terrain, VIEW, '1.0 s')
    assert image.size == (400, 300)
    assert image.mode == 'RGB'
    for place, color in zip([(15.0, 8.0), (20.0, 8.0)], area_colors([0.7, 1.3]), strict=True):
        column, row = VIEW.pixels(np.array(place)).astype(int)
        np.testing.assert_allclose(image.getpixel((column, row)), 255 * color[:3], atol=1)
    sky, soil = image.getpixel((380, 20)), image.getpixel((380, 290))
    assert sky != soil
    row = int(VIEW.pixels(np.array([17.5, terrain.height_at(17.5)]))[1])
    assert image.getpixel((150, row - 5)) == sky


def test_a_film_is_the_walk(trained):
    film = film_offline(trained, 'flat', np.array([0.0, 0.5, 1.0]))
    simulation, controller = Simulation('worm-3x1'), trained.controller()
    readings = simulation.reset()
    for _ in range(60):
        readings = simulation.step(controller.step(readings))
    np.testing.assert_array_equal(film.times, [0.0, 0.5, 1.0])
    np.testing.assert_array_equal(film.corners[2], simulation.world.corners)
    colors = area_colors(simulation.world.area_ratios)
    np.testing.assert_allclose(film.colors[2], colors, atol=1e-9)
    np.testing.assert_array_equal(film.centers[2], simulation.center)


def test_the_camera_keeps_the_robot_in_the_picture(trained):
    moments = np.arange(0.0, 4.0, 0.1)
    films = [film_offline(trained, terrain, moments) for terrain in ('hilly-1-10-0', 'flat')]
    views = follow(films, 320, 2.4, headroom=2.0)
    assert len({(v.scale, v.width, v.height) for of_film in views for v in of_film}) == 1
    for film, of_film in zip(films, views, strict=True):
        for view, corners in zip(of_film, film.corners, strict=True):
            places = view.pixels(corners).reshape(-1, 2)
            assert (places >= [0.0, 2.0 * view.scale - 1.0]).all()
            assert (places <= [view.width, view.height]).all()


def test_a_gif(controller, tmp_path, capsys):
    out = tmp_path / 'walk.gif'
    assert main([
        'render', controller, str(out), '--duration', '1', '--start', '0.5', '--width', '160',
    ]) == 0
    with Image.open(out) as gif:
        assert gif.size[0] == 160
        shown = 0
        for i in range(gif.n_frames):
            gif.seek(i)
            shown += gif.info['duration']
        assert shown == 1000
        assert gif.n_frames > 5
        assert gif.info['loop'] == 0
    assert '20 pictures' in capsys.readouterr().out


@pytest.fixture
def walk(trained):
    """Return the first two seconds of the controller's walk, as the graph publishes them."""
    recording, _ = record_offline(trained, Path(), 2.0, 'hilly-1-10-0')
    return Walk(
        recording.voxel_names, recording.centers, recording.readings[:-1],
        recording.actuation[:-1], values=recording.values[:-1],
        corners=recording.poses.corners, ground=recording.poses.ground,
    )


@pytest.fixture
def bag(walk, tmp_path):
    return write_messages(tmp_path / 'bag', messages_of_walk(walk))


def test_a_film_of_a_bag_is_the_walk_that_was_recorded(bag, walk, trained):
    moments = np.array([0.0, 0.5, 1.0, 1.02, 1.95, 2.0, 3.0])
    film = film_bag(bag, moments)
    np.testing.assert_array_equal(film.times, np.array([0, 30, 60, 61, 117, 120]) / 60)
    shown = [0, 30, 60, 60, 116, 120]  # markers come every other step; the walk ends before 3 s
    np.testing.assert_array_equal(film.centers, walk.centers[shown])
    np.testing.assert_array_equal(film.corners, walk.corners[shown])
    np.testing.assert_array_equal(film.terrain.y, walk.ground[:, 1])
    offline = film_offline(trained, 'hilly-1-10-0', np.array(shown[:-1]) / 60)
    np.testing.assert_array_equal(film.colors[:-1], offline.colors)


def test_a_film_is_of_the_last_episode(walk, tmp_path):
    other = replace(walk, corners=walk.corners + 1.0)
    steps = messages_of_walk(other)[:60] + messages_of_walk(walk)
    film = film_bag(write_messages(tmp_path / 'reset', steps), np.array([0.0, 0.1]))
    np.testing.assert_array_equal(film.corners, walk.corners[[0, 6]])


def test_bags_that_give_no_film(bag, tmp_path, capsys):
    bare = write_messages(tmp_path / 'bare', messages_of_walk(make_walk(30)))
    out = str(tmp_path / 'walk.gif')
    for arguments, word in (
        ([str(bag), out, '--start', '2.5'], 'start'),
        ([str(bag), out, '--terrain', 'flat'], 'terrain'),
        ([str(bare), out], 'markers'),
        ([str(tmp_path), out], 'bag'),
    ):
        assert main(['render', *arguments]) == BAD_INPUT
        assert word in capsys.readouterr().err


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_markers_are_refused_or_drawn(bag, data):
    topics, closed = read_storage(bag)
    markers = topics['/biped/markers'].messages
    k = data.draw(st.integers(0, 3))
    byte = data.draw(st.integers(0, len(markers[k]) - 1))
    end = data.draw(st.sampled_from([byte, None]))
    changed = bytes([markers[k][byte] ^ data.draw(st.integers(1, 255))])
    markers[k] = markers[k][:byte] if end else (
        markers[k][:byte] + changed + markers[k][byte + 1 :]
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('snca_ros.recording.bag.read_storage', lambda path: (topics, closed))
        try:
            film = film_bag(bag, np.array([0.0, 0.05, 0.1]))
        except InvalidInput:
            return
    assert film.corners.shape == (3, 3, 4, 2)
    assert film.colors.shape == (3, 3, 4)


def test_a_movie_of_controller_and_bag_side_by_side(controller, bag, tmp_path, capsys):
    out = tmp_path / 'walks.mp4'
    assert main([
        'render', controller, str(bag), str(out), '--label', 'new', '--label', 'recorded',
        '--width', '401', '--fps', '25', '--duration', '3',
    ]) == 0
    assert '51 pictures' in capsys.readouterr().out  # the bag ends after 2 s
    frames = read_frames(str(out))
    about = next(frames)
    assert (about['codec'], about['fps'], about['duration']) == ('h264', 25.0, 2.04)
    assert (about['size'][0], len(list(frames))) == (398, 51)


def test_robots_above_one_another_have_their_names(controller, tmp_path):
    out, single = tmp_path / 'walks.gif', tmp_path / 'walk.gif'
    options = ['--duration', '0.1', '--width', '300']
    assert main(['render', controller, controller, str(out), *options, '--columns', '1']) == 0
    assert main(['render', controller, str(single), *options]) == 0
    with Image.open(out) as both, Image.open(single) as one:
        height = (both.size[1] - 6) // 2
        assert both.size == (300, 2 * height + 6)
        assert height > one.size[1]  # room for the labels
        label = both.convert('RGB').crop((0, 0, 300, 20))
        upper, lower = (
            both.convert('RGB').crop((0, y, 300, y + height)) for y in (0, height + 6)
        )
        assert upper.tobytes() == lower.tobytes()
        assert label.tobytes() != one.convert('RGB').crop((0, 0, 300, 20)).tobytes()


def test_without_the_extra_the_error_names_it(controller, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'imageio_ffmpeg', None)
    assert main(['render', controller, str(tmp_path / 'a.mp4'), '--duration', '0.1']) == BAD_INPUT
    assert 'snca_ros[video]' in capsys.readouterr().err


def test_a_strip(controller, tmp_path):
    out = tmp_path / 'walk.png'
    assert main(['render', controller, str(out), '--duration', '1', '--width', '640']) == 0
    with Image.open(out) as strip:
        assert 600 < strip.size[0] <= 640


@pytest.mark.parametrize('options', [
    ['--fps', '0'], ['--fps', 'nan'], ['--duration', '-1'], ['--width', '1'], ['--start', '-1'],
    ['--terrain', 'moon'], ['--columns', '2'], ['--columns', '0'], ['--label', 'a', '--label', 'b'],
    ['--shape', 'bipd'], ['--without', 'voxel_1_0'],
])
def test_bad_options_leave_no_file(controller, tmp_path, capsys, options):
    assert main(['render', controller, str(tmp_path / 'walk.gif'), *options]) == BAD_INPUT
    assert capsys.readouterr().err.count('\n') == 1
    assert [p.name for p in tmp_path.iterdir()] == ['controller.npz']


def test_bad_files(controller, tmp_path, capsys):
    for arguments in (
        [controller, str(tmp_path / 'walk.avi')],
        [controller, str(tmp_path / 'nowhere' / 'walk.gif'), '--duration', '0.1'],
        [str(tmp_path / 'nothing.npz'), str(tmp_path / 'walk.gif')],
    ):
        assert main(['render', *arguments]) == BAD_INPUT
        assert 'expected' in capsys.readouterr().err


def test_a_film_shows_the_other_body(controller, trained, tmp_path, capsys):
    out = str(tmp_path / 'walk.gif')
    shown = []

    class Stop(Exception):
        pass

    def scene(films, *args):
        shown.extend(films)
        raise Stop

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('snca_ros.commands.render.Scene', scene)
        with pytest.raises(Stop):
            main(['render', controller, out, '--duration', '0.5', '--shape', '1111-1001',
                  '--without', 'voxel_0_0'])
    robot = trained.in_body('1111-x001')
    (film,) = shown
    expected = film_offline(robot, 'flat', film.times)
    np.testing.assert_array_equal(film.corners, expected.corners)
    assert film.corners.shape[1] == 5
    bag = write_messages(tmp_path / 'bag', messages_of_walk(make_walk(6)))
    for option, value in (('--shape', 'biped'), ('--without', 'voxel_0_0')):
        assert main(['render', str(bag), out, option, value]) == BAD_INPUT
        assert f'no {option}: {bag} is a bag' in capsys.readouterr().err


def test_a_failure_keeps_the_old_file(controller, tmp_path, monkeypatch):
    out = tmp_path / 'walk.gif'
    out.write_bytes(b'old')

    def fail(*args, **kwargs):
        raise RuntimeError

    monkeypatch.setattr('snca_ros.rendering.encoders.Image.Image.save', fail)
    with pytest.raises(RuntimeError):
        main(['render', controller, str(out), '--duration', '0.2', '--width', '100'])
    assert out.read_bytes() == b'old'
    assert len(list(tmp_path.iterdir())) == 2
