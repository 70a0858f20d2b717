"""The C of a cell equals the project's cell bit for bit: as a process, and on emulated boards."""

import pytest
from support.firmware import (
    EMULATED,
    VARIANTS,
    answers,
    assert_equal_to_cell,
    build,
    image_name,
    needs_boards,
    needs_gcc,
    random_inputs,
    requests,
    source_of,
    untrained,
    walked_inputs,
    write,
)

from snca_ros.bundled import bundled_controllers
from snca_ros.controller_file import load_controller
from snca_ros.firmware.protocol import CellCodec, check_hello, frame

BUNDLED = bundled_controllers()


def check_equal(trained, folder, inputs, voxel=0, board='posix'):
    """Build a voxel's image, run it on the inputs, compare; return the answers."""
    codec = CellCodec(trained.architecture)
    image = build(folder, image_name(trained, voxel), board)
    frames = b''.join(map(frame, requests(codec, inputs)))
    found = answers(image, frames, 2 + len(inputs.steps), board)
    hello = codec.decode(found[0])
    check_hello(hello, source_of(trained, voxel).identity, 'the process')
    assert hello.session == 0
    assert_equal_to_cell(trained, voxel, inputs, found)
    return found


@needs_gcc
@pytest.mark.parametrize(('model', 'printed', 'arithmetic'), VARIANTS)
@pytest.mark.parametrize(('name', 'options'), [
    ('U-nD', {}), ('nU-D', {'n_c': 3, 'hidden': (7, 9)}),
    ('U-D', {'n_c': 20, 'hidden': (), 'sensors': ('touch', 'area')}),  # frames of several blocks
])
def test_process_equals_cell(model, printed, arithmetic, name, options, tmp_path):
    trained = untrained(name, model, as_printed=printed, arithmetic=arithmetic, **options)
    folder = write(trained, tmp_path / 'firmware')
    check_equal(trained, folder, random_inputs(trained.architecture, 200), voxel=1)


@needs_gcc
@pytest.mark.parametrize('arithmetic', ['double', 'float32', 'int16', 'int8'])
def test_neurons_without_homeostasis_equal_the_cell(arithmetic, tmp_path):
    trained = untrained('U-D', 'snn', arithmetic=arithmetic)
    folder = write(trained, tmp_path / 'firmware')
    check_equal(trained, folder, random_inputs(trained.architecture, 200))


@needs_gcc
@pytest.mark.parametrize('arithmetic', ['int16', 'int8'])
def test_potentials_far_below_threshold_saturate_alike(arithmetic, tmp_path):
    """Sums of weights of -300 mV would reach -29 V and leave 32 bits."""
    trained = untrained('U-nD', 'snn-h', arithmetic=arithmetic)
    trained.parameters[:] = -15.0 + trained.parameters
    inputs = random_inputs(trained.architecture, 200)
    inputs.inboxes[:] = 1.0
    check_equal(trained, write(trained, tmp_path / 'firmware'), inputs)


@needs_gcc
@pytest.mark.parametrize('name', BUNDLED)
def test_bundled_controllers_equal_their_cells_on_a_walk(name, tmp_path):
    trained = load_controller(BUNDLED[name])
    voxel = trained.morphology.n_voxels // 2
    inputs = walked_inputs(trained, 120, voxel)
    spiking = trained.architecture.spiking
    for arithmetic in ('double', 'float32', *(('int16', 'int8') if spiking else ())):
        one = trained.in_arithmetic(arithmetic)
        check_equal(one, write(one, tmp_path / arithmetic), inputs, voxel)


@needs_gcc
def test_each_voxel_of_a_non_uniform_robot_has_its_own_image(tmp_path):
    trained = untrained('nU-D', 'mlp', '111-101')  # a tripod
    folder = write(trained, tmp_path / 'firmware')
    inputs = random_inputs(trained.architecture, 20)
    found = [
        check_equal(trained, folder, inputs, voxel)[0]
        for voxel in range(trained.morphology.n_voxels)
    ]
    assert len(set(found)) == trained.morphology.n_voxels


@needs_gcc
@needs_boards
@pytest.mark.parametrize(('model', 'printed', 'arithmetic'), VARIANTS)
def test_boards_equal_the_process(model, printed, arithmetic, tmp_path):
    trained = untrained('U-nD', model, as_printed=printed, arithmetic=arithmetic)
    folder = write(trained, tmp_path / 'firmware')
    inputs = random_inputs(trained.architecture, 60)
    for board in EMULATED:
        check_equal(trained, folder, inputs, board=board)
