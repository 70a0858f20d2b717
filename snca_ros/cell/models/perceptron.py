"""Neurons of a multi-layer perceptron with tanh everywhere, on the inputs too (2D-VSR-Sim)."""

from typing import ClassVar, NamedTuple

import numpy as np

from sim_node.numerics.elementary_functions import tanh
from sim_node.numerics.jit import compiled_inline


class NoConstants(NamedTuple):
    """Nothing: all numbers of a perceptron evolve."""


class Perceptron(NoConstants):
    """A neuron without state: y = tanh(bias + sum of weight times input)."""

    spiking = False
    state: ClassVar[dict[str, float]] = {}
    evolved: ClassVar = {'bias': 0.0}

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return the biases."""
        return (evolved[0],)

    @staticmethod
    @compiled_inline
    def bias(model, own):
        """Return what the sum of a neuron's inputs starts from."""
        return own[0]

    @staticmethod
    @compiled_inline
    def step(model, state, own, total):
        """Return the value of the neuron; it has no state."""
        return tanh(total), state

    def as_printed(self) -> 'Perceptron':
        """Return the same: the paper's perceptron is that of the authors' code."""
        return self


MLP = Perceptron()
