"""Sets of episodes: those that a candidate goes through, fixed or drawn, and their common score."""

import functools
import math
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from sim_node.errors import InvalidInput, check_keys
from sim_node.model.body_faults import BLOCK, BodyFaults
from sim_node.model.constants import check_declared, constant, text_value
from sim_node.model.morphology import DEFAULT_SHAPE, SHAPES, parse_morphology
from sim_node.model.terrain import DEFAULT_TERRAIN, TERRAIN_FORM, parse_terrain
from snca_ros.evolution.conditions import Conditions
from snca_ros.evolution.fault_ranges import NONE, check_ranges, faults_at, has_ranges
from snca_ros.faults import NO_FAULTS, CellFaults, Faults

N_FURTHER = 32
"""Number of further episodes on which a run with drawn sets chooses its best individual."""

MOST_EPISODES = 10_000
"""Largest number of episodes of one candidate."""

FIRST_DRAWN_SEED = 1_000_000
"""Smallest seed of drawn starts and faults; those of fixed sets and assessments are below it."""

_FAULTS_FORM = (
    'name=value,... or none, such as loss=0.3; several separated by semicolons, or the option '
    'repeated; with draw, a number may be a range, such as loss=0..0.5'
)
_SCORE_FORM = 'mean, minimum, quantile-<0 to 1>'
_QUANTILE = re.compile(r'quantile-(0(?:\.\d+)?|1(?:\.0+)?)', re.ASCII)
_SETS, _FURTHER = 1, 2  # random streams of a run; 0 would be that of its strategy


def quantile_of(score: str, name: str = 'score') -> float:
    """Return the quantile that a `score` names, NaN for 'mean', 0 for 'minimum'.

    Raises:
        InvalidInput: there is no such score; the error names the option `name`.
    """
    known = {'mean': math.nan, 'minimum': 0.0}
    if isinstance(score, str):
        if score in known:
            return known[score]
        if match := _QUANTILE.fullmatch(score):
            return float(match[1])
    raise InvalidInput(name, score, f'one of {_SCORE_FORM}')


@dataclass(frozen=True)
class EpisodeSet:
    """The episodes of one candidate, and how their scores are combined.

    Without `draw` they are the product of bodies, terrains, faults and starts, the same in every
    generation. With `draw`, so many are drawn from it for each generation.

    Raises:
        InvalidInput: a value is invalid.
    """

    shape: str = text_value(
        DEFAULT_SHAPE, 'bodies, separated by commas', f'{", ".join(SHAPES)} with a size, or a grid'
    )
    terrain: str = text_value(
        DEFAULT_TERRAIN,
        'ground, or several separated by commas; if it is not given, that of the task',
        TERRAIN_FORM,
    )
    faults: str = text_value('', 'faults in the episodes', _FAULTS_FORM)
    starts: int = constant(
        0, 0, MOST_EPISODES, 'number of pushed starts in place of the exact one; 0 with draw: each '
        'drawn episode has a start of its own'
    )
    draw: int = constant(
        0, 0, MOST_EPISODES, 'number of episodes that are drawn in each generation; 0: all bodies, '
        'terrains, faults and starts in every generation'
    )
    score: str = text_value(
        'mean', "what a candidate's scores in its episodes are combined to", _SCORE_FORM,
        lambda name, value: quantile_of(value, name),
    )

    def __post_init__(self) -> None:
        check_declared(self)
        for names, parse in ((self.shapes, parse_morphology), (self.terrains, parse_terrain)):
            for name in names:
                parse(name)
        for field in ('shape', 'terrain', 'faults'):
            members = getattr(self, field).split(';' if field == 'faults' else ',')
            if not self.draw and len(set(members)) < len(members):
                raise InvalidInput(field, getattr(self, field), 'each once, unless with draw')
        for text in self._faults:
            if not text and self.faults:
                raise InvalidInput('faults', self.faults, f'no empty text, but {_FAULTS_FORM}')
            self._check_faults(text)
        if self.n_episodes > MOST_EPISODES:
            expected = f'at most {MOST_EPISODES}; draw some of them with draw'
            raise InvalidInput('episodes of a candidate', self.n_episodes, expected)

    def _check_faults(self, text: str) -> None:
        if has_ranges(text) and not self.draw:
            raise InvalidInput('faults', text, 'no range FROM..TO, unless with draw')
        if self.draw and re.search(r'(^|,)seed=', text):
            raise InvalidInput('faults', text, 'no seed with draw: each episode has its own')
        check_ranges(text)
        faults = faults_at(text, lambda: 0.5)
        replace(faults, seed=faults.seed + self.starts)
        for shape in self.shapes:  # the named voxels must exist
            morphology = parse_morphology(shape)
            CellFaults(faults, morphology)
            BodyFaults(morphology, faults, BLOCK)

    @property
    def shapes(self) -> tuple[str, ...]:
        """Return the bodies."""
        return tuple(self.shape.split(','))

    @property
    def terrains(self) -> tuple[str, ...]:
        """Return the names of the terrains."""
        return tuple(self.terrain.split(','))

    @property
    def _faults(self) -> tuple[str, ...]:
        return tuple(self.faults.split(';'))

    @property
    def n_episodes(self) -> int:
        """Return the number of episodes of one candidate in a generation."""
        n_all = len(self.shapes) * len(self.terrains) * len(self._faults) * max(1, self.starts)
        return self.draw or n_all

    @property
    def is_plain(self) -> bool:
        """Return whether it is one episode from the exact start without faults."""
        return not (self.draw or self.starts) and self.n_episodes == 1 and self.faults in NONE

    def conditions(self, seed: int, generation: int) -> list[Conditions]:
        """Return the conditions of the episodes in a generation of the run with that seed.

        The faults of the pushed start s have the seed given in their text, else 0, plus s. Those of
        a drawn episode have a seed of their own.
        """
        if self.draw:
            return self._drawn(np.random.default_rng([seed, generation, _SETS]), self.draw)
        faults = [faults_at(text, lambda: 0.0) for text in self._faults]
        starts = range(1, self.starts + 1) if self.starts else (0,)
        return [
            Conditions(shape, terrain, start, _seeded(given, given.seed + start))
            for shape, terrain, given, start in product(self.shapes, self.terrains, faults, starts)
        ]

    def further_conditions(self, seed: int) -> list[Conditions]:
        """Return the conditions of the `N_FURTHER` episodes that choose the best of a run."""
        return self._drawn(np.random.default_rng([seed, 0, _FURTHER]), N_FURTHER)

    def _drawn(self, rng: np.random.Generator, n: int) -> list[Conditions]:
        def one_of(several: Sequence[str]) -> str:
            return several[int(rng.integers(len(several)))]

        def new_seed() -> int:
            return int(rng.integers(FIRST_DRAWN_SEED, 2**31))

        found = []
        for _ in range(n):
            shape, terrain = one_of(self.shapes), one_of(self.terrains)
            push = int(rng.integers(1, self.starts + 1)) if self.starts else new_seed()
            seed, faults = new_seed(), faults_at(one_of(self._faults), rng.random)
            found.append(Conditions(shape, terrain, push, _seeded(faults, seed)))
        return found

    def combined(self, scores: Sequence[float]) -> float:
        """Return the score of a candidate from those of its episodes.

        A diverged episode counts as -inf. The quantile q of n scores is the smallest of them below
        or at which a share q of them lies, without interpolation: the ⌈q n⌉-th smallest, from 1.
        """
        quantile = quantile_of(self.score)
        if not math.isnan(quantile):
            return sorted(scores)[max(0, math.ceil(quantile * len(scores) - 1e-9) - 1)]
        return -math.inf if -math.inf in scores else math.fsum(scores) / len(scores)

    @property
    def summary(self) -> str:
        """Return what is more than one plain episode on a body and a terrain; '' if nothing is.

        It follows a text of the bodies and terrains, as ', faults loss=0.3, the mean of 5 episodes
        per candidate'.
        """
        if self.is_plain:
            return ''
        faults = '' if self.faults in NONE else f', faults {"; ".join(self._faults)}'
        starts = f', starts 1 to {self.starts}' if self.starts else ''
        drawn = ' drawn in each generation' if self.draw else ''
        return f'{faults}{starts}, {self.score} of {self.n_episodes} episodes per candidate{drawn}'

    def described(self, quantity: str, n: int) -> tuple[str, str]:
        """Return the name of a combined score, and over what: 'mean v_x', ' over 24 episodes'.

        Both parts are those of a single episode, 'v_x' and '', if the set is one.

        Args:
            quantity: what is scored, such as 'v_x'.
            n: number of episodes.
        """
        if self.is_plain:
            return quantity, ''
        return f'{self.score} {quantity}', f' over {n} episode{"s" * (n != 1)}'

    def as_dict(self) -> dict[str, Any]:
        """Return the values by name, for files."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict) -> 'EpisodeSet':
        """Return the set with these values; InvalidInput if one is unknown, missing or invalid."""
        names = list(cls.__dataclass_fields__)
        check_keys('episode_set', values, names)
        for name in names:
            if name not in values:
                raise InvalidInput(f'episode_set.{name}', None, 'a value')
        return cls(**values)


cached_set = functools.lru_cache(maxsize=64)(EpisodeSet)
"""An `EpisodeSet` of valid values, which is checked once."""


def _seeded(faults: Faults, seed: int) -> Faults:
    """Return faults with a seed; without faults there is none."""
    return faults if faults == NO_FAULTS else replace(faults, seed=seed)
