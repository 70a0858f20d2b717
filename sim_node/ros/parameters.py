"""(ROS) The parameters of the simulation node: how to run, and the body and its world."""

import os
from dataclasses import dataclass
from typing import Any

from sim_node.engine import DEFAULT_ENGINE, ENGINES
from sim_node.errors import InvalidInput, check_name
from sim_node.model.body_faults import FAULTS_OF_BODY
from sim_node.model.body_file import BodyPart, load_body
from sim_node.model.constants import declared
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.sensors import DEFAULT_SENSORS
from sim_node.model.solver import Solver
from sim_node.ros.node_base import RosNode
from sim_node.simulation import Simulation


@dataclass(frozen=True)
class RunOptions:
    """How a simulation node runs; times in seconds, see the parameters of the same names."""

    duration: float
    silence_limit: float
    start_limit: float
    on_silence: str
    real_time_factor: float
    hold_limit: float
    recorders: int
    start_paused: bool


def options_of(node: RosNode) -> RunOptions:
    """Return how to run, from the parameters of a node.

    Raises:
        InvalidInput: a parameter is off.
    """
    p = node.parameter
    options = RunOptions(
        p('duration', 0.0, 'simulated time after which the node ends [s]; 0: never', 0.0, 1e6),
        p('silence_limit', 10.0, 'wall time a voxel may take to answer [s]', 0.1, 3600.0),
        p('start_limit', 60.0, 'wall time until all voxels must have answered [s]', 0.1, 3600.0),
        p('on_silence', 'stop', 'what to do about a silent voxel: stop | go_on'),
        p('real_time_factor', 0.0, 'simulated time over wall time, kept without waiting for '
          'voxels; 0: lock-step, as fast as all of them answer', 0.0, 100.0),
        p('hold_limit', 0.25, 'real time: wall time without an answer after which a voxel goes '
          'limp; until then it holds its last actuation; at least two steps [s]', 0.0, 3600.0),
        p('recorders', 0, 'recorders that must listen before step 0 is published', 0, 10),
        p('start_paused', False, 'wait for the service pause(false) or step'),
    )
    check_name('on_silence', options.on_silence, ('stop', 'go_on'), node.where())
    return options


def simulation_of(node: RosNode) -> Simulation:
    """Return the simulation that the parameters of a node describe.

    What a controller file says is the default of the parameters of the body and its world.

    Raises:
        InvalidInput: a parameter is off, or the controller file cannot be read.
    """
    p = node.parameter
    body = _body(p('controller', '', 'path of a controller file (.npz): morphology, terrain, '
                   'material, solver and sensors are its own where no parameter names another; '
                   'empty: none'), node.where())
    shape = p('morphology', body.morphology.grid_string if body else 'biped',
              'shape name or grid, e.g. biped, comb-7x2, 1111-1001')
    terrain = p('terrain', body.terrain if body else 'flat',
                'flat | hilly-h-w-seed | steppy-h-w-seed | uphill-a | ...')
    sensors = p('sensors', ','.join(body.sensors if body else DEFAULT_SENSORS),
                'what each voxel senses, names separated by commas')
    engine = p('engine', DEFAULT_ENGINE, f'physics engine: {" | ".join(ENGINES)}')
    material, solver = (body.material, body.solver) if body else (Material(), Solver())
    constants = _declared(node, 'material', material)
    how = _declared(node, 'solver', solver)
    faults = {name: p(name, *spec) for name, spec in FAULTS_OF_BODY.items()}
    try:
        return Simulation(
            parse_morphology(shape), terrain, material=Material(**constants),
            solver=Solver(**how), engine=engine,
            sensors=tuple(sensors.split(',')), **faults,
        )
    except InvalidInput as error:
        raise error.found_in(node.where()) from None


def _declared(node: RosNode, prefix: str, defaults: Material | Solver) -> dict[str, Any]:
    """Declare a parameter for each declared field of a dataclass; return their values by field."""
    values = {}
    for f in declared(defaults):
        name, default, meta = f'{prefix}.{f.name}', getattr(defaults, f.name), f.metadata
        if 'choices' in meta:
            choices = ' | '.join(str(known).lower() for known in meta['choices'])
            any_type = not all(isinstance(known, str) for known in meta['choices'])
            text = f'{meta["text"]}: {choices}'
            values[f.name] = node.parameter(name, default, text, any_type=any_type)
        else:
            if isinstance(f.default, float):  # a file may have 1 where 1.0 is meant
                default = float(default)
            text = f'{meta["text"]} [{meta["unit"] or "1"}]'
            values[f.name] = node.parameter(name, default, text, meta['low'], meta['high'])
    return values


def _body(path: str, where: str) -> BodyPart | None:
    """Return the body's part of a controller file; None if no file is given."""
    if not path:
        return None
    if not os.path.exists(path):
        expected = 'the path of a controller file (.npz), not the name of a bundled one'
        raise InvalidInput('controller', path, expected, where)
    try:
        return load_body(path)
    except InvalidInput as error:
        raise error.found_in(where) from None
