"""Cells in lanes are the cells one by one, to the bit, whatever their lane and companions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from sim_node.numerics.lane_array import zeros
from snca_ros.cell.architecture import ARCHITECTURES, Architecture
from snca_ros.cell.cell_lanes import MAX_WIDTH, make_cells, step_group, step_group_faulty
from snca_ros.cell.layers import PAIR, padded
from snca_ros.cell.models import NEURON_MODELS
from snca_ros.controller import Controller
from snca_ros.evolution.fault_lanes import CellFaultsInLanes
from snca_ros.faults import Faults

SHAPE = parse_morphology('111-101')
N = SHAPE.n_voxels


def draw_readings(rng, n_steps, width):
    """Return (n_steps, n_voxels, 4, W) readings in [0, 1]: some still, some noise, some at ends."""
    readings = rng.uniform(0.0, 1.0, (n_steps, N, 4, width))
    readings[:, :, 0] = readings[0, :, 0]
    readings[:, :, 1] = np.round(readings[:, :, 1])
    return readings


def run_group(cells, readings):
    """Return the (n_steps, n_voxels, W) actuations of cells on `readings`."""
    width = readings.shape[3]
    sensed, actuation = zeros((N, 4), width), zeros((N, 1), width)
    actuations = np.empty((len(readings), N, width))
    for k, now in enumerate(readings):
        sensed['lane'][:] = now
        step_group(cells, sensed, k, actuation)
        actuations[k] = actuation['lane'][:, 0]
    return actuations


def of_layers(architecture, rows):
    """Return a group's (n, n_items) without padding."""
    multiple = PAIR if architecture.spiking else 1
    sizes = architecture.layer_sizes
    starts = np.cumsum([0, *(padded(n, multiple) for n in sizes)])
    return np.concatenate([rows[:, s : s + n] for s, n in zip(starts, sizes, strict=False)], axis=1)


def check(architecture, width, n_steps=300, scale=1.0):
    """Compare a group of `width` robots with as many controllers, step by step and bit by bit."""
    rng = np.random.default_rng(0)
    thetas = rng.uniform(-scale, scale, (width, architecture.n_parameters(N)))
    readings = draw_readings(rng, n_steps, width)
    state = make_cells(architecture, SHAPE, thetas, width)
    actuations = run_group(state, readings)
    spoken = 0
    for lane, theta in enumerate(thetas):
        controller = Controller(architecture, SHAPE, theta)
        alone = np.array([controller.step(now) for now in readings[..., lane]])
        np.testing.assert_array_equal(actuations[..., lane], alone)
        one = controller.cells.state
        sent = one.outbox.reshape(N, -1)
        if architecture.spiking:
            bits = state.sent_trains >> lane & 1
            np.testing.assert_array_equal(bits @ (1 << np.arange(16)), sent)
            np.testing.assert_array_equal(state.last_spike['lane'][..., lane], one.last_spike)
        else:
            np.testing.assert_array_equal(state.sent_values['lane'][..., lane], sent)
        for name, array in zip(architecture.model.state, state.network.state, strict=True):
            lanes = of_layers(architecture, array['lane'][..., lane])
            np.testing.assert_array_equal(lanes, controller.cells.variables(name), err_msg=name)
        spoken += np.count_nonzero(sent)
    assert spoken > 0


@pytest.mark.parametrize('width', [1, 4, 16])
@pytest.mark.parametrize('model', NEURON_MODELS)
@pytest.mark.parametrize('name', ARCHITECTURES)
def test_lanes_are_cells_one_by_one(name, model, width):
    check(Architecture.named(name, model), width)


@pytest.mark.parametrize('model', NEURON_MODELS)
@pytest.mark.parametrize('hidden', [(), (1,), (7,), (5, 3), (30, 9, 11)])
def test_other_layers(model, hidden):
    check(Architecture.named('nU-D', model, n_c=2, hidden=hidden), 4, n_steps=100, scale=3.0)


@pytest.mark.parametrize('model', ['snn', 'snn-h'])
def test_as_printed(model):
    check(Architecture.named('U-D', model, as_printed=True), 4)


@pytest.mark.parametrize(('model', 'arithmetic'), [('snn-h', 'int8'), ('mlp', 'float32')])
def test_other_arithmetic(model, arithmetic):
    check(Architecture.named('U-D', model, arithmetic=arithmetic), 4)


@pytest.mark.parametrize(('name', 'model'), [('U-nD', 'snn-h'), ('nU-D', 'mlp')])
def test_lanes_do_not_matter(name, model):
    architecture = Architecture.named(name, model)
    rng = np.random.default_rng(1)
    thetas = rng.uniform(-1.0, 1.0, (4, architecture.n_parameters(N)))
    readings = draw_readings(rng, 200, 4)
    together = run_group(make_cells(architecture, SHAPE, thetas, 4), readings)
    order = np.array([2, 0, 3, 1])
    shuffled = run_group(make_cells(architecture, SHAPE, thetas[order], 4), readings[..., order])
    np.testing.assert_array_equal(shuffled, together[..., order])
    few = run_group(make_cells(architecture, SHAPE, thetas[:2], 16), np.tile(readings, 4))
    np.testing.assert_array_equal(few[..., :2], together[..., :2])
    for lane in range(4):
        own = thetas[lane : lane + 1], readings[..., lane : lane + 1]
        alone = run_group(make_cells(architecture, SHAPE, own[0], 1), own[1])
        np.testing.assert_array_equal(alone[..., 0], together[..., lane])


def test_a_lost_robot_does_not_disturb_the_others():
    architecture = Architecture.named('U-nD', 'snn-h')
    rng = np.random.default_rng(2)
    thetas = rng.uniform(-1.0, 1.0, (4, architecture.n_parameters(N)))
    readings = draw_readings(rng, 100, 4)
    sound = run_group(make_cells(architecture, SHAPE, thetas, 4), readings)
    readings[50:, ..., 3] = np.nan
    disturbed = run_group(make_cells(architecture, SHAPE, thetas, 4), readings)
    np.testing.assert_array_equal(disturbed[..., :3], sound[..., :3])


deaths = st.just('') | st.builds(
    lambda who, begin, length: f'{who}@{begin / 60:.4f}-{(begin + length) / 60:.4f}',
    st.sampled_from(['0.5', '1', 'voxel_0_0', 'voxel_1_1+voxel_2_0']),
    st.integers(0, 40), st.integers(1, 30),
)
some_faults = st.builds(
    Faults, loss=st.sampled_from([0.0, 0.3, 1.0]), delay=st.integers(0, 4), death=deaths,
    seed=st.integers(0, 9),
)


@pytest.mark.parametrize(('name', 'model'), [
    ('U-nD', 'snn-h'), ('nU-D', 'snn-h'), ('U-nD', 'mlp'), ('nU-D', 'mlp'),
])
@settings(max_examples=12)
@given(faults=st.lists(some_faults, min_size=4, max_size=4))
def test_cells_with_faults_of_their_own_are_cells_one_by_one(name, model, faults):
    architecture, n_steps = Architecture.named(name, model), 70
    rng = np.random.default_rng(3)
    thetas = rng.uniform(-2.0, 2.0, (4, architecture.n_parameters(N)))
    readings = draw_readings(rng, n_steps, 4)
    cells = make_cells(architecture, SHAPE, thetas, 4)
    of_all = CellFaultsInLanes(faults, architecture, SHAPE)
    tables = {0: of_all.tables(0, 30), 30: of_all.tables(30, n_steps - 30)}
    controllers = [
        Controller(architecture, SHAPE, theta, own)
        for theta, own in zip(thetas, faults, strict=True)
    ]
    sensed, actuation = zeros((N, 4), 4), zeros((N, 1), 4)
    for k, now in enumerate(readings):
        first = 30 if k >= 30 else 0
        sensed['lane'][:] = now
        step_group_faulty(cells, sensed, k, actuation, tables[first], k - first)
        for lane, controller in enumerate(controllers):
            alone = controller.step(now[..., lane])
            np.testing.assert_array_equal(actuation['lane'][:, 0, lane], alone, f'{lane}, {k}')
            sent = controller.cells.state.outbox.reshape(N, -1)
            if architecture.spiking:
                bits = cells.sent_trains >> lane & 1
                np.testing.assert_array_equal(bits @ (1 << np.arange(16)), sent)
            else:
                np.testing.assert_array_equal(cells.sent_values['lane'][..., lane], sent)


@pytest.mark.parametrize(
    ('shape', 'width'), [((5, 500), 4), ((1, 499), 4), ((500,), 4), ((1, 500), MAX_WIDTH + 1)]
)
def test_refuses(shape, width):
    architecture = Architecture.named('U-nD', 'snn-h')
    with pytest.raises(InvalidInput):
        make_cells(architecture, SHAPE, np.zeros(shape), width)
    with pytest.raises(InvalidInput, match='finite'):
        make_cells(architecture, SHAPE, np.full((1, 500), np.nan), 4)
