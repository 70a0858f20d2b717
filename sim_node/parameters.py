"""(ROS) The body and its world from a node's parameters."""

from dataclasses import fields

from sim_node.errors import InvalidInput
from sim_node.faults import FAULTS_OF_BODY
from sim_node.material import Material
from sim_node.morphology import parse_morphology
from sim_node.ros import RosNode
from sim_node.simulation import Simulation
from sim_node.solver import ENGINES, Solver


def simulation_of(node: RosNode) -> Simulation:
    """Return the simulation that the parameters of a node describe.

    Raises:
        InvalidInput: a parameter is off.
    """
    p = node.parameter
    shape = p('morphology', 'biped', 'shape name or grid, e.g. biped, comb-7x2, 1111-1001')
    terrain = p('terrain', 'flat', 'flat | hilly-h-w-seed | steppy-h-w-seed | uphill-a | ...')
    engine = p('engine', ENGINES[0], f'physics engine: {" | ".join(ENGINES)}')
    constants = {
        f.name: p(
            f'material.{f.name}', f.default,
            f'{f.metadata["text"]} [{f.metadata["unit"] or "1"}]',
            f.metadata['low'], f.metadata['high'],
        )
        for f in fields(Material)
    }
    solver = Solver(
        substeps=p('solver.substeps', 1, 'physics steps per control step', 1, 100),
        iterations=p('solver.iterations', 10, 'sweeps of the impulse solver', 1, 1000),
        self_collision=p(
            'solver.self_collision', False, 'whether masses of the robot collide'
        ),
    )
    faults = {name: p(name, *spec) for name, spec in FAULTS_OF_BODY.items()}
    try:
        return Simulation(
            parse_morphology(shape), terrain, material=Material(**constants),
            solver=solver, engine=engine, **faults,
        )
    except InvalidInput as error:
        raise error.found_in(node.where()) from None
