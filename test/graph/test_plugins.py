"""Cells of a plugin over ROS: each process imports the modules that SNCA_PLUGINS names."""

import pytest
from support.limits import LIMIT
from support.paths import ROOT
from support.plugin_neurons import Integrator, Pacemaker

from sim_node.registry import PLUGINS
from snca_ros.cell.models import NEURON_MODELS

PLUGIN = 'support.plugin_neurons'
for _name in ('pacemaker', 'integrator'):
    NEURON_MODELS.pop(_name, None)  # the import above registers them


@pytest.fixture
def plugin(monkeypatch):
    """Let this process and its children know the neuron models, for this test."""
    monkeypatch.setenv(PLUGINS, PLUGIN)
    models = {'pacemaker': Pacemaker(), 'integrator': Integrator()}
    for name, model in models.items():
        NEURON_MODELS.setdefault(name, model)
    yield
    for name in models:
        del NEURON_MODELS[name]


@pytest.mark.parametrize('model', ['pacemaker', 'integrator'])
def test_walk_of_cells_from_outside_equals_its_twin(start, make_controller, plugin, model):
    path = make_controller('11-10', model=model)
    child = start('walk', path, '--duration', 1, '--bag', 'bag', path=[ROOT / 'test'])
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert '61 positions of the centre, bit for bit the same' in output
    assert 'Traceback' not in output


def test_without_the_plugin_the_error_lists_the_models(
    start, make_controller, plugin, monkeypatch
):
    path = make_controller('11-10', model='pacemaker')
    monkeypatch.delenv(PLUGINS)
    child = start('walk', path, '--duration', 1)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2, output
    assert "neuron_model: got 'pacemaker', expected one of mlp, snn, snn-h" in output
