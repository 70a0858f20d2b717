"""The cache's name: which sources can change what is compiled."""

from pathlib import Path

import pytest
from support.paths import ROOT

from sim_node.numerics.jit import _sources


@pytest.fixture
def house(tmp_path: Path) -> Path:
    files = {
        'sim_node/kernel.py': 'from sim_node.numerics.jit import (\n    compiled,\n)\n'
        'from sim_node.table import SIZE\n',
        'sim_node/table.py': 'from sim_node.digits import ONE\nSIZE = ONE\n',
        'sim_node/digits.py': 'ONE = 1\n',
        'snca_ros/node.py': (
            'from sim_node.numerics.jit import warm_up\nfrom snca_ros.text import A\n'
        ),
        'snca_ros/text.py': 'A = 1\n',
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return tmp_path


@pytest.mark.parametrize('name', ['kernel', 'table', 'digits'])
def test_what_compiled_code_imports_counts(house: Path, name: str) -> None:
    before = _sources(house)
    path = house / 'sim_node' / f'{name}.py'
    path.write_text(path.read_text() + '# changed\n')
    assert _sources(house) != before


@pytest.mark.parametrize('name', ['node', 'text'])
def test_what_only_calls_compiled_code_does_not(house: Path, name: str) -> None:
    before = _sources(house)
    path = house / 'snca_ros' / f'{name}.py'
    path.write_text(path.read_text() + '# changed\n')
    assert _sources(house) == before


def test_the_real_sources_hold_kernels_and_their_constants() -> None:
    sources = b'\n'.join(_sources(ROOT))
    assert b'def advance_group' in sources
    assert b'CONTROL_RATE = ' in sources
    assert b'import rclpy' not in sources
