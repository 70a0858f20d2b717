"""Neuron models, one file each, found by name.

To add one, write a class like those here (`model.NeuronModel` says what it needs) and call
`NEURON_MODELS.register` with one of its instances, see `sim_node.registry` and docs/python.md.
"""

from snca_ros.cell.models.model import NeuronModel, printed_variant
from snca_ros.cell.models.registration import NeuronModelRegistry

__all__ = ['DEFAULT_NEURON_MODEL', 'NEURON_MODELS', 'NeuronModel', 'printed_variant']

DEFAULT_NEURON_MODEL = 'snn-h'
"""The model of the paper's SNCA: spiking, with homeostasis."""

NEURON_MODELS = NeuronModelRegistry('neuron_model', {
    'mlp': 'snca_ros.cell.models.perceptron:MLP',
    'snn': 'snca_ros.cell.models.lif:SNN',
    DEFAULT_NEURON_MODEL: 'snca_ros.cell.models.lif:SNN_H',
})
"""Neuron models by name: perceptron, LIF neurons, LIF neurons with homeostasis."""
