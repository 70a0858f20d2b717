"""What `import sim_node` gives, and what it costs."""

import subprocess
import sys

import pytest

import sim_node
from sim_node.simulation import Simulation


def loaded(code):
    """Return the names of the modules that a new process has loaded after `code`."""
    told = f'{code}\nimport sys\nprint(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', told], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_the_names_are_those_of_the_modules():
    assert sim_node.Simulation is Simulation
    for name in sim_node.__all__:
        assert getattr(sim_node, name).__name__ == name
        assert name in dir(sim_node)
    with pytest.raises(AttributeError, match='Simulator'):
        sim_node.Simulator  # noqa: B018


def test_importing_it_is_cheap():
    modules = loaded('import sim_node, sim_node.engine')
    assert not modules & {'numba', 'pymunk', 'rclpy', 'matplotlib'}


@pytest.mark.parametrize(('engine', 'other'), [('pymunk', 'batched'), ('batched', 'munk2d')])
def test_one_engine_does_not_import_the_other(engine, other):
    modules = loaded(f'from sim_node import Simulation\nSimulation("1", engine="{engine}")')
    assert not modules & {f'sim_node.{other}', f'sim_node.{other}.engine', 'rclpy'}
