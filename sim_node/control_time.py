"""Exact conversion between control steps, durations in seconds and ROS time stamps."""

from fractions import Fraction

from sim_node.errors import InvalidInput

CONTROL_RATE = 60
"""Control steps per second (paper: f_k = 60 Hz)."""

START_STEPS = 2
"""First steps in lock-step even in real time, while nodes start and discover each other."""

MARKER_PERIOD = 2
"""Control steps between two messages of the robot's outline, and two frames of pages and films."""


def steps_in(seconds: float) -> int:
    """Return the number of control steps in a duration, or the step of a time since the start.

    Everything that converts seconds to steps does it here, so that a walk, its offline twin, its
    faults and its page agree. The decimal number is meant as it is written: 4.15 s are 249 steps,
    although 4.15 * 60 is a little more in floating point.

    Args:
        seconds: a finite duration or time [s].

    Returns:
        The nearest number of steps of 1/60 s; of two that are equally near, the even one.
    """
    return round(Fraction(str(seconds)) * CONTROL_RATE)


def stamp_of_step(step: int) -> tuple[int, int]:
    """Return (sec, nanosec) of a control step: step / 60 s, rounded down to a nanosecond."""
    sec, rest = divmod(step, CONTROL_RATE)
    return sec, rest * 10**9 // CONTROL_RATE


def step_of_stamp(sec: int, nanosec: int) -> int:
    """Return the control step of a stamp; raise InvalidInput if it is not the time of a step."""
    step = sec * CONTROL_RATE + (nanosec * CONTROL_RATE + 10**9 - 1) // 10**9
    if sec < 0 or stamp_of_step(step) != (sec, nanosec):
        raise InvalidInput('stamp', (sec, nanosec), f'a multiple of 1/{CONTROL_RATE} s')
    return step
