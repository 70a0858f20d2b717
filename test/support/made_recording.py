"""A recording of random numbers, of any size."""

import math
from pathlib import Path

import numpy as np

from snca_ros.recording.bag import Recording
from snca_ros.recording.poses import Poses


def made_recording(n_steps=120, n_voxels=3, seed=0, **changes):
    """Return a walk of random numbers at 3 m/s."""
    rng = np.random.default_rng(seed)
    centers = np.column_stack([np.arange(n_steps) / 20.0, rng.normal(8.0, 0.1, n_steps)])
    steps = np.arange(0, n_steps, 2)
    corners = centers[steps, None, None] + rng.normal(size=(len(steps), n_voxels, 4, 2))
    readings = rng.uniform(size=(n_steps, n_voxels, 4))
    actuation = rng.uniform(-1, 1, size=(n_steps, n_voxels))
    return Recording(**{
        'path': Path('bag'), 'closed': True, 'robot': 'robot', 'episode': 0, 'n_episodes': 1,
        'voxel_names': tuple(f'voxel_{i}_0' for i in range(n_voxels)), 'centers': centers,
        'readings': readings,
        'actuation': actuation, 'applied': actuation,
        'outcomes': np.zeros((n_steps, n_voxels), dtype=np.uint8),
        'late': np.zeros((n_steps, n_voxels), dtype=bool),
        'spikes': rng.integers(0, 2, size=(n_steps, n_voxels, 4, 16), dtype=np.uint8),
        'values': None, 'heard': np.ones((n_steps, n_voxels), dtype=bool), 'rate': math.nan,
        'counts': (), 'health': {},
        'poses': Poses(steps, corners, np.array([[-9.0, 5.0], [2000.0, 5.0]])),
        **changes,
    })
