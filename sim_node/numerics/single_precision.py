"""Single precision (IEEE binary32) in compiled code, for numbers and for lanes of doubles.

A sum, difference, product or quotient of two numbers of single precision, computed as a double and
rounded by `single`, is the one that the hardware's instruction for single precision returns: a
double has more than twice as many bits (Figueroa, "When is double rounding innocuous?", 1995).
"""

from llvmlite import ir
from numba.core import types

from sim_node.numerics import elementary_functions
from sim_node.numerics.jit import compiled_inline
from sim_node.numerics.lanes import Lanes, intrinsic, scale_of, select

LOG2_E = 1.44269502162933349609375  # the nearest number of single precision
LN2_HIGH, LN2_LOW = 0.693359375, -2.12194441468454897403717041015625e-4  # 15 low bits clear
ROUND = 12582912.0  # 1.5 * 2^23: adding it rounds to an integer


@intrinsic
def single(typing, x):
    """Return a number, or lanes, rounded to single precision, as a double."""
    kind = x if isinstance(x, Lanes) else types.float64

    def generate(context, builder, signature, args):
        double = args[0].type
        narrow = ir.FloatType()
        if isinstance(double, ir.VectorType):
            narrow = ir.VectorType(narrow, double.count)
        return builder.fpext(builder.fptrunc(args[0], narrow), double)

    return kind(kind), generate


@compiled_inline
def _term(series, r, coefficient):
    return single(single(series * r) + coefficient)


@compiled_inline
def tanh(x):
    """Return the hyperbolic tangent of any x of single precision, error below 2e-7.

    It is `elementary_functions.tanh` in single precision, with a shorter series.
    """
    magnitude = abs(x)
    magnitude = select(magnitude > 10.0, 10.0, magnitude)  # tanh(10) rounds to 1; keeps a NaN
    y = 2.0 * magnitude
    k = single(single(single(y * LOG2_E) + ROUND) - ROUND)
    r = single(single(y - single(k * LN2_HIGH)) - single(k * LN2_LOW))
    series = _term(single(1.0 / 5040.0), r, single(1.0 / 720.0))
    series = _term(series, r, single(1.0 / 120.0))
    series = _term(series, r, single(1.0 / 24.0))
    series = _term(series, r, single(1.0 / 6.0))
    series = _term(series, r, 0.5)
    power = scale_of(k + elementary_functions.ROUND)  # 2^k
    part = single(single(single(series * r) * r) + r)
    e = single(single(power * part) + single(power - 1.0))
    value = single(e / single(e + 2.0))
    return select(x < 0.0, -value, value)
