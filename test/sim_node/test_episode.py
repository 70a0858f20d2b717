"""Names of episodes: eight characters, unique, and the physics that they encode."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_node import episode
from sim_node.model.physics import PHYSICS


@pytest.mark.parametrize('physics', PHYSICS)
def test_a_name_encodes_its_physics(physics):
    of_simulation = episode.EpisodeNames(physics, 'beef')
    names = {of_simulation.next().tobytes() for _ in range(1000)}
    assert len(names) == 1000
    for name in names:
        assert len(name) == len(episode.EXAMPLE_EPISODE) == 8
        assert name.isascii()
        assert episode.physics_of_episode(name) == physics
        assert episode.simulation_of_episode(name) == 'beef'
        frame = episode.frame_of('voxel_3_1', name)
        episode.check_frame('voxel_3_1', frame)
        assert episode.episode_of(frame) == name


def test_initials_of_physics_are_unique():
    initials = list(episode._INITIALS.values())
    assert set(episode._INITIALS) == set(PHYSICS)
    assert len(set(initials)) == len(initials)
    assert not set(''.join(initials)) & set('0123456789abcdef')
    assert max(map(len, initials)) <= 1


@pytest.mark.parametrize(('name', 'physics'), [
    (b'', 'first'), (b'5f0c17e2', 'first'), (b'r5f0c17e', 'reference'),
    (b'x5f0c17e', 'unknown'), (b'R5f0c17e', 'unknown'), (b'5F0C17E2', 'unknown'),
    (b'r5f0c17', 'unknown'), (b'r5f0c17e2', 'unknown'), (b'5f0c17e2\n', 'unknown'),
    (episode.EXAMPLE_EPISODE, 'unknown'),
])
def test_physics_of_old_and_invalid_names(name, physics):
    assert episode.physics_of_episode(name) == physics


@given(st.binary(max_size=20), st.text(max_size=30))
def test_any_name_and_frame_are_read(name, frame):
    assert episode.physics_of_episode(name) in (*PHYSICS, episode.UNKNOWN_PHYSICS)
    assert len(episode.simulation_of_episode(name)) in (0, 4)
    assert isinstance(episode.episode_of(frame), bytes)


@pytest.mark.parametrize('name', [b'', b'x5f0c17e', episode.EXAMPLE_EPISODE])
def test_names_of_unknown_form_belong_to_no_simulation(name):
    assert episode.simulation_of_episode(name) == ''


def test_identities_of_simulations_differ():
    assert len({episode.new_identity() for _ in range(20)}) > 10


def test_a_frame_of_old_bags_has_no_episode():
    assert episode.episode_of('voxel_0_0') == b''
