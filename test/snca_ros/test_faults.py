"""One description of faults; and cells with lost, late and no messages, against lone cells."""

import contextlib
from dataclasses import asdict

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.morphology import OPPOSITE, parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells
from snca_ros.controller import Controller, own_parameters
from snca_ros.faults import CellFaults, Faults, VoxelFaults, parse_faults

SHAPE = parse_morphology('11-10')
N_STEPS = 90
TEXT = (
    'loss=0.3,delay=2,death=0.5@10-20,broken_sensors=frozen:voxel_0_0+voxel_1_1@1,'
    'broken_actuators=random:1@2-3.5,sensor_noise=0.05,seed=7'
)


# --- the description ----------------------------------------------------------------------------


def test_text_and_file_say_the_same(tmp_path):
    faults = parse_faults(TEXT)
    assert faults == Faults(
        0.3, 2, '0.5@10-20', 'frozen:voxel_0_0+voxel_1_1@1', 'random:1@2-3.5', 0.05, 7
    )
    (tmp_path / 'faults.yaml').write_text(yaml.safe_dump(asdict(faults)))
    assert parse_faults(str(tmp_path / 'faults.yaml')) == faults
    assert {**faults.of_body, **faults.of_cells} == asdict(faults)


def test_no_faults(tmp_path):
    (tmp_path / 'empty.yaml').write_text('# nothing\n')
    assert parse_faults('') == parse_faults(str(tmp_path / 'empty.yaml')) == Faults()


def test_numbers_of_a_file_may_stand_for_texts_and_texts_for_numbers(tmp_path):
    (tmp_path / 'faults.yaml').write_text('death: 0.5\nloss: 1\ndelay: "3"\n')
    assert parse_faults(str(tmp_path / 'faults.yaml')) == Faults(1, 3, '0.5')


@pytest.mark.parametrize(('text', 'field'), [
    ('loss=1.1', 'loss'), ('loss=-0.1', 'loss'), ('loss=nan', 'loss'), ('loss=', 'loss'),
    ('delay=1.5', 'delay'), ('delay=1001', 'delay'), ('seed=-1', 'seed'), ('death=2', 'death'),
    ('sensor_noise=a', 'sensor_noise'), ('broken_sensors=0.5', 'broken_sensors'),
    ('broken_actuators=zero:voxel', 'broken_actuators'), ('loss=0.1,loss=0.2', 'faults'),
    ('lost=0.1', "did you mean 'loss'"), ('loss=0.1,delay', 'faults'), ('=', 'faults'),
])
def test_bad_texts_are_named(text, field):
    with pytest.raises(InvalidInput, match=field):
        parse_faults(text)


@pytest.mark.parametrize(('content', 'field'), [
    ('loss: true', 'loss'), ('- loss', 'faults'), ('loss: [1]', 'loss'), ('death: [a', 'faults'),
    ('lost: 1', 'loss'), ('delay: 1e400', 'delay'), ('\0', 'faults'), ('1: 2', 'faults'),
])
def test_bad_files_are_named(tmp_path, content, field):
    path = tmp_path / 'faults.yaml'
    path.write_text(content)
    with pytest.raises(InvalidInput, match=field) as caught:
        parse_faults(str(path))
    assert str(path) in str(caught.value)


def test_missing_file_is_named():
    with pytest.raises(InvalidInput, match='nowhere'):
        parse_faults('nowhere.yaml')


@given(st.text(max_size=30) | st.text(alphabet='loss=0.3,delay=death@-:', max_size=30))
def test_any_text_is_read_or_refused(text):
    with contextlib.suppress(InvalidInput):
        parse_faults(text)


def test_unknown_voxel_is_named():
    with pytest.raises(InvalidInput, match="death: voxel: got 'voxel_1_0'"):
        make_controller('U-nD', 'snn', 'death=voxel_1_0')


# --- links and cells ----------------------------------------------------------------------------


def test_losses_fall_on_every_link_alike_and_on_none_as_on_another():
    faults = CellFaults(Faults(loss=0.3, seed=1), SHAPE)
    lost = np.concatenate([faults.lost(i, 0, 4000) for i in range(3)], axis=1)
    assert np.abs(lost.mean(axis=0) - 0.3).max() < 0.03
    assert np.abs(np.corrcoef(lost.T) - np.eye(12)).max() < 0.06
    np.testing.assert_array_equal(faults.lost(2, 1234, 5), lost[1234:1239, 8:])
    assert CellFaults(Faults(loss=1.0), SHAPE).lost(0, 0, 100).all()
    assert not CellFaults(Faults(), SHAPE).lost(0, 0, 100).any()


def readings_of(step):
    """Return (3, 4) readings of all voxels at a step."""
    return np.random.default_rng(step).random((SHAPE.n_voxels, 4))


def make_controller(name, model, text=''):
    architecture = Architecture.named(name, model)
    rng = np.random.default_rng(2)
    theta = rng.uniform(-2.0, 2.0, architecture.n_parameters(SHAPE.n_voxels))
    return Controller(architecture, SHAPE, theta, parse_faults(text))


def run(controller):
    """Return (N_STEPS, 3) actuation and what all cells sent."""
    for _ in range(2):  # the second time is not another
        controller.reset()
        actuation, sent = [], []
        for k in range(N_STEPS):
            actuation.append(controller.step(readings_of(k)))
            sent.append(controller.cells.outbox.copy())
    return np.array(actuation), np.array(sent)


def run_alone(name, model, text):
    """Do what `run` does with cells that are each alone, like nodes, and know their own faults."""
    faults, controller = parse_faults(text), make_controller(name, model)
    architecture, n = controller.architecture, SHAPE.n_voxels
    theta = np.random.default_rng(2).uniform(-2.0, 2.0, architecture.n_parameters(n))
    cells = [Cells(architecture, own_parameters(architecture, theta, n, i)[None]) for i in range(n)]
    own = [VoxelFaults(CellFaults(faults, SHAPE), i) for i in range(n)]
    actuation, sent = np.zeros((N_STEPS, n)), []
    for k in range(N_STEPS):
        for i in range(n):
            inbox = cells[i].empty_inbox()
            for d, j in enumerate(SHAPE.neighbors[i]):
                if j >= 0 and k > 0:
                    inbox[d] = sent[-1][j, OPPOSITE[d] if architecture.directional else 0]
            heard = own[i].hear(k, inbox)
            if own[i].dead(k):
                cells[i].reset()
            else:
                actuation[k, i] = cells[i].step_cell(0, readings_of(k)[i], heard, k)
        sent.append(np.concatenate([cell.outbox for cell in cells]))
    return actuation, np.array(sent)


def test_a_step_left_out_shifts_no_message():
    voxel = VoxelFaults(CellFaults(Faults(delay=2), SHAPE), 0)
    steps = [0, 1, 2, 4, 5, 6, 7]
    heard = [voxel.hear(k, np.full((4, 1), k + 0.5))[0, 0] for k in steps]
    assert heard == [0.0, 0.0, 0.5, 2.5, 0.0, 4.5, 5.5]


@pytest.mark.parametrize('text', [
    'loss=0.4,seed=3', 'delay=1', 'delay=7', 'death=0.7@0.4-0.8', 'death=1',
    'loss=0.2,delay=3,death=voxel_0_1@0.3-1,seed=9',
])
@pytest.mark.parametrize(('name', 'model'), [('U-nD', 'snn-h'), ('nU-D', 'mlp')])
def test_cells_together_are_cells_alone(name, model, text):
    together, alone = run(make_controller(name, model, text)), run_alone(name, model, text)
    np.testing.assert_array_equal(together[0], alone[0])
    np.testing.assert_array_equal(together[1], alone[1])
    assert not np.array_equal(together[1], run(make_controller(name, model))[1])


@pytest.mark.parametrize(('name', 'model'), [('U-nD', 'snn-h'), ('U-D', 'snn'), ('U-D', 'mlp')])
class TestMeaning:
    def test_total_loss_is_no_neighbour(self, name, model):
        actuation, _ = run(make_controller(name, model, 'loss=1'))
        lone = make_controller(name, model)
        lone.neighbors = np.full_like(lone.neighbors, -1)
        np.testing.assert_array_equal(actuation, run(lone)[0])

    def test_late_messages_are_silence_at_first(self, name, model):
        _, sent = run(make_controller(name, model, 'delay=4'))
        _, isolated = run(make_controller(name, model, 'loss=1'))
        _, prompt = run(make_controller(name, model))
        np.testing.assert_array_equal(sent[:5], isolated[:5])
        assert not np.array_equal(sent[5:], isolated[5:])
        assert not np.array_equal(sent[5:], prompt[5:])

    def test_dead_voxel_is_limp_and_silent_and_starts_afresh(self, name, model):
        text = 'death=voxel_0_0@0.5-1,loss=1'
        actuation, sent = run(make_controller(name, model, text))
        before, _ = run(make_controller(name, model, 'loss=1'))
        np.testing.assert_array_equal(actuation[:30], before[:30])
        assert not actuation[30:60, 0].any()
        assert not sent[30:60, 0].any()
        fresh = make_controller(name, model, 'loss=1')
        fresh.step_count = 60
        again = [fresh.step(readings_of(k))[0] for k in range(60, N_STEPS)]
        np.testing.assert_array_equal(actuation[60:, 0], again)
        np.testing.assert_array_equal(actuation[:, 1:], before[:, 1:])


def test_configured_but_harmless_is_harmless():
    prompt = run(make_controller('U-nD', 'snn-h'))
    for text in ('death=0@1', 'death=1@1000', 'loss=1e-300', 'seed=5'):
        for a, b in zip(run(make_controller('U-nD', 'snn-h', text)), prompt, strict=True):
            np.testing.assert_array_equal(a, b)
