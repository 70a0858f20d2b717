"""Elementary functions with the same result on every machine, for numbers and for lanes.

The functions of C libraries differ in the last bit between versions, and a gait is chaotic: one
bit changes the whole episode. These functions use only IEEE additions, multiplications and
divisions, without branches, so that loops over them vectorise.
"""

from sim_node.numerics.jit import compiled_inline
from sim_node.numerics.lanes import scale_of, select

LOG2_E = 1.4426950408889634
LN2_HIGH, LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # their sum; 20 low bits clear
ROUND = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to an integer in the low bits
_TWO_OVER_PI = 0.6366197723675814
_HALF_PI_HIGH, _HALF_PI_LOW = 1.57079632673412561417, 6.07710050650619224932e-11
_SINE = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
    2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)
_COSINE = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
    -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11,
)


@compiled_inline
def floor(x):
    """Return the greatest integer not above x, for |x| < 2^51."""
    nearest = (x + ROUND) - ROUND
    return select(nearest > x, nearest - 1.0, nearest)


@compiled_inline
def expm1(x):
    """Return exp(x) - 1 for x in [-700, 700], error below 2 units in the last place.

    x = k ln 2 + r with |r| <= ln 2 / 2: 2^k (exp(r) - 1) + (2^k - 1), Taylor's series in r.
    """
    shifted = x * LOG2_E + ROUND
    k = shifted - ROUND
    r = (x - k * LN2_HIGH) - k * LN2_LOW
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
    power = scale_of(shifted)  # 2^k: k is in the low bits of `shifted`
    return power * (series * r * r + r) + (power - 1.0)


@compiled_inline
def tanh(x):
    """Return the hyperbolic tangent of any x, error below 3 units in the last place."""
    magnitude = abs(x)
    magnitude = select(magnitude > 20.0, 20.0, magnitude)  # tanh(20) rounds to 1; keeps a NaN
    e = expm1(2.0 * magnitude)
    value = e / (e + 2.0)
    return select(x < 0.0, -value, value)


@compiled_inline
def sine_cosine(angle):
    """Return sine and cosine of an angle [rad], error below 2e-16 up to 10^6 turns.

    The polynomials on [-pi/4, pi/4] are fdlibm's (Sun Microsystems, 1993).
    """
    quarters = (angle * _TWO_OVER_PI + ROUND) - ROUND
    x = (angle - quarters * _HALF_PI_HIGH) - quarters * _HALF_PI_LOW
    z = x * x
    p = _SINE[1] + z * (_SINE[2] + z * (_SINE[3] + z * (_SINE[4] + z * _SINE[5])))
    sine = x + x * z * (_SINE[0] + z * p)
    p = _COSINE[2] + z * (_COSINE[3] + z * (_COSINE[4] + z * _COSINE[5]))
    p = _COSINE[0] + z * (_COSINE[1] + z * p)
    w = 1.0 - 0.5 * z
    cosine = w + (((1.0 - w) - 0.5 * z) + z * z * p)
    quarter = quarters - 4.0 * ((quarters * 0.25 + ROUND) - ROUND)  # -2, -1, 0, 1 or 2
    odd = abs(quarter) == 1.0
    s, c = select(odd, cosine, sine), select(odd, sine, cosine)
    s = select((quarter < 0.0) | (quarter == 2.0), -s, s)
    c = select((quarter == 1.0) | (abs(quarter) == 2.0), -c, c)
    return s, c
