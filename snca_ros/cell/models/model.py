"""What a neuron model is: constants, a state, evolved parameters, and one step of a neuron."""

from typing import Any, Protocol

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.numerics.dispatch import method
from sim_node.numerics.jit import compiled_inline


class NeuronModel(Protocol):
    """A named tuple of constants with the attributes and methods below.

    `step` and `bias` are static and `compiled_inline`: they act on numbers or, many neurons side by
    side, on lanes (`sim_node.numerics.lanes`). So they use + - * / and comparisons, `min`, `max`,
    `select(condition, a, b)` in place of `if`, and the functions of
    `sim_node.numerics.elementary_functions`. The class name must be unique among all models.

    Attributes:
        spiking: neurons send spikes, and a step is an SNN step (1/960 s); else they send values,
            and a step is a control step (1/60 s).
        state: the variables of a neuron with their values at reset, by name.
        evolved: the evolved parameters of a neuron, by name, with the values that input neurons
            have in their place. They stand before the layer's weights in the parameters of a cell.
    """

    spiking: bool
    state: dict[str, float]
    evolved: dict[str, float]

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return what `step` gets as `own`: for each constant an array (n,) of a layer's neurons.

        Args:
            synapses: (n_presynaptic, n) incoming weights; those of input neurons are 1.
            evolved: (len(self.evolved), n).
        """

    @staticmethod
    def step(model: Any, state: Any, own: Any, total: Any) -> Any:
        """Advance a neuron by one step.

        Args:
            model: the constants.
            state: a tuple of the variables.
            own: a tuple of the neuron's own constants.
            total: sum of the weights of all synapses that carry a spike, or of weight times value.

        Returns:
            Whether it spikes, or its value in [-1, 1]; and the new state, a tuple.
        """

    # Optional:
    #   bias(model, own): what the sum of a neuron's inputs starts from; 0 if there is none.
    #   rounded(model, x): a result in the arithmetic of the model; `x`, a double, if there is none.
    #   quantised(self, synapses): the weights in this arithmetic, from (n_presynaptic, n) doubles.
    #   spike_period(model, reading), actuation(model, n_spikes, age): in place of the rate coding
    #     in `snca_ros.cell.coding`.
    #   rests = True: without input, a neuron as it is at reset stays so, and is silent.
    #   thresholds(self, state, own): (..., n) thresholds [mV] to record, from tuples of arrays.
    #   as_printed(self): the model as the paper prints it, where the authors' code differs.


step = method('step', NeuronModel.step.__doc__ or '')


@compiled_inline
def _no_bias(model, own):
    return 0.0


bias = method(
    'bias', "Return what the sum of a neuron's inputs starts from, a number or lanes.", _no_bias
)


@compiled_inline
def _as_double(model, x):
    return x


rounded = method(
    'rounded', "Return a double, or lanes of them, rounded to the model's arithmetic.", _as_double
)


def quantised(model: NeuronModel, synapses: np.ndarray) -> np.ndarray:
    """Return weights, (n_presynaptic, n), as the model's arithmetic represents them."""
    return model.quantised(synapses) if hasattr(model, 'quantised') else synapses


def printed_variant(model: NeuronModel) -> NeuronModel:
    """Return a model as the paper prints it.

    Raises:
        InvalidInput: the paper does not print it.
    """
    variant = getattr(model, 'as_printed', None)
    if variant is None:
        expected = f'false: the paper has no equations of {type(model).__name__}'
        raise InvalidInput('as_printed', True, expected)
    return variant()
