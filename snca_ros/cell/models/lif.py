"""Leaky integrate-and-fire neurons, with or without homeostasis (paper, Eq. 1 to 3)."""

from typing import Any, ClassVar, NamedTuple

import numpy as np

from sim_node.numerics.jit import compiled_inline
from sim_node.numerics.lanes import negation, select
from snca_ros.cell.coding import SNN_RATE
from snca_ros.cell.models.lif_as_printed import LifAsPrinted

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


class Lif(LifConstants):
    """A LIF neuron; its threshold is theta_0, with homeostasis min(theta_0, sum of weights) + psi.

    Its variables are the potential v, which has leaked for the next step, and psi [mV].
    """

    spiking = True
    state: ClassVar = {'v': 0.0, 'psi': 0.0}
    evolved: ClassVar[dict[str, float]] = {}
    rests = True

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return min(theta_0, sum of the weights) [mV], summed in presynaptic order."""
        if not self.homeostasis:
            return (np.full(synapses.shape[1], self.theta_0),)
        return (np.minimum(self.theta_0, np.add.accumulate(synapses, axis=0)[-1]),)

    @staticmethod
    @compiled_inline
    def step(model, state, own, current):
        """Return whether the neuron spikes, and its new potential and offset [mV].

        v <- v + current; v >= rest + psi: a spike, v <- v_rest, psi <- psi + psi_inc; else
        psi <- psi - lambda dt psi. Then v leaks, for the next step: v <- v - lambda dt v.
        """
        v, psi = state
        v = v + current
        silent = v < own[0] + psi  # asked so, leak and decay are one masked instruction each
        psi = psi + select(silent, -model.leak * psi, model.psi_inc)
        v = select(silent, v - model.leak * v, model.v_rest)  # from v_rest = 0 nothing leaks
        return negation(silent), (v, psi)

    def thresholds(self, state: tuple[Any, ...], own: tuple[Any, ...]) -> np.ndarray:
        """Return the thresholds [mV]."""
        return own[0] + state[1]

    def as_printed(self) -> LifAsPrinted:
        """Return the model as the paper prints it: leaks per second, a threshold that compounds."""
        return LifAsPrinted(
            LEAK / SNN_RATE, self.psi_inc, self.theta_0, self.v_rest, self.homeostasis
        )


SNN = Lif(psi_inc=0.0, homeostasis=False)
SNN_H = Lif()
