"""Things found by name: lazy entries, names that are taken, and plug-ins that a process imports."""

import subprocess
import sys

import pytest

from sim_node.errors import InvalidInput
from sim_node.registry import PLUGINS, Registry


@pytest.fixture
def registry():
    return Registry('tool', {'saw': 'pathlib:Path', 'drill': int})


def test_an_entry_given_as_text_is_imported_when_it_is_needed(registry):
    assert list(registry) == ['saw', 'drill']
    assert registry['saw'].__name__ == 'Path'
    assert registry.find('drill') is int


def test_an_unknown_name_is_refused_with_the_known_ones(registry):
    known = r"a file: tool: .*saw, drill \(did you mean 'drill'\?\)"
    with pytest.raises(InvalidInput, match=known):
        registry.find('dril', 'a file')
    with pytest.raises(KeyError):
        registry['dril']
    assert registry.get('dril') is None
    with pytest.raises(InvalidInput):
        registry.find(None)


def test_a_name_is_taken_once(registry):
    registry.register('file', str)
    registry.register('file', str)
    with pytest.raises(InvalidInput, match='not taken, unlike saw, drill, file'):
        registry.register('file', bytes)
    del registry['file']
    assert 'file' not in registry


@pytest.mark.parametrize('name', ['', 'a b', 'a\n', 3, None])
def test_a_name_that_no_file_could_hold_is_refused(registry, name):
    with pytest.raises(InvalidInput, match='tool'):
        registry.register(name, str)


PLUGIN = """
from sim_node.engine import ENGINES, Engine
assert 'pymunk' in ENGINES  # a plug-in may look things up

class Nothing(Engine):
    pass

ENGINES.register('nothing', Nothing)
"""


def run(code, path, plugins):
    return subprocess.run(
        [sys.executable, '-c', code], check=False, capture_output=True, text=True, timeout=60,
        env={'PYTHONPATH': f'{path}:{":".join(p for p in sys.path if p)}', PLUGINS: plugins},
    )


def test_a_plugin_is_imported_when_something_is_looked_up(tmp_path):
    (tmp_path / 'my_engine.py').write_text(PLUGIN)
    code = 'from sim_node.engine import ENGINES; print(*ENGINES); print(ENGINES["nothing"].lanes)'
    result = run(code, tmp_path, 'my_engine')
    assert result.stdout.split('\n')[:2] == ['pymunk batched nothing', '(1,)'], result.stderr


@pytest.mark.parametrize(
    ('text', 'reason'), [('raise OSError("no")', 'OSError: no'), ('', 'No module')]
)
def test_a_plugin_that_cannot_be_imported_is_named(tmp_path, text, reason):
    if text:
        (tmp_path / 'broken.py').write_text(text)
    code = (
        'from sim_node.engine import ENGINES\nfrom sim_node.errors import InvalidInput\n'
        'try: ENGINES.find("pymunk")\nexcept InvalidInput as e: print(e)'
    )
    result = run(code, tmp_path, 'broken')
    assert f"{PLUGINS}: got 'broken'" in result.stdout, result.stderr
    assert reason in result.stdout
