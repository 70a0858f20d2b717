"""The robot's body and its world: voxels, masses and springs on a terrain, and physics engines.

This package does not depend on the controllers: it never imports `snca_ros`. The names below are
imported at their first use, to keep the import of this package fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sim_node.model.material import Material
    from sim_node.model.morphology import parse_morphology
    from sim_node.model.solver import Solver
    from sim_node.model.terrain import parse_terrain
    from sim_node.simulation import Simulation

__all__ = ['Material', 'Simulation', 'Solver', 'parse_morphology', 'parse_terrain']

_MODULES = {
    'Material': 'model.material',
    'Simulation': 'simulation',
    'Solver': 'model.solver',
    'parse_morphology': 'model.morphology',
    'parse_terrain': 'model.terrain',
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(import_module(f'{__name__}.{_MODULES[name]}'), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
