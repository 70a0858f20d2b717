"""The names that `import sim_node` exports, and the modules that it imports."""

import subprocess
import sys

import pytest

import sim_node
from sim_node.simulation import Simulation


def loaded(code):
    """Return the names of the modules that a new process has loaded after `code`."""
    script = f'{code}\nimport sys\nprint(*sys.modules)'
    done = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_exported_names_are_those_of_the_modules():
    assert sim_node.Simulation is Simulation
    for name in sim_node.__all__:
        assert getattr(sim_node, name).__name__ == name
        assert name in dir(sim_node)
    with pytest.raises(AttributeError, match='Simulator'):
        sim_node.Simulator  # noqa: B018


def test_the_import_loads_few_modules():
    modules = loaded('import sim_node, sim_node.engine')
    assert not modules & {'numba', 'pymunk', 'rclpy', 'matplotlib'}


@pytest.mark.parametrize(('engine', 'other'), [('pymunk', 'batched'), ('batched', 'munk2d')])
def test_one_engine_does_not_import_the_other(engine, other):
    modules = loaded(f'from sim_node import Simulation\nSimulation("1", engine="{engine}")')
    assert not modules & {f'sim_node.{other}', f'sim_node.{other}.engine', 'rclpy'}
