"""Pictures of a walk: right colours, right places, whole files."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from sim_node.morphology import parse_morphology
from sim_node.render import View, area_colors, draw_frame
from sim_node.simulation import Simulation
from sim_node.terrain import parse_terrain
from snca_ros.cell.nca import Architecture
from snca_ros.cli import BAD_INPUT, main
from snca_ros.controller_file import TrainedController, save_controller
from snca_ros.study.render import follow, shoot

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


def test_colours_tell_contraction_from_expansion():
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
    image = draw_frame(corners, np.array([0.7, 1.3]), terrain, VIEW, '1.0 s')
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
    film = shoot(trained, 'flat', np.array([0.0, 0.5, 1.0]))
    simulation, controller = Simulation('worm-3x1'), trained.controller()
    readings = simulation.reset()
    for _ in range(60):
        readings = simulation.step(controller.step(readings))
    np.testing.assert_array_equal(film.times, [0.0, 0.5, 1.0])
    np.testing.assert_array_equal(film.corners[2], simulation.world.corners)
    np.testing.assert_array_equal(film.area_ratios[2], simulation.world.area_ratios)
    np.testing.assert_array_equal(film.centers[2], simulation.center)


def test_the_camera_keeps_the_robot_in_the_picture(trained):
    film = shoot(trained, 'hilly-1-10-0', np.arange(0.0, 4.0, 0.1))
    for view, corners in zip(follow(film, 320, 2.4), film.corners, strict=True):
        places = view.pixels(corners).reshape(-1, 2)
        assert (places >= 0.0).all()
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


def test_a_strip(controller, tmp_path):
    out = tmp_path / 'walk.png'
    assert main(['render', controller, str(out), '--duration', '1', '--width', '640']) == 0
    with Image.open(out) as strip:
        assert 600 < strip.size[0] <= 640


@pytest.mark.parametrize('options', [
    ['--fps', '0'], ['--fps', 'nan'], ['--duration', '-1'], ['--width', '1'], ['--start', '-1'],
    ['--terrain', 'moon'],
])
def test_bad_options_leave_no_file(controller, tmp_path, capsys, options):
    assert main(['render', controller, str(tmp_path / 'walk.gif'), *options]) == BAD_INPUT
    assert capsys.readouterr().err.count('\n') == 1
    assert [p.name for p in tmp_path.iterdir()] == ['controller.npz']


def test_bad_files(controller, tmp_path, capsys):
    for arguments in (
        [controller, str(tmp_path / 'walk.mp4')],
        [controller, str(tmp_path / 'nowhere' / 'walk.gif'), '--duration', '0.1'],
        [str(tmp_path / 'nothing.npz'), str(tmp_path / 'walk.gif')],
    ):
        assert main(['render', *arguments]) == BAD_INPUT
        assert 'expected' in capsys.readouterr().err


def test_a_failure_keeps_the_old_file(controller, tmp_path, monkeypatch):
    out = tmp_path / 'walk.gif'
    out.write_bytes(b'old')

    def fail(*args, **kwargs):
        raise RuntimeError

    monkeypatch.setattr('snca_ros.study.render.Image.Image.save', fail)
    with pytest.raises(RuntimeError):
        main(['render', controller, str(out), '--duration', '0.2', '--width', '100'])
    assert out.read_bytes() == b'old'
    assert len(list(tmp_path.iterdir())) == 2
