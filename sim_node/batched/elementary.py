"""Elementary functions of lanes by IEEE arithmetic alone: the same bits on every machine."""

import math

from sim_node.batched.lanes import select
from sim_node.compiled import compiled_inline

_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding and taking it away rounds to a whole number
_TWO_OVER_PI = 0.6366197723675814
_HALF_PI = (1.57079632673412561417, 6.07710050650619224932e-11)  # the first has 33 bits
_SIN = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
    2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)
_COS = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
    -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11,
)

_INVERSE_FACTORIALS = tuple(1.0 / math.factorial(k) for k in range(13))


@compiled_inline
def sine_cosine(angle):
    """Return sin and cos of `angle` [rad], error below 2e-16 up to 10^6 turns.

    The polynomials on [-pi/4, pi/4] are fdlibm's (Sun Microsystems, 1993).
    """
    turns = (angle * _TWO_OVER_PI + _ROUND) - _ROUND  # in quarters
    x = (angle - turns * _HALF_PI[0]) - turns * _HALF_PI[1]
    z = x * x
    p = _SIN[1] + z * (_SIN[2] + z * (_SIN[3] + z * (_SIN[4] + z * _SIN[5])))
    sine = x + x * z * (_SIN[0] + z * p)
    p = _COS[0] + z * (_COS[1] + z * (_COS[2] + z * (_COS[3] + z * (_COS[4] + z * _COS[5]))))
    w = 1.0 - 0.5 * z
    cosine = w + (((1.0 - w) - 0.5 * z) + z * z * p)
    quarter = turns - 4.0 * ((turns * 0.25 + _ROUND) - _ROUND)  # -2, -1, 0, 1 or 2
    odd = abs(quarter) == 1.0
    s, c = select(odd, cosine, sine), select(odd, sine, cosine)
    s = select((quarter < 0.0) | (quarter == 2.0), -s, s)
    c = select((quarter == 1.0) | (abs(quarter) == 2.0), -c, c)
    return s, c


@compiled_inline
def decay(x, halvings):
    """Return 1 - exp(-x) for 0 <= x <= 2**halvings / 4, relative error near 5e-16.

    Taylor's series of y = x / 2**halvings, then 1 - exp(-2 y) = t (2 - t) with t = 1 - exp(-y).
    """
    y = x
    for _ in range(halvings):
        y = y * 0.5
    f, z = _INVERSE_FACTORIALS, y * y
    odd = f[1] + z * (f[3] + z * (f[5] + z * (f[7] + z * (f[9] + z * f[11]))))
    even = f[2] + z * (f[4] + z * (f[6] + z * (f[8] + z * (f[10] + z * f[12]))))
    t = y * odd - z * even
    for _ in range(halvings):
        t = t * (2.0 - t)
    return t
