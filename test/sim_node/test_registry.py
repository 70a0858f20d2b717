"""Registries: lazy entries, names that are taken, and plug-ins."""

import subprocess
import sys

import pytest
from support.limits import LIMIT

from sim_node.errors import InvalidInput
from sim_node.registry import PLUGINS, Registry


@pytest.fixture
def registry():
    return Registry('tool', {'saw': 'pathlib:Path', 'drill': int})


def test_an_entry_given_as_a_string_is_imported_at_its_first_use(registry):
    assert list(registry) == ['saw', 'drill']
    assert registry['saw'].__name__ == 'Path'
    assert registry.find('drill') is int


def test_the_error_for_an_unknown_name_lists_the_known_ones(registry):
    known = r"a file: tool: .*saw, drill \(did you mean 'drill'\?\)"
    with pytest.raises(InvalidInput, match=known):
        registry.find('dril', 'a file')
    with pytest.raises(KeyError):
        registry['dril']
    assert registry.get('dril') is None
    with pytest.raises(InvalidInput):
        registry.find(None)


def test_a_name_has_one_entry(registry):
    registry.register('file', str)
    registry.register('file', str)
    with pytest.raises(InvalidInput, match='not taken, unlike saw, drill, file'):
        registry.register('file', bytes)
    del registry['file']
    assert 'file' not in registry


@pytest.mark.parametrize('name', ['', 'a b', 'a\n', 3, None])
def test_invalid_names_are_rejected(registry, name):
    with pytest.raises(InvalidInput, match='tool'):
        registry.register(name, str)


PLUGIN = """
from sim_node.engine import ENGINES, Engine
assert 'pymunk' in ENGINES  # a plug-in may make lookups

class Nothing(Engine):
    pass

ENGINES.register('nothing', Nothing)
"""


def run(code, path, plugins):
    return subprocess.run(
        [sys.executable, '-c', code], check=False, capture_output=True, text=True, timeout=LIMIT,
        env={'PYTHONPATH': f'{path}:{":".join(p for p in sys.path if p)}', PLUGINS: plugins},
    )


def test_a_plugin_is_imported_at_the_first_lookup(tmp_path):
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
