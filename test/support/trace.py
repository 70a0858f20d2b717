"""A digest of a simulation; a process of its own makes it, too."""

import hashlib

import numpy as np

from sim_node.simulation import Simulation


def trace(shape='biped', terrain='hilly-1-10-0', steps=240, **options):
    """Return a digest of all readings and of the final state under a fixed actuation."""
    sim = Simulation(shape, terrain, **options)
    digest = hashlib.sha256(sim.reset().tobytes())
    phase = np.arange(sim.morphology.n_voxels)
    for k in range(steps):
        digest.update(sim.step(np.sin(0.2 * k - 0.7 * phase)).tobytes())
    digest.update(sim.world.masses.tobytes())
    return digest.hexdigest()
