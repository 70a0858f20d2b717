"""Reading the body part of a controller file: the robot and the simulation of its evolution.

A controller file is an .npz archive with a JSON text `header` and arrays. The rest of it, which
describes the cells, is read by `snca_ros.controller_file`.
"""

import json
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sim_node.errors import InvalidInput, check_keys
from sim_node.model.material import Material
from sim_node.model.morphology import Morphology, parse_morphology
from sim_node.model.sensors import DEFAULT_SENSORS, check_sensors
from sim_node.model.solver import Solver
from sim_node.model.terrain import parse_terrain

FORMAT_VERSION = 2
"""Version of new files. Files of version 1 have no field `task`: their task is walking."""

_READABLE = (1, FORMAT_VERSION)
MOST_PARAMETERS = 2**23
"""Largest number of parameters in a controller file."""

_MAX_BYTES = 8 * MOST_PARAMETERS + 2**20  # the parameters, and more than enough for the rest


@dataclass(frozen=True)
class BodyPart:
    """The body and the simulation in a controller file.

    Attributes:
        morphology: morphology of the robot.
        terrain: name of the terrain.
        material, solver: options of the simulation; the solver names the physics.
        sensors: names of the sensors of each voxel; the default ones in files that name none.
    """

    morphology: Morphology
    terrain: str
    material: Material
    solver: Solver
    sensors: tuple[str, ...]


def load_body(path: Path | str) -> BodyPart:
    """Read and check the body part of the controller file at `path`.

    Raises:
        InvalidInput: the file is missing, damaged, pickled or of another version, or a field of
            this part is invalid.
    """
    try:
        header, _ = read_archive(Path(path))
        check_version(header)
        return body_of(header)
    except InvalidInput as error:
        raise error.found_in(str(path)) from None


def read_archive(path: Path, *arrays: str) -> tuple[dict, dict[str, np.ndarray]]:
    """Return the header of a controller file and the arrays of these names, unchecked.

    Raises:
        InvalidInput: the file is missing, too large, damaged or pickled, or lacks an entry.
    """
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
            missing = {'header', *arrays} - set(data.files)
            if missing:
                name = sorted(missing)[0]
                raise InvalidInput('file', f'no entry {name}', expected)
            return _parsed(data['header']), {name: data[name] for name in arrays}
    except InvalidInput:
        raise
    except OSError as error:
        raise InvalidInput('file', error.strerror or str(error), expected) from None
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile, zipfile.LargeZipFile) as error:
        raise InvalidInput('file', str(error), expected) from None
    except Exception as error:  # zlib.error and other errors of damaged archives
        raise InvalidInput('file', f'{type(error).__name__}: {error}', expected) from None


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


def check_version(header: dict) -> None:
    """Raise InvalidInput if the header is of a version of the format that cannot be read."""
    version = field_of(header, 'format_version', int)
    if version not in _READABLE:
        raise InvalidInput('format_version', version, ' or '.join(map(str, _READABLE)))


def check_size(n_parameters: int) -> None:
    """Raise InvalidInput if so many parameters do not fit into a controller file."""
    if n_parameters > MOST_PARAMETERS:
        expected = f'at most {MOST_PARAMETERS}: smaller hidden layers or fewer voxels'
        raise InvalidInput('parameters', n_parameters, expected)


def field_of(values: dict, name: str, kinds: type | tuple[type, ...], outer: str = '') -> Any:
    """Return a field of a header, or of its part `outer`; InvalidInput if it has another type."""
    value = values.get(name)
    if not isinstance(value, kinds) or isinstance(value, bool):
        names = kinds.__name__ if isinstance(kinds, type) else ' or '.join(
            k.__name__ for k in kinds
        )
        raise InvalidInput(f'{outer}{name}', value, f'a value of type {names}')
    return value


def body_of(header: dict) -> BodyPart:
    """Return the body part of a header; InvalidInput if one of its fields is invalid."""
    named = header['format_version'] > 1  # files of version 1 name no sensors
    return BodyPart(
        morphology_of(header, 'morphology'),
        parse_terrain(field_of(header, 'terrain', str)).name,
        Material.from_dict(field_of(header, 'material', dict)),
        Solver.from_dict(field_of(header, 'solver', dict)),
        check_sensors(field_of(header, 'sensors', list) if named else DEFAULT_SENSORS),
    )


def morphology_of(header: dict, field: str) -> Morphology:
    """Return the morphology in a field of a header; InvalidInput if it is invalid."""
    shape = field_of(header, field, dict)
    check_keys(field, shape, ('name', 'grid'))
    name = field_of(shape, 'name', str, f'{field}.')
    try:
        return replace(parse_morphology(shape.get('grid', '')), name=name)
    except InvalidInput as error:
        raise InvalidInput(f'{field}.grid', error.value, error.expected) from None


def header_of_morphology(morphology: Morphology) -> dict[str, str]:
    """Return a morphology as `morphology_of` reads it."""
    return {'name': morphology.name, 'grid': morphology.grid_string}
