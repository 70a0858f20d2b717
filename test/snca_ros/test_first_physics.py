"""Controllers of the first physics walk as they always did, to the bit, in both engines.

The digests were made before there was a second physics. They hold on one kind of machine and C
library; elsewhere Munk2D's sines may round otherwise, and the walks must still be as fast.
"""

import hashlib
import json

import pytest
from support.paths import FIXTURES

from sim_node.simulation import Simulation
from snca_ros.controller_file import load_controller
from snca_ros.evolution.episode import run_episode

FIRST_PHYSICS = FIXTURES / 'first-physics'
DIGESTS = json.loads((FIRST_PHYSICS / 'digests.json').read_text())


def walk(name, engine, terrain):
    """Return the SHA-256 digest of the first 4 s of a walk: centres of mass and last readings."""
    trained = load_controller(FIRST_PHYSICS / f'{name}.npz')
    assert trained.solver.physics == 'first'
    simulation = Simulation(
        trained.morphology, terrain, material=trained.material, solver=trained.solver, engine=engine
    )
    episode = run_episode(simulation, trained.controller(), 4.0)
    digest = hashlib.sha256(episode.centers.tobytes())
    digest.update(simulation.readings.tobytes())
    return digest.hexdigest()[:16]


@pytest.mark.parametrize('key', DIGESTS)
def test_walks_are_the_same_bits(key):
    assert walk(*key.split()) == DIGESTS[key]
