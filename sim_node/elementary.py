"""Elementary functions whose result is the same on every machine, one number or many lanes.

The C library's differ in the last bit from version to version, and a gait is chaotic: one bit
makes another episode. These are made of IEEE additions, multiplications and divisions alone, with
no branch, so that loops over them vectorise.
"""

import numpy as np

from sim_node.compiled import compiled_inline

_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # their sum; 20 low bits clear
_ROUND = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to a whole number, in the low bits
_ONE_BITS = 0x3FF0000000000000


@compiled_inline
def expm1(x):
    """Return exp(x) - 1 for x in [-700, 700], error below 2 units in the last place.

    x = k ln 2 + r with |r| <= ln 2 / 2: 2^k (exp(r) - 1) + (2^k - 1), Taylor's series in r.
    """
    shifted = x * _LOG2_E + _ROUND
    k = shifted - _ROUND
    r = (x - k * _LN2_HIGH) - k * _LN2_LOW
    series = 1.0 / 6227020800.0
    series = series * r + 1.0 / 479001600.0
    series = series * r + 1.0 / 39916800.0
    series = series * r + 1.0 / 3628800.0
    series = series * r + 1.0 / 362880.0
    series = series * r + 1.0 / 40320.0
    series = series * r + 1.0 / 5040.0
    series = series * r + 1.0 / 720.0
    series = series * r + 1.0 / 120.0
    series = series * r + 1.0 / 24.0
    series = series * r + 1.0 / 6.0
    series = series * r + 0.5
    # 2^k: k is in the low bits of `shifted`, and the exponent in the high bits of `power`.
    power = np.int64((np.float64(shifted).view(np.int64) << 52) + _ONE_BITS).view(np.float64)
    return power * (series * r * r + r) + (power - 1.0)


@compiled_inline
def tanh(x):
    """Return the hyperbolic tangent of any x, error below 3 units in the last place."""
    magnitude = abs(x)
    magnitude = 20.0 if magnitude > 20.0 else magnitude  # tanh(20) rounds to 1; keeps a NaN
    e = expm1(2.0 * magnitude)
    value = e / (e + 2.0)
    return -value if x < 0.0 else value
