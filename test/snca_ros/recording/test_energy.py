"""Operations of cells in a walk, and their energy."""

import json

import numpy as np
import pytest
from support.firmware import untrained, walked_inputs
from support.synthetic_bag import Walk, messages_of_walk, write_messages

from snca_ros.cell.cells import Cells
from snca_ros.cli import main
from snca_ros.controller import own_parameters
from snca_ros.controller_file import save_controller
from snca_ros.recording.energy import Operations, count_operations, energy_lines, per_metre
from snca_ros.recording.offline import record_offline

N_STEPS = 60


def spikes_in_cell(trained, voxel):
    """Return the numbers of spikes of a cell's hidden and output neurons in a walk."""
    cell = trained.architecture
    weights = own_parameters(cell, trained.parameters, trained.morphology.n_voxels, voxel)
    cells = Cells(cell, weights[None])
    hidden = output = 0
    for k, readings, inbox in zip(*walked_inputs(trained, N_STEPS, voxel), strict=True):
        cells.step_cell(0, readings, inbox, k)
        network = cells.state.network
        hidden += sum(word.bit_count() for word in network.presynaptic.ravel().tolist())
        output += sum(word.bit_count() for word in network.fired.ravel().tolist())
    return hidden, output


@pytest.mark.parametrize('name', ['U-nD', 'nU-D'])
@pytest.mark.parametrize('model', ['snn', 'snn-h'])
def test_counted_spikes_are_those_inside_of_the_cells(name, model, tmp_path):
    trained = untrained(name, model, hidden=(7,), scale=1.0)
    recording, _ = record_offline(trained, tmp_path, N_STEPS / 60)
    operations = count_operations(trained, recording.readings, recording.spikes)
    counts = np.array([spikes_in_cell(trained, voxel) for voxel in range(2)])
    hidden, output = counts.sum(axis=0) / (2 * N_STEPS)
    inputs = operations.spikes - hidden - output
    n_outputs = trained.architecture.n_outputs
    assert hidden > 0
    assert inputs > 0
    assert operations.additions == pytest.approx(7 * inputs + n_outputs * hidden)
    assert operations.n_synapses == 7 * (trained.architecture.n_inputs + n_outputs)
    assert operations.updates == 16 * sum(trained.architecture.layer_sizes)


def test_perceptrons_and_unknown_models(tmp_path):
    trained = untrained('U-D', 'mlp')
    assert count_operations(trained, np.zeros((3, 2, 4)), None) == Operations(False, 21, 104)
    printed = untrained('U-D', 'snn-h', as_printed=True)
    assert count_operations(printed, np.zeros((3, 2, 4)), np.zeros((3, 2, 4, 16))) is None
    unread = np.full((3, 2, 4), np.nan)
    assert count_operations(untrained('U-D', 'snn-h'), unread, np.zeros((3, 2, 4, 16))) is None


def test_energy_is_by_the_published_figures():
    spiking = Operations(True, n_neurons=45, n_synapses=500, spikes=50.0, additions=300.0)
    perceptron = Operations(False, n_neurons=21, n_synapses=104)
    assert spiking.synapse_energy() == pytest.approx(270.0)  # pJ
    assert spiking.synapse_energy(integer=True) == pytest.approx(30.0)
    assert spiking.neuron_energy() == pytest.approx(720 * 11.9)
    assert spiking.neuron_energy(integer=True) == pytest.approx(720 * 1.4)
    assert perceptron.synapse_energy() == pytest.approx(104 * 4.6)
    assert per_metre(270.0, 10, 9.0) == pytest.approx(18.0)  # nJ
    text = '\n'.join(energy_lines(spiking, 10, 9.0))
    assert '300 additions of a weight (3.8% of 8000), 50 spikes, 720 updates of neurons' in text
    assert '18 nJ of synapses' in text
    assert len(energy_lines(spiking, 10, -1.0)) == 2  # no energy per metre of a walk backwards


def test_report_of_a_bag(tmp_path, capsys):
    trained = untrained('U-nD', 'snn-h', scale=1.0)
    recording, _ = record_offline(trained, tmp_path, N_STEPS / 60)
    walk = Walk(
        recording.voxel_names, recording.centers, recording.readings[:N_STEPS],
        recording.actuation[:N_STEPS], recording.spikes[:N_STEPS],
    )
    bag = str(write_messages(tmp_path / 'bag', messages_of_walk(walk)))
    save_controller(tmp_path / 'one.npz', trained)
    numbers = tmp_path / 'report.json'
    command = ['report', bag, '--json', str(numbers), '--controller', str(tmp_path / 'one.npz')]
    assert main(command) == 0
    assert 'a cell, per control step: ' in capsys.readouterr().out
    operations = count_operations(trained, recording.readings, recording.spikes)
    assert json.loads(numbers.read_text())['operations']['additions'] == operations.additions
    save_controller(tmp_path / 'other.npz', untrained('U-nD', 'snn-h', '111'))
    command[-1] = str(tmp_path / 'other.npz')
    assert main(command) == 2
    assert 'expected the 2 of the bag' in capsys.readouterr().err
