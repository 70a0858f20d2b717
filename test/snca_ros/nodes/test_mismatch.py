"""A voxel says, once an episode, that its controller was evolved in another physics."""

import pytest

from sim_node.episode import new_episode
from sim_node.model.physics import PHYSICS
from snca_ros.nodes.mismatch import Mismatch


def episode(physics):
    return new_episode(physics).tobytes()


@pytest.mark.parametrize('physics', PHYSICS)
def test_the_same_physics_is_not_worth_a_word(physics):
    said = []
    mismatch = Mismatch('a.npz', physics, said.append)
    for name in (episode(physics), episode(physics)):
        mismatch.note(name)
    assert (said, mismatch.words) == ([], '')


def test_each_episode_of_another_physics_is_warned_of_once():
    said = []
    mismatch = Mismatch('/runs/a.npz', 'first', said.append)
    for name in (episode('reference'), episode('first'), episode('reference'), b'x1234567'):
        for _ in range(3):
            mismatch.note(name)
        assert bool(mismatch.words) == (name[:1] in (b'r', b'x'))
    assert len(said) == 3
    for text in ('/runs/a.npz', "physics 'first'", "has 'reference'", 'sim_node',
                 '-p controller:=/runs/a.npz', '-p solver.physics:=first'):
        assert text in said[0]
    assert "has 'unknown'" in said[2]
    assert mismatch.words == 'evolved in the physics first, simulated in unknown'
