"""The state of a run after a generation, from which it goes on."""

from dataclasses import dataclass, field

import numpy as np

from snca_ros.evolution.conditions import Conditions
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode_set import N_FURTHER


@dataclass
class Progress:
    """The state of a run after a generation.

    Attributes:
        strategy: arrays of the strategy's state.
        history: one row of `HISTORY` values per generation.
        whole: individuals and fitness, best first, of the last population with a complete
            generation, if the budget has cut the last generation short; else None.
        score_other: score of the best individual in the other engine (see `RunConfig`); NaN if that
            engine cannot run it, None before the end of the run.
        wall_time: earliest time [s] at which the best individual met the wall at the end of the
            ground in the episodes of its score; None if it did not.
        further: scores of the parents on the further episodes at the end of a run with drawn sets,
            in the order of the individuals; empty before the end, and for all other runs.
        by_old_rules: whether an earlier version finished the run: it stored no `whole` population,
            and in batched runs it chose among the best quarter by `reassessed`.
        reassessed: v_x [m/s] of that quarter in the pymunk engine, in the order of their fitness;
            empty for all other runs.
    """

    strategy: dict[str, np.ndarray] = field(default_factory=dict)
    history: list[tuple[float, ...]] = field(default_factory=list)
    whole: tuple[np.ndarray, np.ndarray] | None = None
    score_other: float | None = None
    wall_time: float | None = None
    further: np.ndarray = field(default_factory=lambda: np.empty(0))
    by_old_rules: bool = False
    reassessed: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def episodes(self) -> int:
        """Return the number of episodes spent."""
        return N_FURTHER * len(self.further) + int(self.history[-1][1] if self.history else 0)

    @property
    def best(self) -> np.ndarray:
        """Return the best individual, (n_parameters,)."""
        return self.strategy['individuals'][self._place]

    @property
    def _place(self) -> int:
        return int(np.argmax(self.further)) if len(self.further) else 0

    def conditions(self, config: RunConfig) -> list[Conditions]:
        """Return the conditions of the episodes of the last generation of a run."""
        return config.episode_set.conditions(config.seed, len(self.history) - 1)

    @property
    def population(self) -> tuple[np.ndarray, np.ndarray]:
        """Return individuals, (n, n_parameters), and fitness, (n,), of the last whole population.

        The best is first. If the budget is below one generation, the population is incomplete.
        """
        return self.whole or (self.strategy['individuals'], self.strategy['fitness'])

    def chosen(self, config: RunConfig) -> tuple[int, str, dict[str, float]]:
        """Return the best individual: its index, the engine that chose it, and its scores.

        Args:
            config: configuration of the run.

        Returns:
            (index among the individuals, name of the engine, score in each engine).
        """
        fitness, engine = self.strategy['fitness'], config.engine
        if len(self.reassessed):
            i = int(np.argmax(self.reassessed))
            return i, 'pymunk', {engine: float(fitness[i]), 'pymunk': float(self.reassessed[i])}
        i = self._place
        scores = {engine: float(self.further[i] if len(self.further) else fitness[0])}
        if self.score_other is not None and not np.isnan(self.score_other):
            scores[config.other_engine] = self.score_other
        return i, engine, scores
