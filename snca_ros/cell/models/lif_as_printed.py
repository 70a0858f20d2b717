"""LIF neurons by the letter of the paper, which the authors' code does not follow."""

from typing import Any, ClassVar, NamedTuple

import numpy as np

from sim_node.numerics.jit import compiled_inline
from sim_node.numerics.lanes import negation, select


class PrintedConstants(NamedTuple):
    """Constants of a LIF neuron, as of `lif.LifConstants`."""

    leak: float
    psi_inc: float
    theta_0: float
    v_rest: float
    homeostasis: bool


class LifAsPrinted(PrintedConstants):
    """A LIF neuron whose threshold theta compounds and which spikes at v > theta.

    Its variables are v, psi and theta [mV] (paper, Eq. 1 to 3).
    """

    spiking = True
    state: ClassVar = {'v': 0.0, 'psi': 0.0, 'theta': 1.0}
    evolved: ClassVar[dict[str, float]] = {}
    rests = True

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return the bound of the threshold [mV]: the sum of the weights with homeostasis."""
        if not self.homeostasis:
            return (np.full(synapses.shape[1], np.inf),)
        return (np.add.accumulate(synapses, axis=0)[-1],)

    @staticmethod
    @compiled_inline
    def step(model, state, own, current):
        """Return whether the neuron spikes, and its new potential, offset and threshold [mV].

        theta <- min(theta, bound) + psi; v > theta: a spike. All else is as in `Lif`.
        """
        v, psi, theta = state
        v = v + current
        theta = min(theta, own[0]) + psi
        silent = v <= theta
        psi = psi + select(silent, -model.leak * psi, model.psi_inc)
        v = select(silent, v - model.leak * v, model.v_rest)
        return negation(silent), (v, psi, theta)

    def thresholds(self, state: tuple[Any, ...], own: tuple[Any, ...]) -> np.ndarray:
        """Return the thresholds [mV]."""
        return state[2]
