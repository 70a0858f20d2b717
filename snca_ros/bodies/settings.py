"""The settings of a search for bodies."""

from dataclasses import asdict, dataclass
from pathlib import Path

from sim_node.control_time import steps_in
from sim_node.engine import DEFAULT_ENGINE, ENGINES
from sim_node.errors import InvalidInput, check_keys
from sim_node.model.constants import check_declared, choice, constant, text_value
from sim_node.model.terrain import DEFAULT_TERRAIN, TERRAIN_FORM, parse_terrain
from snca_ros.bodies.grids import Frame
from snca_ros.evolution.episode import EPISODE, LONGEST, TRANSIENT
from snca_ros.yaml_file import read_yaml, yaml_text


@dataclass(frozen=True)
class SearchSettings:
    """The settings of a search for bodies; they and the controller determine its results.

    Raises:
        InvalidInput: a value is invalid, the episode is not longer than the transient, or there
            are fewer episodes than starts.
    """

    episodes: int = constant(10_000, 1, 10**9, 'total number of episodes')
    starts: int = constant(
        8, 1, 10_000, 'pushed starts, an episode each, over which the score of a body is the mean'
    )
    voxels: int = constant(20, 1, 1024, 'largest number of voxels of a body')
    width: int = constant(9, 1, 32, 'largest number of columns of a body')
    height: int = constant(5, 1, 32, 'largest number of rows of a body')
    batch: int = constant(24, 1, 100_000, 'bodies per generation')
    seed: int = constant(0, 0, 2**32 - 1, 'seed of all random numbers')
    duration: float = constant(EPISODE, TRANSIENT, LONGEST, 'duration of an episode', 's')
    engine: str = choice(DEFAULT_ENGINE, ENGINES, 'physics engine')
    terrain: str = text_value(DEFAULT_TERRAIN, 'ground', TERRAIN_FORM)

    def __post_init__(self) -> None:
        check_declared(self)
        parse_terrain(self.terrain)
        if steps_in(self.duration) <= steps_in(TRANSIENT):
            expected = f'a time above {TRANSIENT:g} s, since the first {TRANSIENT:g} s do not count'
            raise InvalidInput('duration', self.duration, expected)
        if self.episodes < self.starts:
            expected = f'at least {self.starts}, the number of starts of one body'
            raise InvalidInput('episodes', self.episodes, expected)

    @property
    def frame(self) -> Frame:
        """Return the limits of the bodies."""
        return Frame(self.width, self.height, self.voxels)

    @property
    def bodies(self) -> int:
        """Return the number of bodies that the episodes suffice for."""
        return self.episodes // self.starts

    def to_yaml(self) -> str:
        """Return the text of search.yaml."""
        return yaml_text(asdict(self))

    @classmethod
    def from_yaml(cls, path: Path) -> 'SearchSettings':
        """Read search.yaml; InvalidInput, with the file's name, if it is missing or invalid."""
        values = read_yaml(path, 'the settings of a search for bodies')
        try:
            if not isinstance(values, dict):
                raise InvalidInput('settings', values, 'keys and values')
            keys = list(cls.__dataclass_fields__)
            check_keys('key', values, keys)
            for key in keys:
                if key not in values:
                    raise InvalidInput(key, None, 'a value')
            return cls(**values)
        except InvalidInput as error:
            raise error.found_in(str(path)) from None
