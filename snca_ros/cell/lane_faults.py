"""Lost messages, late messages and dead cells of W robots, one robot in each lane."""

from typing import NamedTuple

import numpy as np

from sim_node.numerics.jit import inlined_part
from sim_node.numerics.lane_tuples import load_each, select_each, store_each
from sim_node.numerics.lanes import load, mask_like, select, store
from snca_ros.cell.coding import ACTUATION_WINDOW, NEVER, SNN_STEPS, actuation_of


class LaneFaults(NamedTuple):
    """The faults of the cells of W robots at some control steps, one row per step.

    A mask is an integer; bit i is the robot in lane i. Slot s of a ring buffer has what all cells
    sent in the control step k with k mod n_slots = s; at first it is silent.
    """

    lost: np.ndarray  # (n_steps, n, 4) masks: messages from above, left, below, right
    dead: np.ndarray  # (n_steps, n) masks
    delays: np.ndarray  # (n_delays,) different delays [control steps], less than n_slots
    delayed: np.ndarray  # (n_delays,) masks of the robots that have each of them
    ring_of_trains: np.ndarray  # (n_slots, n, n_destinations * n_c, SNN_STEPS) masks
    ring_of_values: np.ndarray  # lanes (n_slots * n, n_destinations * n_c)
    born: np.ndarray  # (n, W) control step at which each cell began or, after death, began again


@inlined_part
def deliver_trains(received, step, faults):
    """Write the trains that arrive at a control step, (n, n_destinations * n_c, SNN_STEPS)."""
    ring = faults.ring_of_trains
    n_slots, n, n_channels, _ = ring.shape
    for d in range(faults.delays.shape[0]):
        slot, robots = (step - 1 - faults.delays[d]) % n_slots, faults.delayed[d]
        for i in range(n):
            for c in range(n_channels):
                for h in range(SNN_STEPS):
                    others = received[i, c, h] if d > 0 else 0
                    received[i, c, h] = others | (ring[slot, i, c, h] & robots)


@inlined_part
def deliver_values(received, step, faults):
    """Write the values that arrive at a control step, lanes (n, n_destinations * n_c)."""
    ring, n = faults.ring_of_values, faults.born.shape[0]
    n_slots = ring.shape[0] // n
    for d in range(faults.delays.shape[0]):
        slot, robots = (step - 1 - faults.delays[d]) % n_slots, faults.delayed[d]
        for i in range(n):
            for c in range(ring.shape[1]):
                value = load(ring, slot * n + i, c)
                others = load(received, i, c)
                store(received, i, c, select(mask_like(value, robots), value, others))


@inlined_part
def keep_trains(sent, step, faults):
    """Keep the trains that are sent in a control step, in place of the oldest."""
    ring = faults.ring_of_trains
    slot = step % ring.shape[0]
    for i in range(ring.shape[1]):
        for c in range(ring.shape[2]):
            for h in range(SNN_STEPS):
                ring[slot, i, c, h] = sent[i, c, h]


@inlined_part
def keep_values(sent, step, faults):
    """Keep the values that are sent in a control step, in place of the oldest."""
    ring, n = faults.ring_of_values, faults.born.shape[0]
    first = step % (ring.shape[0] // n) * n
    for i in range(n):
        for c in range(ring.shape[1]):
            store(ring, first + i, c, load(sent, i, c))


@inlined_part
def with_own_ages(model, n_spikes, actuation, i, step, faults):
    """Return the actuation of cell i, in which the cells that were dead are younger than others.

    Args:
        model: the neuron model.
        n_spikes: lanes, number of spikes in the window.
        actuation: lanes, the actuation if no cell was dead.
        i: the cell.
        step: the control step.
        faults: the faults.
    """
    for lane in range(faults.born.shape[1]):
        age = step + 1 - faults.born[i, lane]
        if age <= step:
            own = actuation_of(model, n_spikes, age)
            actuation = select(mask_like(n_spikes, 1 << lane), own, actuation)
    return actuation


@inlined_part
def kill(cells, i, step, actuation, faults, row):
    """Reset cell i of the robots in which it is dead; it sends nothing and its actuation is 0."""
    dead = faults.dead[row, i]
    if dead == 0:
        return
    network, mask = cells.network, mask_like(load(actuation, i, 0), dead)
    for j in range(network.items.sum()):
        state = load_each(network.state, i, j)
        store_each(network.state, i, j, select_each(mask, network.start, state))
    for sensor in range(cells.last_spike.shape[1]):
        store(cells.last_spike, i, sensor, select(mask, NEVER, load(cells.last_spike, i, sensor)))
    for k in range(ACTUATION_WINDOW):
        store(cells.counts, i, k, select(mask, 0.0, load(cells.counts, i, k)))
    for c in range(cells.sent_values.shape[1]):
        store(cells.sent_values, i, c, select(mask, 0.0, load(cells.sent_values, i, c)))
        for h in range(SNN_STEPS):
            cells.sent_trains[i, c, h] &= ~dead
    store(actuation, i, 0, select(mask, 0.0, load(actuation, i, 0)))
    for lane in range(faults.born.shape[1]):
        if dead >> lane & 1:
            faults.born[i, lane] = step + 1
