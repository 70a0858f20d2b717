"""Draws the architecture from the imports: `python -m docs.draw_architecture`.

Reads every import of sim_node and snca_ros, also those inside functions, and writes
docs/architecture.svg and the list of rooms in docs/architecture.md. `ROOMS` declares which room
may import which; test/test_architecture.py holds the source, the picture and the list to it.
"""

import ast
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from docs.layered_graph import draw
from snca_ros.files import write_text

DOCS = Path(__file__).parent
ROOT = DOCS.parent
PICTURE = DOCS / 'architecture.svg'
PAGE = DOCS / 'architecture.md'
PACKAGES = ('snca_ros', 'sim_node')
_BEGIN, _END = '<!-- rooms -->\n', '<!-- end -->'


class Room(NamedTuple):
    """A group of modules, and the rooms directly below it, which it may import.

    `modules` ends with '.*' for a folder; else it names modules at the top of a package.
    """

    modules: tuple[str, ...]
    below: tuple[str, ...]
    about: str = ''


ROOMS = {
    'cli': Room(
        ('snca_ros', 'snca_ros.__main__', 'snca_ros.cli'), ('commands', 'api'),
        'The ways in: the `snca` command, `python -m snca_ros`, `import snca_ros`.',
    ),
    'commands': Room(
        ('snca_ros.commands.*',), ('graph', 'web', 'rendering', 'comparison', 'bodies'),
    ),
    'api': Room(
        ('snca_ros.api.*',), ('graph', 'web', 'rendering', 'comparison'),
        'What `import snca_ros` offers to Python.',
    ),
    'graph': Room(('snca_ros.graph.*',), ('nodes', 'web')),
    'nodes': Room(('snca_ros.nodes.*',), ('recording', 'ros', 'firmware')),
    'web': Room(('snca_ros.web.*',), ('recording',)),
    'rendering': Room(('snca_ros.rendering.*',), ('recording',)),
    'comparison': Room(('snca_ros.comparison.*',), ('campaign',)),
    'campaign': Room(('snca_ros.campaign.*',), ('assessment',)),
    'bodies': Room(('snca_ros.bodies.*',), ('assessment',)),
    'assessment': Room(('snca_ros.assessment.*',), ('recording',)),
    'recording': Room(('snca_ros.recording.*',), ('evolution',)),
    'firmware': Room(('snca_ros.firmware.*',), ('controller',)),
    'evolution': Room(('snca_ros.evolution.*',), ('controller',)),
    'controller': Room(
        (
            'snca_ros.controller', 'snca_ros.trained_controller', 'snca_ros.controller_file',
            'snca_ros.versions', 'snca_ros.bundled',
        ),
        ('cell', 'simulation', 'tasks', 'episodes'),
        'All cells of a robot, and the files that hold them.',
    ),
    'episodes': Room(
        (
            'snca_ros.faults', 'snca_ros.evolution.conditions', 'snca_ros.evolution.fault_ranges',
            'snca_ros.evolution.episode_set',
        ),
        ('files', 'model'),
        'What a candidate goes through: bodies, terrains, starts, and what can go wrong.',
    ),
    'tasks': Room(('snca_ros.evolution.tasks.*',), ('model',)),
    'cell': Room(('snca_ros.cell.*',), ('files', 'model')),
    'files': Room(
        (
            'snca_ros.files', 'snca_ros.yaml_file', 'snca_ros.figures', 'snca_ros.progress',
            'snca_ros.command_line', 'snca_ros.standard_streams', 'snca_ros.interrupts',
        ),
        ('errors',),
        'Files written whole or not at all, figures, progress of commands, errors of one line.',
    ),
    'ros': Room(('sim_node.ros.*',), ('simulation',)),
    'simulation': Room(
        ('sim_node', 'sim_node.simulation', 'sim_node.episode', 'sim_node.drawing'),
        ('munk2d', 'batched'),
        'One robot on one terrain over an engine; names of its episodes; pictures of it.',
    ),
    'munk2d': Room(('sim_node.munk2d.*',), ('engine',)),
    'batched': Room(('sim_node.batched.*',), ('engine',)),
    'engine': Room(('sim_node.engine',), ('model',), 'What an engine is, and how it is found.'),
    'model': Room(('sim_node.model.*',), ('numerics',)),
    'numerics': Room(('sim_node.numerics.*',), ('errors',)),
    'errors': Room(
        (
            'sim_node.errors', 'sim_node.registry', 'sim_node.control_time',
            'sim_node.message_layout', 'sim_node.walls',
        ),
        (),
        'What everything uses: bad input, registries, control steps as time stamps, messages as '
        'bytes, walls that were met.',
    ),
}
"""All rooms by name, from the top. A room may import those below it, directly or not.

A room whose modules do not exist yet is left out of the picture and of the list.
"""


@dataclass(frozen=True)
class Module:
    """A module of the source: its text, the first line of its docstring, what it imports."""

    name: str
    source: str
    docstring: str
    imports: tuple[str, ...]
    """Full names: a module where the imported name is one, else what it is imported from."""

    @property
    def room(self) -> str | None:
        """Return the room that lists it, or None."""
        return room_of(self.name)


def room_of(module: str) -> str | None:
    """Return the room of a module by its full name, or None where no room lists it.

    A folder inside the folder of another room can be a room of its own.
    """
    found, longest = None, ''
    for name, room in ROOMS.items():
        for listed in room.modules:
            folder = listed.removesuffix('.*')
            inside = module == folder or (listed != folder and module.startswith(f'{folder}.'))
            if inside and len(folder) > len(longest):
                found, longest = name, folder
    return found


def read_modules(root: Path = ROOT) -> dict[str, Module]:
    """Return all modules of both packages by their full names."""
    paths = {}
    for path in sorted(path for package in PACKAGES for path in (root / package).rglob('*.py')):
        parts = path.relative_to(root).with_suffix('').parts
        paths['.'.join(parts[:-1] if parts[-1] == '__init__' else parts)] = path
    modules = {}
    for name, path in paths.items():
        source = path.read_text()
        tree = ast.parse(source)
        docstring = (ast.get_docstring(tree) or '').partition('\n')[0]
        modules[name] = Module(name, source, docstring, _imports(tree, set(paths)))
    return modules


def _imports(tree: ast.Module, known: set[str]) -> tuple[str, ...]:
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = '.' * node.level + (node.module or '')
            for alias in node.names:
                full = f'{base}.{alias.name}'
                if full in known:
                    found.add(full)
                elif alias.name != '__version__':  # a number, which makes no room depend on another
                    found.add(base)
    return tuple(sorted(found))


def allowed(room: str) -> set[str]:
    """Return the rooms that a room may import: those below it, and those below these."""
    found, todo = set(), [*ROOMS[room].below]
    while todo:
        name = todo.pop()
        if name not in found:
            found.add(name)
            todo += ROOMS[name].below
    return found


def arrows(modules: dict[str, Module]) -> dict[tuple[str, str], list[tuple[str, str]]]:
    """Return the imports between rooms: (from, to) to the pairs of modules that make them."""
    found: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for module in modules.values():
        for imported in module.imports:
            room, other = module.room, modules[imported].room if imported in modules else None
            if room and other and room != other:
                found.setdefault((room, other), []).append((module.name, imported))
    return found


def picture(modules: dict[str, Module]) -> str:
    """Return the SVG text of the rooms and of the imports between them.

    An import is left out where a path of others leads to the same room. Imports that the order
    does not allow are drawn in red.
    """
    present = [name for name in ROOMS if any(m.room == name for m in modules.values())]
    pairs = arrows(modules)
    right = {pair for pair in pairs if pair[1] in allowed(pair[0])}
    wrong = set(pairs) - right
    boxes = {}
    for name in present:
        names = [m.name.split('.')[-1] for m in modules.values() if m.room == name]
        package = next(m.name for m in modules.values() if m.room == name).split('.')[0]
        skipped = ('__main__', *PACKAGES, name)
        boxes[name] = (package, [n for n in names if n not in skipped or n == 'errors'])
    return draw(boxes, _without_detours(right), wrong)


def _without_detours(pairs: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Return the pairs that no path of other pairs replaces (the transitive reduction)."""
    below: dict[str, set[str]] = {}
    for a, b in pairs:
        below.setdefault(a, set()).add(b)

    def reaches(start: str, end: str) -> bool:
        return start == end or any(reaches(n, end) for n in below.get(start, ()))

    return {
        (a, b) for a, b in pairs if not any(reaches(n, b) for n in below[a] if n != b)
    }


def listing(modules: dict[str, Module]) -> str:
    """Return the rooms from the top, each with its modules and their first lines, as Markdown."""
    parts = []
    for name, room in ROOMS.items():
        inside = [m for m in modules.values() if m.room == name]
        if not inside:
            continue
        folder = room.modules[0].removesuffix('.*')
        has_folder = folder != room.modules[0] and folder in modules
        place = folder if has_folder else inside[0].name.split('.')[0]
        about = modules[folder].docstring if has_folder else room.about
        below = f'Directly below: {", ".join(room.below)}.' if room.below else ''
        rows = [
            f'| `{m.name.removeprefix(place)[1:]}` | {m.docstring} |'
            for m in inside if m.name not in (place, *PACKAGES)
        ]
        head = f'### {name}\n\n`{place.replace(".", "/")}/`: {about} {below}'.rstrip()
        parts.append('\n'.join([head, '', '| module | |', '|---|---|', *rows]))
    return '\n\n'.join(parts) + '\n'


def refreshed(text: str, modules: dict[str, Module]) -> str:
    """Return the page with the list of rooms of today."""
    before, _, rest = text.partition(_BEGIN)
    return f'{before}{_BEGIN}\n{listing(modules)}\n{_END}{rest.partition(_END)[2]}'


if __name__ == '__main__':
    source = read_modules()
    write_text(PICTURE, picture(source))
    write_text(PAGE, refreshed(PAGE.read_text(), source))
