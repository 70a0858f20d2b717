"""A small controller to assess, and the command that does so."""

import numpy as np

from sim_node.simulation import Simulation
from snca_ros import cli
from snca_ros.cell.architecture import Architecture
from snca_ros.trained_controller import TrainedController


def trained_worm(seed=0):
    simulation = Simulation('worm-3x1')
    architecture = Architecture.named('U-D', 'mlp')
    theta = np.random.default_rng(seed).uniform(-1.0, 1.0, architecture.n_parameters(3))
    return TrainedController(architecture, simulation.morphology, theta)


def assess(*arguments, capsys):
    code = cli.main(['assess', *map(str, arguments)])
    return code, *capsys.readouterr()
