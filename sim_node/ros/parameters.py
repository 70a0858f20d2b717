"""(ROS) The simulation and its run options from the parameters of the simulation node."""

import os
from dataclasses import replace

from sim_node.errors import InvalidInput
from sim_node.model.body_faults import FaultsOfBody
from sim_node.model.body_file import BodyPart, load_body
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from sim_node.ros import sim_interface
from sim_node.ros.declared_parameters import declare
from sim_node.ros.node_base import RosNode
from sim_node.ros.sim_interface import BodyOptions, RunOptions
from sim_node.simulation import Simulation


def options_of(node: RosNode) -> RunOptions:
    """Declare the run options as parameters of a node; return their values.

    Raises:
        InvalidInput: a parameter is invalid.
    """
    return declare(node, sim_interface.RUN, RunOptions())


def simulation_of(node: RosNode) -> Simulation:
    """Return the simulation described by the parameters of a node.

    A controller file gives the defaults of the parameters of the body and its world.

    Raises:
        InvalidInput: a parameter is invalid, or the controller file cannot be read.
    """
    options = declare(node, sim_interface.CONTROLLER, BodyOptions())
    material, solver = Material(), Solver()
    if body := _body(options.controller, node.where()):
        options = replace(
            options, morphology=body.morphology.grid_string, terrain=body.terrain,
            sensors=','.join(body.sensors),
        )
        material, solver = body.material, body.solver
    options = declare(node, sim_interface.WORLD, options)
    if options.morphology.isdecimal() and not set(options.morphology) <= {*'01'}:
        expected = """a grid in quotes, "'0111'": without them, ROS reads 0111 as the number 73"""
        raise InvalidInput('morphology', options.morphology, expected, node.where())
    material = declare(node, sim_interface.MATERIAL, material)
    solver = declare(node, sim_interface.SOLVER, solver)
    faults = declare(node, sim_interface.FAULTS, FaultsOfBody())
    try:
        return Simulation(
            parse_morphology(options.morphology), options.terrain, material=material,
            solver=solver, engine=options.engine,
            sensors=tuple(options.sensors.split(',')), **vars(faults),
        )
    except InvalidInput as error:
        raise error.found_in(node.where()) from None


def _body(path: str, where: str) -> BodyPart | None:
    """Return the description of the body in a controller file; None if no file is given."""
    if not path:
        return None
    if not os.path.exists(path):
        expected = 'the path of a controller file (.npz), not the name of a bundled one'
        raise InvalidInput('controller', path, expected, where)
    try:
        return load_body(path)
    except InvalidInput as error:
        raise error.found_in(where) from None
