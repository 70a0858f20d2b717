"""The warning, once per episode, that a controller was evolved in another physics."""

import pytest

from sim_node.episode import EpisodeNames, new_identity
from sim_node.model.physics import PHYSICS
from snca_ros.nodes.mismatch import PhysicsMismatch


def episode(physics):
    return EpisodeNames(physics, new_identity()).next().tobytes()


@pytest.mark.parametrize('physics', PHYSICS)
def test_the_same_physics_gives_no_warning(physics):
    warnings = []
    mismatch = PhysicsMismatch('a.npz', physics, warnings.append)
    for name in (episode(physics), episode(physics)):
        mismatch.check(name)
    assert (warnings, mismatch.text) == ([], '')


def test_each_episode_with_another_physics_gives_one_warning():
    warnings = []
    mismatch = PhysicsMismatch('/runs/a.npz', 'first', warnings.append)
    for name in (episode('reference'), episode('first'), episode('reference'), b'x1234567'):
        for _ in range(3):
            mismatch.check(name)
        assert bool(mismatch.text) == (name[:1] in (b'r', b'x'))
    assert len(warnings) == 3
    for text in ('/runs/a.npz', "physics 'first'", "has 'reference'", 'sim_node',
                 '-p controller:=/runs/a.npz', '-p solver.physics:=first'):
        assert text in warnings[0]
    assert "has 'unknown'" in warnings[2]
    assert mismatch.text == 'evolved in the physics first, simulated in unknown'
