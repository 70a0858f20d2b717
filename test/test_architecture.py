"""Imports lead down, never up nor in a circle; the picture and the list of rooms are of today."""

import re
from dataclasses import replace

import pytest
from support.paths import ROOT

from docs import draw_architecture
from docs.draw_architecture import (
    PAGE,
    PICTURE,
    ROOMS,
    Module,
    allowed,
    arrows,
    picture,
    read_modules,
    refreshed,
)

LONGEST, LONGEST_TEST = 300, 500
MODULES = read_modules()
ROS = re.compile(
    r'(rclpy|\w+_msgs|\w+_srvs|rcl_interfaces|builtin_interfaces|unique_identifier_msgs|rosidl\w*'
    r'|tf2\w*|ament\w*|launch\w*)(\.|$)'
)


def up(modules: dict[str, Module]) -> set[tuple[str, str]]:
    """Return the imports that the order of rooms does not allow, as pairs of modules."""
    return {
        pair for (room, other), pairs in arrows(modules).items() if other not in allowed(room)
        for pair in pairs
    }


def circle(modules: dict[str, Module]) -> list[str]:
    """Return modules each of which imports the next, the last the first; or nothing."""
    done: set[str] = set()

    def search(name: str, way: list[str]) -> list[str]:
        if name in way:
            return way[way.index(name):]
        if name not in done:
            for other in modules[name].imports:
                if other in modules:
                    found = search(other, [*way, name])
                    if found:
                        return found
            done.add(name)
        return []

    return next(filter(None, (search(name, []) for name in modules)), [])


def ros_without_saying_so(modules: dict[str, Module]) -> dict[str, list[str]]:
    """Return the imports of ROS in modules whose docstring does not begin with (ROS)."""
    return {
        m.name: found for m in modules.values() if not m.docstring.startswith('(ROS)')
        and (found := [name for name in m.imports if ROS.match(name)])
    }


def with_import(name: str, *imports: str) -> dict[str, Module]:
    """Return the modules, one of which imports more."""
    module = MODULES[name]
    return {**MODULES, name: replace(module, imports=(*module.imports, *imports))}


def test_every_module_lies_in_one_room():
    homeless = [name for name, module in MODULES.items() if module.room is None]
    assert homeless == [], 'add these to ROOMS in docs/draw_architecture.py'
    listed = [name for room in ROOMS.values() for name in room.modules]
    assert len(set(listed)) == len(listed)
    assert {below for room in ROOMS.values() for below in room.below} <= set(ROOMS)


def test_order_of_rooms_has_no_circle():
    assert [name for name in ROOMS if name in allowed(name)] == []


def test_arrows_lead_down():
    assert up(MODULES) == set()


def test_sim_node_knows_nothing_of_snca_ros():
    assert {
        (m.name, name) for m in MODULES.values() if m.name.split('.')[0] == 'sim_node'
        for name in m.imports if name.split('.')[0] == 'snca_ros'
    } == set()


def test_no_circle():
    assert circle(MODULES) == []


def test_ros_is_imported_only_where_the_docstring_says_so():
    assert ros_without_saying_so(MODULES) == {}


def test_modules_are_short():
    long = {m.name for m in MODULES.values() if len(m.source.splitlines()) > LONGEST}
    assert long == set()


@pytest.mark.parametrize(('name', 'imported'), [
    ('snca_ros.cell.cells', 'snca_ros.controller'),
    ('snca_ros.recording.bag', 'snca_ros.comparison.page'),
    ('snca_ros.evolution.evolve', 'sim_node.ros.delivery'),
    ('sim_node.model.terrain', 'sim_node.munk2d.space'),
    ('sim_node.batched.step', 'sim_node.munk2d.space'),
    ('sim_node.errors', 'snca_ros.files'),
])
def test_an_arrow_that_turns_round_is_noticed(name, imported):
    assert up(with_import(name, imported)) == {(name, imported)}


def test_a_circle_is_noticed():
    found = circle(with_import('sim_node.model.material', 'sim_node.model.body'))
    assert {'sim_node.model.material', 'sim_node.model.body'} <= set(found)


@pytest.mark.parametrize('name', [
    'rclpy', 'rclpy.node', 'std_msgs.msg', 'std_srvs.srv', 'rcl_interfaces.msg',
])
def test_ros_in_another_file_is_noticed(name):
    assert ros_without_saying_so(with_import('snca_ros.files', name)) == {'snca_ros.files': [name]}


def test_imports_are_read_wherever_they_stand(tmp_path):
    """In functions too, of modules by name or out of their package; a version is none."""
    files = {
        'snca_ros/__init__.py': '', 'snca_ros/cli.py': 'from snca_ros import __version__, files',
        'snca_ros/files.py': 'import json\ndef f():\n    from sim_node.errors import InvalidInput',
        'sim_node/errors.py': '"""Errors.\n\nMore."""\nimport rclpy.node as n',
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    modules = read_modules(tmp_path)
    assert {name: module.imports for name, module in modules.items()} == {
        'snca_ros': (), 'snca_ros.cli': ('snca_ros.files',),
        'snca_ros.files': ('json', 'sim_node.errors'), 'sim_node.errors': ('rclpy.node',),
    }
    assert modules['sim_node.errors'].docstring == 'Errors.'
    assert arrows(modules) == {
        ('cli', 'files'): [('snca_ros.cli', 'snca_ros.files')],
        ('files', 'errors'): [('snca_ros.files', 'sim_node.errors')],
    }


def test_picture_is_drawn_from_the_imports_of_today():
    assert PICTURE.read_text() == picture(MODULES), 'make docs: architecture.svg is old'


def test_list_of_rooms_is_of_today():
    text = PAGE.read_text()
    assert text == refreshed(text, MODULES), 'make docs: architecture.md is old'
    for module in MODULES.values():
        if module.name not in draw_architecture.PACKAGES:
            assert module.docstring in text


def test_trail_of_a_reading_names_modules_and_functions_that_exist():
    text = PAGE.read_text().partition('## One reading')[2].partition('## Rooms')[0]
    paths = {name.replace('.', '/') + '.py' for name in MODULES}
    source = '\n'.join(module.source for module in MODULES.values())
    names = re.findall(r'`([\w./]+)`', text)
    assert len(names) > 20
    for name in names:
        if name.endswith('.py'):
            assert name in paths or [p for p in paths if p.endswith(f'/{name}')] or (
                (ROOT / name).exists()
            ), name
        elif not name.endswith('/') and not name.isupper():
            last = name.rpartition('.')[2]
            assert re.search(rf'^ *(def|class) {last}\b', source, re.MULTILINE) or any(
                f'/{last}.py' in path for path in paths
            ), name


def test_picture_shows_each_room_each_arrow_once_and_what_is_forbidden():
    forbidden = 'sim_node.model.terrain', 'sim_node.munk2d.space'
    drawn = picture(with_import(*forbidden))
    titles = re.findall(r'<title>(\w+) imports (\w+)(, against the order)?</title>', drawn)
    assert ('model', 'munk2d', ', against the order') in titles
    assert len(titles) == len(set(titles))
    for a, b, wrong in titles:
        assert (b in allowed(a)) == (not wrong)
    names = re.findall(r'class="name".*?>(\w+)</text>', drawn)
    assert names == [n for n in ROOMS if any(m.room == n for m in MODULES.values())]


def test_every_folder_of_the_source_is_a_room():
    folders = {p.parent.relative_to(ROOT) for p in ROOT.glob('s*_*/*/__init__.py')}
    assert len(folders) > 10
    assert {f'{".".join(folder.parts)}.*' for folder in folders} <= {
        name for room in ROOMS.values() for name in room.modules
    }


def test_tests_lie_in_the_rooms_of_what_they_test_and_do_not_import_each_other():
    test = ROOT / 'test'
    other = re.compile(r'^ *(from|import) (conftest|test|test_\w+)\b', re.MULTILINE)
    for path in test.rglob('*.py'):
        text = path.read_text()
        assert len(text.splitlines()) <= LONGEST_TEST, path
        assert not other.search(text), path
    for package in draw_architecture.PACKAGES:
        for folder in (test / package).iterdir():
            if folder.is_dir() and folder.name != '__pycache__':
                name = f'{package}.{folder.name}'
                assert name in MODULES, f'{folder} tests no room'
