"""Rate coding: sensor readings become spike trains, output spikes become actuation.

A spike train of one control step is an integer: bit h is set if SNN step h has a spike.
"""

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.numerics.dispatch import method
from sim_node.numerics.elementary_functions import floor
from sim_node.numerics.jit import compiled_inline
from sim_node.numerics.lanes import select
from snca_ros.cell.models.model import rounded

SNN_STEPS = 16
"""SNN steps per control step (paper: f_h = 16 f_k)."""

SNN_RATE = CONTROL_RATE * SNN_STEPS
"""SNN steps per second (paper: f_h, about 1 kHz)."""

F_MIN, F_MAX = 5.0, 50.0
"""Firing rates [Hz] that code the readings 0 and 1 (paper, section 3.2)."""

ACTUATION_WINDOW = 5
"""Control steps over which output spikes are counted (paper: n_w)."""

NEVER = -1.0
"""Value of `last_spike` before the first spike."""


@compiled_inline
def _spike_period(model, reading):
    r = rounded(model, reading)
    f = rounded(model, rounded(model, r * (F_MAX - F_MIN)) + F_MIN)
    return floor(rounded(model, SNN_RATE / f))


spike_period = method('spike_period', """
    Return the number of SNN steps between the spikes of a reading r: floor(f_h / f).

    f = r (f_max - f_min) + f_min (paper, Eq. 4), in the arithmetic of the model, the first
    argument. The reading is a number or lanes.
    """, _spike_period)


@compiled_inline
def next_spike(period, last_spike, first_step):
    """Return the SNN step of the next spike, `first_step` or later.

    A spike occurs on each step h for which h - h_last is a positive multiple of the period; the
    very first spike occurs on `first_step`. Arguments are numbers or lanes, all of them integers,
    so the result is exact.
    """
    elapsed = max(first_step - last_spike, 1.0)
    due = last_spike + floor((elapsed + period - 1.0) / period) * period
    return select(last_spike == NEVER, first_step, due)


@compiled_inline
def encode(model, reading, last_spike, first_step):
    """Return the spike train of one reading and the SNN step of its newest spike.

    Args:
        model: the neuron model, whose arithmetic is used.
        reading: r in [0, 1].
        last_spike: SNN step h_last of the newest spike, or NEVER.
        first_step: the SNN step of the train's bit 0.
    """
    period = spike_period(model, reading)
    due = next_spike(period, last_spike, float(first_step))
    train = 0
    while due < first_step + SNN_STEPS:
        train |= 1 << int(due - first_step)
        last_spike = due
        due += period
    return train, last_spike


def pack_trains(spikes: np.ndarray) -> np.ndarray:
    """Return the trains, (...), of spikes, (..., SNN_STEPS) 0.0 or 1.0."""
    return spikes @ (1 << np.arange(SNN_STEPS))


def unpack_trains(trains: np.ndarray) -> np.ndarray:
    """Return the spikes, (..., SNN_STEPS) 0.0 or 1.0, of trains, (...)."""
    bits = np.asarray(trains)[..., np.newaxis].astype(np.int64) >> np.arange(SNN_STEPS)
    return (bits & 1).astype(np.float64)


@compiled_inline
def _actuation_of(model, n_spikes, age):
    duration = rounded(model, min(age, ACTUATION_WINDOW) / CONTROL_RATE)
    share = rounded(model, n_spikes / rounded(model, F_MAX * duration))
    a = rounded(model, 2.0 * share - 1.0)
    return min(max(a, -1.0), 1.0)


actuation_of = method('actuation', """
    Return the actuation in [-1, 1] for a number of spikes in the window; numbers or lanes.

    a = 2 n / (f_max T) - 1, clipped, for n spikes in the window of duration T (paper, Eq. 5, with
    the unit corrected as in the authors' code).

    Args:
        model: the neuron model, whose arithmetic is used.
        n_spikes: number of spikes in the last ACTUATION_WINDOW control steps, or since the reset.
        age: number of control steps since the reset, including this one.
    """, _actuation_of)


@compiled_inline
def decode(model, counts, cell, age):
    """Return the actuation in [-1, 1] from the spikes of the last control steps.

    Args:
        model: the neuron model, whose arithmetic is used.
        counts: (n, ACTUATION_WINDOW) ring buffers of spikes per control step; `cell` picks one.
        age: number of control steps since the reset, including this one.
    """
    n_spikes = 0
    for i in range(min(age, ACTUATION_WINDOW)):
        n_spikes += counts[cell, i]
    return actuation_of(model, float(n_spikes), age)
