"""Rate coding: sensor readings become spike trains, output spikes become actuation."""

from sim_node.compiled import compiled
from sim_node.stamps import CONTROL_RATE

SNN_STEPS = 16
"""SNN steps per control step (paper: f_h = 16 f_k)."""

SNN_RATE = CONTROL_RATE * SNN_STEPS
"""SNN steps per second (paper: f_h, about 1 kHz)."""

F_MIN, F_MAX = 5.0, 50.0
"""Firing rates [Hz] that code the readings 0 and 1 (paper, section 3.2)."""

ACTUATION_WINDOW = 5
"""Control steps over which output spikes are counted (paper: n_w)."""

NEVER = -1
"""Value of `last_spike` before the first spike."""


@compiled
def encode(reading, last_spike, first_step, trains, neuron):
    """Write the spike train of one reading and return the step of its newest spike.

    A spike falls on every step h for which h - h_last is a positive multiple of
    floor(f_h / f), f = r (f_max - f_min) + f_min (paper, Eq. 4); the first one at once.

    Args:
        reading: r in [0, 1].
        last_spike: SNN step h_last of the newest spike, or NEVER.
        first_step: SNN step of trains[0].
        trains: (16, n) spikes of a layer; column `neuron` is written with 0.0 and 1.0.
    """
    n_steps = trains.shape[0]
    period = int(SNN_RATE // (reading * (F_MAX - F_MIN) + F_MIN))
    due = first_step
    if last_spike != NEVER:
        elapsed = max(first_step - last_spike, 1)
        due = last_spike + (elapsed + period - 1) // period * period
    for i in range(n_steps):
        trains[i, neuron] = 0.0
    while due < first_step + n_steps:
        trains[due - first_step, neuron] = 1.0
        last_spike = due
        due += period
    return last_spike


@compiled
def decode(counts, age):
    """Return the actuation in [-1, 1] from the spikes of the last control steps.

    a = 2 n / (f_max T) - 1, clipped; n spikes in the window of duration T (paper, Eq. 5, with
    the unit mended as in the authors' code).

    Args:
        counts: (ACTUATION_WINDOW,) ring buffer of spikes per control step.
        age: control steps that the cell has made, this one included.
    """
    n_steps = min(age, counts.shape[0])
    n_spikes = 0
    for i in range(n_steps):
        n_spikes += counts[i]
    duration = n_steps / CONTROL_RATE
    a = 2.0 * (n_spikes / (F_MAX * duration)) - 1.0
    return min(max(a, -1.0), 1.0)
