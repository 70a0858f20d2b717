"""Compiles the functions that nodes use, or loads them from the cache, before they are needed."""

import numpy as np

from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells


def warm() -> None:
    """Step a robot and a cell once."""
    simulation, architecture = Simulation('11-10'), Architecture.named('U-nD', 'snn-h')
    readings = simulation.step(np.zeros(3))
    cells = Cells(architecture, np.zeros((1, architecture.n_parameters(1))))
    cells.step_cell(0, readings[0], cells.empty_inbox(), 0)
