"""Neuron models that live outside the project, as a user would write them (see docs/python.md)."""

from typing import Any, ClassVar, NamedTuple

import numpy as np

from sim_node.numerics.elementary_functions import tanh
from sim_node.numerics.jit import compiled_inline
from sim_node.numerics.lanes import select
from snca_ros.cell.models import NEURON_MODELS


class PacemakerConstants(NamedTuple):
    """Constants: threshold [mV], and the current [mV] that every neuron gets in each step."""

    threshold: float = 1.0
    drive: float = 0.02


class Pacemaker(PacemakerConstants):
    """A LIF neuron with an evolved leak that also fires without any input."""

    spiking = True
    state: ClassVar = {'v': 0.0}
    evolved: ClassVar = {'leak': 0.0}

    def neuron_constants(self, synapses: np.ndarray, evolved: np.ndarray) -> tuple[np.ndarray]:
        """Return the leak per SNN step, in [0, 0.02]."""
        return (np.clip(0.01 + 0.01 * evolved[0], 0.0, 0.02),)

    @staticmethod
    @compiled_inline
    def bias(model: Any, own: Any) -> Any:
        """Return the current that is always there [mV]."""
        return model.drive

    @staticmethod
    @compiled_inline
    def step(model: Any, state: Any, own: Any, current: Any) -> Any:
        """Return whether the neuron spikes, and its potential."""
        v = state[0] + current
        spikes = v >= model.threshold
        return spikes, (select(spikes, 0.0, v - own[0] * v),)


class IntegratorConstants(NamedTuple):
    """Constants: share of its value that a neuron forgets in a control step."""

    forgets: float = 0.25


class Integrator(IntegratorConstants):
    """A leaky integrator: y <- (1 - a) y + a (bias + input), and tanh(y) is sent."""

    spiking = False
    state: ClassVar = {'y': 0.0}
    evolved: ClassVar = {'bias': 0.0}

    def neuron_constants(self, synapses: np.ndarray, evolved: np.ndarray) -> tuple[np.ndarray]:
        """Return the biases."""
        return (evolved[0],)

    @staticmethod
    @compiled_inline
    def bias(model: Any, own: Any) -> Any:
        """Return what the sum of inputs starts from."""
        return own[0]

    @staticmethod
    @compiled_inline
    def step(model: Any, state: Any, own: Any, total: Any) -> Any:
        """Return the value that is sent, and y."""
        y = (1.0 - model.forgets) * state[0] + model.forgets * total
        return tanh(y), (y,)


NEURON_MODELS.register('pacemaker', Pacemaker())
NEURON_MODELS.register('integrator', Integrator())
