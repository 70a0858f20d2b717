"""Leaky integrate-and-fire neurons, with or without homeostasis (paper, Eq. 1 to 3)."""

from typing import Any, ClassVar, NamedTuple

import numpy as np

from sim_node.numerics.jit import compiled_inline
from sim_node.numerics.lanes import negation, select
from snca_ros.cell.coding import SNN_RATE
from snca_ros.cell.models.model import rounded

LEAK = 0.01
"""lambda_v and lambda_psi [1/ms] (authors' code)."""

PSI_INC = 0.2
"""Rise of the homeostatic offset per spike [mV] (paper, section 4)."""


class LifConstants(NamedTuple):
    """Constants of a LIF neuron.

    Attributes:
        leak: lambda times the SNN step, for potential and offset alike.
        psi_inc: rise of the offset psi per spike [mV]; 0 without homeostasis.
        theta_0: threshold at rest [mV].
        v_rest: potential after a spike [mV].
        homeostasis: the threshold is bounded by the weights and rises with every spike.
    """

    leak: float = LEAK * 1000.0 / SNN_RATE
    psi_inc: float = PSI_INC
    theta_0: float = 1.0
    v_rest: float = 0.0
    homeostasis: bool = True


class LifNeuron:
    """What all LIF neurons have: variables v, which has leaked for the next step, and psi [mV]."""

    homeostasis: bool
    spiking = True
    state: ClassVar = {'v': 0.0, 'psi': 0.0}
    evolved: ClassVar[dict[str, float]] = {}
    rests = True

    def bounds(self, synapses: np.ndarray) -> np.ndarray:
        """Return the bound of each neuron's threshold at rest [mV], (n,).

        With homeostasis it is the sum of the neuron's weights, in presynaptic order.
        """
        if not self.homeostasis:
            return np.full(synapses.shape[1], np.inf)
        return np.add.accumulate(synapses, axis=0)[-1]


@compiled_inline
def _after_step(model, silent, v, psi):
    """Return potential and offset [mV] after a step in which a neuron was silent or spiked.

    Silent: psi <- psi - lambda dt psi; a spike: v <- v_rest, psi <- psi + psi_inc (paper, Eq. 3).
    Then v leaks for the next step: v <- v - lambda dt v (paper, Eq. 1). From v_rest = 0 nothing
    leaks, so that leak and decay are one masked instruction each.
    """
    psi = rounded(model, psi + select(silent, rounded(model, -model.leak * psi), model.psi_inc))
    v = rounded(model, v - rounded(model, model.leak * v))
    return select(silent, v, model.v_rest), psi


class Lif(LifNeuron, LifConstants):
    """A LIF neuron with the threshold min(theta_0, bound) + psi (authors' code)."""

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return the thresholds at rest, min(theta_0, bound) [mV]."""
        return (np.minimum(self.theta_0, self.bounds(synapses)),)

    @staticmethod
    @compiled_inline
    def step(model, state, own, current):
        """Return whether the neuron spikes, and its new potential and offset [mV].

        v <- v + current (paper, Eq. 1); a spike at v >= min(theta_0, bound) + psi (Eq. 2).
        """
        v, psi = state
        v = rounded(model, v + current)
        silent = v < rounded(model, own[0] + psi)
        return negation(silent), _after_step(model, silent, v, psi)

    def thresholds(self, state: tuple[Any, ...], own: tuple[Any, ...]) -> np.ndarray:
        """Return the thresholds [mV]."""
        return own[0] + state[1]

    def as_printed(self) -> 'LifAsPrinted':
        """Return the model as the paper prints it: leaks per second, a threshold that compounds."""
        return LifAsPrinted(
            LEAK / SNN_RATE, self.psi_inc, self.theta_0, self.v_rest, self.homeostasis
        )


class LifAsPrinted(LifNeuron, LifConstants):
    """A LIF neuron by the letter of the paper, which the authors' code does not follow.

    Its threshold theta [mV], a third variable, compounds, and it spikes at v > theta.
    """

    state: ClassVar = {'v': 0.0, 'psi': 0.0, 'theta': 1.0}

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return the bounds of the thresholds [mV]."""
        return (self.bounds(synapses),)

    @staticmethod
    @compiled_inline
    def step(model, state, own, current):
        """Return whether the neuron spikes, and its new potential, offset and threshold [mV].

        v <- v + current (paper, Eq. 1); theta <- min(theta, bound) + psi (Eq. 2); a spike at
        v > theta.
        """
        v, psi, theta = state
        v = rounded(model, v + current)
        theta = rounded(model, min(theta, own[0]) + psi)
        silent = v <= theta
        v, psi = _after_step(model, silent, v, psi)
        return negation(silent), (v, psi, theta)

    def thresholds(self, state: tuple[Any, ...], own: tuple[Any, ...]) -> np.ndarray:
        """Return the thresholds [mV]."""
        return state[2]


SNN = Lif(psi_inc=0.0, homeostasis=False)
SNN_H = Lif()
