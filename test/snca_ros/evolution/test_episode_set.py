"""Sets of episodes: fixed and drawn, their faults as text, and the score of a candidate."""

import contextlib
import math
import statistics
from collections import Counter
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from snca_ros.evolution.conditions import Conditions
from snca_ros.evolution.episode_set import FIRST_DRAWN_SEED, N_FURTHER, EpisodeSet
from snca_ros.evolution.fault_ranges import faults_at, text_of
from snca_ros.faults import NO_FAULTS, Faults, parse_faults

DRAWN = EpisodeSet(
    'biped,comb', 'flat,uphill-10', 'none;loss=0..0.5,delay=0..3;death=0.1..0.3@5..10', draw=200
)


def test_a_plain_set_is_one_episode_from_the_exact_start():
    for faults in ('', 'none'):
        plain = EpisodeSet('biped', 'flat', faults)
        assert plain.is_plain
        assert plain.conditions(3, 5) == [Conditions('biped', 'flat')]
        assert plain.described('v_x', 1) == ('v_x', '')
    for other in ({'faults': 'loss=0.3'}, {'starts': 1}, {'draw': 1}, {'shape': 'biped,comb'}):
        assert not EpisodeSet(**other).is_plain


def test_a_fixed_set_is_the_product_and_the_same_in_all_generations():
    episodes = EpisodeSet('biped,comb', 'flat,uphill-10', 'none;loss=0.3,seed=7', starts=3)
    found = episodes.conditions(seed=1, generation=0)
    lossy = [Faults(loss=0.3, seed=7 + start) for start in (1, 2, 3)]
    assert found == [
        Conditions(shape, terrain, start, faults[start - 1])
        for shape, terrain, faults, start in product(
            ('biped', 'comb'), ('flat', 'uphill-10'), ([NO_FAULTS] * 3, lossy), (1, 2, 3)
        )
    ]
    assert len(found) == episodes.n_episodes == 24
    assert episodes.conditions(seed=2, generation=9) == found
    exact = EpisodeSet(faults='loss=0.3,seed=7').conditions(0, 0)
    assert exact == [Conditions('biped', 'flat', 0, Faults(loss=0.3, seed=7))]


def test_a_drawn_set_depends_on_seed_and_generation_alone():
    sets = [DRAWN.conditions(seed, generation) for seed in (0, 1) for generation in (0, 1)]
    assert sets == [DRAWN.conditions(seed, generation) for seed in (0, 1) for generation in (0, 1)]
    sets.append(DRAWN.further_conditions(0))
    pushes = [one.push for drawn in sets for one in drawn]
    assert len(set(pushes)) == len(pushes) == 4 * DRAWN.draw + N_FURTHER
    assert min(pushes) >= FIRST_DRAWN_SEED  # never a start of an assessment


def test_a_drawn_set_covers_bodies_terrains_faults_and_their_ranges():
    found = DRAWN.conditions(0, 0)
    assert len(found) == DRAWN.n_episodes == 200
    for counts, n in (
        (Counter(one.shape for one in found), 2), (Counter(one.terrain for one in found), 2),
        (Counter(bool(one.faults.loss) + 2 * bool(one.faults.death) for one in found), 3),
    ):
        assert len(counts) == n
        assert min(counts.values()) > 200 / n - 4 * math.sqrt(200 / n)  # 4 standard deviations
    lossy = [one.faults for one in found if one.faults.loss]
    assert {one.delay for one in lossy} == {0, 1, 2, 3}
    assert 0.0 <= min(one.loss for one in lossy) < 0.1 < 0.4 < max(one.loss for one in lossy) <= 0.5
    shares = [one.faults.death.split('@') for one in found if one.faults.death]
    assert all(0.1 <= float(share) <= 0.3 and 5 <= float(begin) <= 10 for share, begin in shares)
    seeds = [one.faults.seed for one in found if one.faults != NO_FAULTS]
    assert len(set(seeds)) == len(seeds)
    assert {one.faults for one in found if not (one.faults.loss or one.faults.death)} == {NO_FAULTS}


def test_starts_can_be_drawn_from_a_few():
    found = EpisodeSet(starts=3, draw=100).conditions(0, 0)
    assert {one.push for one in found} == {1, 2, 3}


def test_the_ends_of_a_range_are_its_numbers():
    text = 'loss=0.25..0.5,delay=2..4,broken_sensors=zero:0..0.5@1..2-5,seed=3'
    low, high = (faults_at(text, lambda share=share: share) for share in (0.0, 1.0))
    assert (low.loss, low.delay, high.loss, high.delay, low.seed) == (0.25, 2, 0.5, 4, 3)
    assert low.broken_sensors.startswith('zero:0.000000000000@1.0')
    assert high.broken_sensors.endswith('@2.000000000000-5')
    shares = [i / 300 for i in range(300)]
    delays = Counter(faults_at(text, lambda share=share: share).delay for share in shares)
    assert delays == {2: 100, 3: 100, 4: 100}


scores = st.lists(st.floats(-1e6, 1e6) | st.just(-math.inf), min_size=1, max_size=40)


@given(scores)
def test_scores_are_combined_exactly(values):
    mean, least, most, quarter = (
        EpisodeSet(score=name).combined(values)
        for name in ('mean', 'minimum', 'quantile-1', 'quantile-0.25')
    )
    assert (least, most) == (min(values), max(values))
    if math.isinf(min(values)):
        assert mean == -math.inf
    else:
        assert mean == pytest.approx(statistics.mean(values), rel=1e-12, abs=1e-9)
    at_most = [sum(one <= value for one in values) for value in values]
    assert quarter == min(v for v, n in zip(values, at_most, strict=True) if 4 * n >= len(values))


@pytest.mark.parametrize(('name', 'expected'), [
    ('mean', 4.0), ('minimum', 1.0), ('quantile-0', 1.0), ('quantile-0.25', 1.0),
    ('quantile-0.26', 2.0), ('quantile-0.5', 2.0), ('quantile-0.75', 4.0), ('quantile-1', 9.0),
])
def test_the_score_of_four_episodes(name, expected):
    assert EpisodeSet(score=name).combined([9.0, 1.0, 4.0, 2.0]) == expected
    assert EpisodeSet(score=name, starts=4).described('v_x', 4) == (
        f'{name} v_x', ' over 4 episodes'
    )


def test_tenths_have_whole_ranks():
    values = [float(i) for i in range(1, 11)]
    found = [EpisodeSet(score=f'quantile-{q / 10}').combined(values) for q in range(1, 11)]
    assert found == values


@pytest.mark.parametrize(('values', 'words'), [
    ({'shape': 'biped,bipd'}, ["'bipd'", "did you mean 'biped'?"]),
    ({'shape': 'biped,'}, ['morphology', "''"]),
    ({'shape': 'biped, comb'}, ["' comb'"]),
    ({'shape': ['biped']}, ['shape', "['biped']", 'a string']),
    ({'shape': 'biped,biped'}, ['shape', 'each once']),
    ({'terrain': 'flat,hily-1-10-0'}, ["'hily-1-10-0'", "did you mean 'hilly'?"]),
    ({'faults': 'loss=0..0.5'}, ['faults', 'no range', 'draw']),
    ({'faults': 'loss=0.5..0.2', 'draw': 1}, ['0.5..0.2', 'FROM below TO']),
    ({'faults': 'loss=0..0.5..0.1', 'draw': 1}, ['loss']),
    ({'faults': 'loss=0..2', 'draw': 1}, ['loss', '2.0']),
    ({'faults': 'delay=0..1.5', 'draw': 1}, ['delay', 'whole numbers']),
    ({'faults': 'delay=0..1001', 'draw': 1}, ['delay', '1001']),
    ({'faults': f'loss=0..{"9" * 400}', 'draw': 1}, ['loss']),
    ({'faults': 'death=0.1@1..9-5', 'draw': 1}, ['death', '@BEGIN']),
    ({'faults': 'death=0..1@1..2-3..4,loss=0..1..2..3', 'draw': 1}, ['loss']),
    ({'faults': 'los=0..0.5', 'draw': 1}, ["'los'", "did you mean 'loss'?"]),
    ({'faults': 'loss=0.1,loss=0.2'}, ['each name once']),
    ({'faults': 'loss=0.1,seed=3', 'draw': 2}, ['no seed with draw']),
    ({'faults': 'faults.yaml'}, ['faults.yaml', 'name=value']),
    ({'faults': 'loss=0.1;'}, ['no empty text']),
    ({'faults': 'death=voxel_6_1', 'shape': 'comb,biped'}, ["'voxel_6_1'", 'biped']),
    ({'faults': 'loss=0.1,seed=2147483647', 'starts': 2}, ['seed', '2147483649']),
    ({'score': 'median'}, ['score', "'median'", 'quantile']),
    ({'score': 'quantile-1.5'}, ['score']),
    ({'starts': 10_000, 'shape': 'biped,comb'}, ['20000', 'at most 10000', 'draw']),
    ({'draw': -1}, ['draw', '-1']),
])
def test_bad_sets_are_refused(values, words):
    with pytest.raises(InvalidInput) as caught:
        EpisodeSet(**values)
    assert '\n' not in str(caught.value)
    assert all(word in str(caught.value) for word in words), caught.value


@given(st.text(max_size=30) | st.from_regex(r'(loss|delay|death)=[0-9.@-]{1,9}', fullmatch=True),
       st.integers(0, 2))
def test_any_text_of_faults_is_taken_or_refused(text, draw):
    with contextlib.suppress(InvalidInput):
        episodes = EpisodeSet(faults=text, draw=draw)
        assert len(EpisodeSet(faults=text, draw=draw).conditions(0, 0)) == episodes.n_episodes


def test_faults_of_a_file_become_text(tmp_path):
    path = tmp_path / 'faults.yaml'
    path.write_text('loss: 0.3\nsensor_noise: 1e-5\ndeath: 0.5@10\nseed: 4\n')
    text = text_of(str(path))
    assert '=' in text
    assert parse_faults(text) == parse_faults(str(path))
    assert text_of(Faults(loss=0.3, seed=4)) == 'loss=0.3,seed=4'
    assert (text_of(NO_FAULTS), text_of('none'), text_of('loss=0..1')) == (
        'none', 'none', 'loss=0..1'
    )




def test_a_set_goes_through_a_file():
    assert EpisodeSet.from_dict(DRAWN.as_dict()) == DRAWN
    for values, word in (({'shape': 'biped'}, 'terrain'), ({**DRAWN.as_dict(), 'x': 1}, "'x'")):
        with pytest.raises(InvalidInput, match=word):
            EpisodeSet.from_dict(values)
