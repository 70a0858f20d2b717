"""The configuration of an evolutionary run, stored as config.yaml in its folder."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from sim_node.control_time import steps_in
from sim_node.engine import DEFAULT_ENGINE, ENGINES, check_engine
from sim_node.errors import InvalidInput, check_keys
from sim_node.model.body_file import check_size
from sim_node.model.constants import check_declared, choice, constant, same_as
from sim_node.model.material import Material
from sim_node.model.morphology import DEFAULT_SHAPE, parse_morphology
from sim_node.model.physics import DEFAULT_PHYSICS, UNNAMED_PHYSICS
from sim_node.model.sensors import DEFAULT_SENSORS
from sim_node.model.solver import Solver
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import DEFAULT_ARCHITECTURE, Architecture
from snca_ros.cell.models import DEFAULT_NEURON_MODEL
from snca_ros.cell.models.arithmetic import DEFAULT_ARITHMETIC
from snca_ros.evolution.conditions import Conditions
from snca_ros.evolution.config_keys import LATER, compacted, present_keys
from snca_ros.evolution.episode import EPISODE, LONGEST, TRANSIENT
from snca_ros.evolution.episode_set import N_FURTHER, EpisodeSet, cached_set
from snca_ros.evolution.strategies import DEFAULT_STRATEGY, STRATEGIES, Strategy
from snca_ros.evolution.tasks import DEFAULT_TASK, TASKS, check_task
from snca_ros.files import short_name
from snca_ros.yaml_file import read_yaml, yaml_text

_LONGEST_NAME = 180  # bytes; names of files add an ending to it, and may have 255


@dataclass(frozen=True)
class RunConfig:
    """The configuration of an evolutionary run.

    Attributes:
        shape: morphology, a name or a grid, or several of them, see `EpisodeSet`.
        architecture: architecture of the cells; with several shapes it is uniform.
        material, solver: options of the simulation.

    The declarations of the other attributes describe them.

    Raises:
        InvalidInput: a value is invalid.
    """

    shape: str
    architecture: Architecture
    terrain: str = same_as(EpisodeSet, 'terrain')
    episodes: int = constant(30_000, 1, 10**9, 'total number of episodes')
    seed: int = constant(0, 0, 2**32 - 1, 'seed of all random numbers')
    population: int = constant(36, 4, 100_000, 'individuals per generation')
    sigma: float = constant(0.35, 1e-9, 100.0, 'standard deviation of the offspring')
    duration: float = constant(EPISODE, 0.1, LONGEST, 'duration of an episode', 's')
    transient: float = constant(
        TRANSIENT, 0.0, LONGEST, 'time at the start of an episode that is not scored', 's'
    )
    material: Material = field(default_factory=Material)
    solver: Solver = field(default_factory=Solver)
    engine: str = choice(DEFAULT_ENGINE, ENGINES, 'physics engine in which episodes are scored')
    strategy: str = choice(DEFAULT_STRATEGY, STRATEGIES, 'optimiser')
    task: str = choice(DEFAULT_TASK, TASKS, 'task that defines the score of an episode')
    faults: str = same_as(EpisodeSet, 'faults')
    starts: int = same_as(EpisodeSet, 'starts')
    draw: int = same_as(EpisodeSet, 'draw')
    score: str = same_as(EpisodeSet, 'score')

    def __post_init__(self) -> None:
        of_candidate = EpisodeSet(**self._of_set)
        check_declared(self)
        if len(of_candidate.shapes) > 1 and not self.architecture.uniform:
            expected = (
                f'one shape, or a uniform architecture: the parameters of {self.architecture.name} '
                'are those of the voxels of one body'
            )
            raise InvalidInput('shape', self.shape, expected)
        if not self.room(0):
            least = self.reserved + of_candidate.n_episodes
            expected = f'at least {least}, for one candidate in {of_candidate.n_episodes} episodes'
            if self.draw:
                expected += f' and the choice of the best, {self.reserved} episodes'
            raise InvalidInput('episodes', self.episodes, expected)
        if steps_in(self.transient) >= steps_in(self.duration):
            expected = f'a time below the duration of an episode, {self.duration:g} s'
            raise InvalidInput('transient', self.transient, expected)
        check_engine(self.engine, self.solver)
        check_task(self.task)
        check_size(self.n_parameters)

    @property
    def _of_set(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in EpisodeSet.__dataclass_fields__}

    @property
    def episode_set(self) -> EpisodeSet:
        """Return the episodes of one candidate."""
        return cached_set(**self._of_set)

    @property
    def reserved(self) -> int:
        """Return the number of episodes that choose the best individual at the end of the run.

        It is 0 unless sets are drawn: then each parent of the last population has `N_FURTHER`.
        """
        return N_FURTHER * self.n_elite if self.draw else 0

    def room(self, spent: int) -> int:
        """Return how many candidates the budget has left for the next generation.

        Without drawn sets, the last generation can be smaller than the others. With them, each
        generation but the first needs a whole population, since its fitness is compared with no
        other generation's.

        Args:
            spent: number of episodes spent so far.
        """
        n = (self.episodes - self.reserved - spent) // self.episode_set.n_episodes
        too_few = self.draw > 0 and spent > 0 and n < self.population
        return 0 if too_few else max(n, 0)

    def conditions(self, push: int = 0) -> Conditions:
        """Return the conditions of an episode without faults at home, the first body and terrain.

        Args:
            push: 0, or the seed of a pushed start.
        """
        return Conditions(self.episode_set.shapes[0], self.episode_set.terrains[0], push)

    def simulation(self, conditions: Conditions | None = None) -> Simulation:
        """Return the simulation of an episode; without conditions, of one at home."""
        conditions = conditions or self.conditions()
        return Simulation(
            conditions.shape, conditions.terrain,
            material=self.material, solver=self.solver, engine=self.engine, push=conditions.push,
            sensors=self.architecture.sensors, **conditions.faults.of_body,
        )

    def new_strategy(self) -> Strategy:
        """Return the strategy in its state before the first generation."""
        return STRATEGIES[self.strategy](
            self.n_parameters, population=self.population, sigma=self.sigma, seed=self.seed
        )

    @property
    def name(self) -> str:
        """Return the name of the run, which consists of its settings.

        It omits material, sub-steps and iterations, and most settings with default values. The
        first runs were made before there was a choice of physics, so their names have none. Runs
        whose candidates have one episode each name their budget `evaluations`, as the first ones. A
        name that is too long for files ends with a digest, see `short_name`.
        """
        cell = self.architecture
        usual = Architecture(
            cell.uniform, cell.directional, cell.neuron_model, cell.n_c, sensors=cell.sensors
        )
        parts = [self.shape.replace(',', '+'), cell.name, cell.neuron_model]
        if cell.as_printed:
            parts.append('as-printed')
        if cell.arithmetic != DEFAULT_ARITHMETIC:
            parts.append(cell.arithmetic)
        if cell.sensors != DEFAULT_SENSORS:
            parts.append(f'sensors-{"+".join(cell.sensors)}')
        if cell.n_c != Architecture.named(cell.name, cell.neuron_model).n_c:
            parts.append(f'n_c{cell.n_c}')
        if cell.hidden != usual.hidden:
            parts.append(f'hidden{"x".join(map(str, cell.hidden)) or 0}')
        parts.append(self.terrain.replace(',', '+'))
        if self.faults:
            parts.append(f'faults-{self.faults.replace(";", "+")}')
        parts += [f'{key}{getattr(self, key)}' for key in ('starts', 'draw') if getattr(self, key)]
        if self.score != EpisodeSet.score:
            parts.append(self.score)
        if self.task != DEFAULT_TASK:
            parts.append(self.task)
        if self.engine != DEFAULT_ENGINE:
            parts.append(self.engine)
        if self.strategy != DEFAULT_STRATEGY:
            parts.append(self.strategy)
        if self.solver.physics != UNNAMED_PHYSICS:
            parts.append(self.solver.physics)
        for key in ('episodes', 'population', 'sigma', 'duration', 'transient'):
            value = getattr(self, key)
            if value != type(self).__dataclass_fields__[key].default:
                named = 'evaluations' if key == 'episodes' and self.episode_set.is_plain else key
                parts.append(f'{named}{value:.15g}')
        return short_name('-'.join([*parts, f'seed{self.seed}']), _LONGEST_NAME)

    @property
    def n_parameters(self) -> int:
        """Return the number of parameters of a candidate."""
        body = parse_morphology(self.episode_set.shapes[0])
        return self.architecture.n_parameters(body.n_voxels)

    @property
    def n_elite(self) -> int:
        """Return the number of parents: the best quarter of the population."""
        return self.population // 4

    @property
    def other_engine(self) -> str:
        """Return the other engine, in which the best individual is scored at the end."""
        return next(engine for engine in ENGINES if engine != self.engine)

    def to_yaml(self) -> str:
        """Return the text of config.yaml."""
        values = {**asdict(self), 'architecture': self.architecture.to_dict()}
        later = {key: values.pop(key) for key in LATER}
        return yaml_text({**later, **values})

    @classmethod
    def named(
        cls,
        shape: str = DEFAULT_SHAPE,
        architecture: str = DEFAULT_ARCHITECTURE,
        neuron_model: str = DEFAULT_NEURON_MODEL,
        *,
        physics: str = DEFAULT_PHYSICS,
        n_c: int | None = None,
        hidden: tuple[int, ...] | None = None,
        as_printed: bool = False,
        sensors: Sequence[str] = DEFAULT_SENSORS,
        **settings: Any,
    ) -> 'RunConfig':
        """Return a configuration from the names of an architecture and a physics.

        Args:
            shape, settings: see `RunConfig`; the default terrain is that of the task. Shapes,
                terrains and faults may have spaces, or be lists.
            architecture, neuron_model, n_c, hidden, as_printed, sensors: see
                `Architecture.named`.
            physics: one of `sim_node.model.physics.PHYSICS`.
        """
        cell = Architecture.named(
            architecture, neuron_model, n_c=n_c, hidden=hidden, as_printed=as_printed,
            sensors=sensors,
        )
        task = check_task(settings.get('task', DEFAULT_TASK))
        settings = compacted({'shape': shape, 'terrain': task.terrain, **settings})
        return cls(**settings, architecture=cell, solver=Solver(physics=physics))

    @classmethod
    def from_yaml(cls, path: Path) -> 'RunConfig':
        """Read config.yaml; InvalidInput, with the file's name, if it is missing or invalid."""
        values = read_yaml(path, 'a run configuration')
        try:
            return cls.from_dict(values)
        except InvalidInput as error:
            raise error.found_in(str(path)) from None

    @classmethod
    def from_dict(cls, values: object) -> 'RunConfig':
        """Return the configuration in a parsed config.yaml."""
        if not isinstance(values, dict):
            raise InvalidInput('config', values, 'keys and values')
        values, keys = present_keys(values), list(cls.__dataclass_fields__)
        check_keys('key', values, keys)
        for key in keys:
            if key not in values and key not in LATER:
                raise InvalidInput(key, None, 'a value')
        for key in ('architecture', 'material', 'solver'):
            if not isinstance(values[key], dict):
                raise InvalidInput(key, values[key], 'keys and values')
        parts = {
            'architecture': Architecture.from_dict(values['architecture']),
            'material': Material.from_dict(values['material']),
            'solver': Solver.from_dict(values['solver']),
        }
        return cls(**{**values, **parts})
