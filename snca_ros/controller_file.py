"""Controller files: trained parameters and all that is needed to run them again, in one .npz."""

import functools
import json
import subprocess
import zipfile
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from sim_node.errors import InvalidInput, check_keys, check_name
from sim_node.material import Material
from sim_node.morphology import Morphology, parse_morphology
from sim_node.solver import ENGINES, Solver
from sim_node.terrain import parse_terrain
from snca_ros import __version__
from snca_ros.cell.nca import Architecture
from snca_ros.controller import Controller
from snca_ros.faults import Faults
from snca_ros.files import write_atomically

FORMAT_VERSION = 1
_MAX_BYTES = 64 * 2**20
_GIT_LIMIT = 30.0  # s
_FIELDS = (
    'format_version', 'architecture', 'morphology', 'terrain', 'material', 'solver',
    'fitness', 'seed', 'evaluations', 'versions', 'chosen_by', 'v_x',
)


@dataclass(frozen=True)
class TrainedController:
    """What a controller file holds.

    Attributes:
        architecture: what kind of cells.
        morphology: the robot that they were evolved for.
        theta: (n_parameters,) weights.
        terrain: name of the ground that they were evolved on.
        material, solver: of the simulation that they were evolved in.
        fitness: v_x [m/s] of the episode that evolution scored.
        chosen_by: the engine of that episode.
        v_x: v_x [m/s] of one episode in each engine that scored it.
        seed, evaluations: of the run that found them.
        versions: packages that were used, name to version, and 'code', see `code_version`.
    """

    architecture: Architecture
    morphology: Morphology
    theta: np.ndarray
    terrain: str = 'flat'
    material: Material = field(default_factory=Material)
    solver: Solver = field(default_factory=Solver)
    fitness: float = float('nan')
    seed: int = 0
    evaluations: int = 0
    versions: dict[str, str] = field(default_factory=dict)
    chosen_by: str = 'pymunk'
    v_x: dict[str, float] = field(default_factory=dict)

    def controller(self, faults: Faults | None = None) -> Controller:
        """Return all cells, ready to step."""
        return Controller(self.architecture, self.morphology, self.theta, faults)


_CODE = 'sim_node', 'snca_ros'  # what of a checkout decides an episode's result


@functools.cache
def code_version() -> str:
    """Return which code runs: the commit that last changed it, or the version of the package.

    In a git checkout it is the first 12 digits of the last commit that changed one of the two
    packages, and '-dirty' if they are not as committed: commits of documents or results leave it as
    it is. Elsewhere, or without git, it is the version of the package. A process asks once.
    """
    root = Path(__file__).resolve().parents[1]
    if (root / '.git').exists():
        git = ['git', '--no-optional-locks', '-C', str(root)]
        try:
            commit, changes = (
                subprocess.run(
                    [*git, *command, '--', *_CODE],
                    capture_output=True, text=True, check=True, timeout=_GIT_LIMIT,
                ).stdout.strip()
                for command in (
                    ('log', '-1', '--format=%h', '--abbrev=12'),
                    ('status', '--porcelain', '--untracked-files=no'),
                )
            )
        except (OSError, subprocess.SubprocessError):
            commit = ''
        if commit:
            return f'{commit}-dirty' if changes else commit
    return __version__


@functools.cache
def package_versions() -> dict[str, str]:
    """Return the versions of the packages that decide an episode's result, and of the code."""
    versions = {'code': code_version()}
    for name in ('snca_ros', 'numpy', 'numba', 'pymunk'):
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = 'not installed'
    return versions


def save_controller(path: Path | str, trained: TrainedController) -> None:
    """Write `trained` to `path`, atomically."""
    header = {
        'format_version': FORMAT_VERSION,
        'architecture': trained.architecture.to_dict(),
        'morphology': {'name': trained.morphology.name, 'grid': trained.morphology.grid_string},
        'terrain': trained.terrain,
        'material': asdict(trained.material),
        'solver': asdict(trained.solver),
        'fitness': float(trained.fitness),
        'seed': int(trained.seed),
        'evaluations': int(trained.evaluations),
        'versions': trained.versions or package_versions(),
        'chosen_by': trained.chosen_by,
        'v_x': trained.v_x,
    }
    text = np.array(json.dumps(header))
    write_atomically(
        Path(path), lambda file: np.savez_compressed(file, header=text, theta=trained.theta)
    )


def load_controller(path: Path | str) -> TrainedController:
    """Read and check the controller file at `path`.

    Raises:
        InvalidInput: the file is missing, broken, pickled, of another version, or a field of it
            is not what it should be; the text names file, field, value and expectation.
    """
    path = Path(path)
    try:
        header, theta = _read(path)
        return _checked(header, theta)
    except InvalidInput as error:
        raise error.found_in(str(path)) from None


def _read(path: Path) -> tuple[dict, np.ndarray]:
    expected = 'a controller file (.npz) written by evolve'
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise InvalidInput('file', f'{path.stat().st_size} bytes', f'at most {_MAX_BYTES}')
        archive = np.load(path, allow_pickle=False)
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise InvalidInput('file', 'a single array', expected)
        with archive as data:
            entries = data.zip.infolist() if data.zip else []
            size = sum(entry.file_size for entry in entries)
            if size > _MAX_BYTES:
                raise InvalidInput('file', f'{size} bytes unpacked', f'at most {_MAX_BYTES}')
            missing = {'header', 'theta'} - set(data.files)
            if missing:
                name = sorted(missing)[0]
                raise InvalidInput('file', f'no entry {name}', expected)
            header, theta = _parsed(data['header']), data['theta']
    except InvalidInput:
        raise
    except OSError as error:
        raise InvalidInput('file', error.strerror or str(error), expected) from None
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile, zipfile.LargeZipFile) as error:
        raise InvalidInput('file', str(error), expected) from None
    except Exception as error:  # zlib.error and whatever else a damaged archive provokes
        raise InvalidInput('file', f'{type(error).__name__}: {error}', expected) from None
    return header, theta


def _parsed(text: np.ndarray) -> dict:
    if text.shape != () or text.dtype.kind != 'U':
        shown = f'{text.dtype} of shape {text.shape}'
        raise InvalidInput('header', shown, 'one text')
    try:
        header = json.loads(text.item())
    except (ValueError, RecursionError) as error:
        raise InvalidInput('header', str(error), 'a JSON object') from None
    if not isinstance(header, dict):
        raise InvalidInput('header', header, 'a JSON object')
    return header


def _field(values: dict, name: str, kinds: type | tuple[type, ...], outer: str = '') -> Any:
    value = values.get(name)
    if not isinstance(value, kinds) or isinstance(value, bool):
        names = kinds.__name__ if isinstance(kinds, type) else ' or '.join(
            k.__name__ for k in kinds
        )
        raise InvalidInput(f'{outer}{name}', value, f'a value of type {names}')
    return value


def _count(header: dict, name: str) -> int:
    value = _field(header, name, int)
    if value < 0:
        raise InvalidInput(name, value, 'an integer from 0')
    return value


def _engine(name: Any, where: str) -> str:
    check_name(where, name, ENGINES)
    return name


def _scores(values: Any) -> dict[str, float]:
    if not isinstance(values, dict):
        raise InvalidInput('v_x', values, 'a speed per engine')
    return {_engine(name, 'v_x'): _field(values, name, float, 'v_x.') for name in values}


def _checked(header: dict, theta: np.ndarray) -> TrainedController:
    version = _field(header, 'format_version', int)
    if version != FORMAT_VERSION:
        raise InvalidInput('format_version', version, str(FORMAT_VERSION))
    check_keys('header', header, _FIELDS)
    architecture = Architecture.from_dict(_field(header, 'architecture', dict))
    shape = _field(header, 'morphology', dict)
    check_keys('morphology', shape, ('name', 'grid'))
    name = _field(shape, 'name', str, 'morphology.')
    morphology = Morphology(name, parse_morphology(shape.get('grid', '')).cells)
    terrain = parse_terrain(_field(header, 'terrain', str)).name
    expected = architecture.n_parameters(morphology.n_voxels)
    if theta.dtype != np.float64 or theta.shape != (expected,):
        shown = f'{theta.dtype} of shape {theta.shape}'
        raise InvalidInput('theta', shown, f'float64 of shape ({expected},)')
    if not np.isfinite(theta).all():
        bad = int(np.flatnonzero(~np.isfinite(theta))[0])
        raise InvalidInput(f'theta[{bad}]', float(theta[bad]), 'a finite number')
    return TrainedController(
        architecture=architecture,
        morphology=morphology,
        theta=theta,
        terrain=terrain,
        material=Material.from_dict(_field(header, 'material', dict)),
        solver=Solver.from_dict(_field(header, 'solver', dict)),
        fitness=_field(header, 'fitness', float),
        seed=_count(header, 'seed'),
        evaluations=_count(header, 'evaluations'),
        versions={str(k): str(v) for k, v in _field(header, 'versions', dict).items()},
        chosen_by=_engine(header.get('chosen_by', 'pymunk'), 'chosen_by'),
        v_x=_scores(header.get('v_x', {})),
    )
