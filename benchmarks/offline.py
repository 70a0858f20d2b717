"""Measures the cost of an episode, relative to Munk2D stepping the same space.

    python -m benchmarks.offline [--quick] [--json FILE]

Results are medians of CPU time over alternating rounds in one process. The cost of Munk2D alone is
that of its own damped springs (the first physics), stepped from compiled code with the rest lengths
that the cells of the episode set. The episode includes building its space, sensors, cells and rest
lengths.
"""

import statistics
import time

import numpy as np

from benchmarks.command import run_part
from sim_node.control_time import steps_in
from sim_node.model.sensing import sense_robot
from sim_node.model.solver import Solver
from sim_node.munk2d import c_functions as munk
from sim_node.munk2d.engine import read_bodies, set_rest_lengths
from sim_node.numerics.jit import compiled
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller, step_all
from snca_ros.evolution.episode import EPISODE, run_episode
from snca_ros.faults import NO_FAULTS, Faults, parse_faults

PARTS = ('reset', 'sensors', 'cells', 'actuation')
SIZES = ('worm-5x1', 'box-5x2', 'box-5x4', 'box-8x5', 'box-10x10')
CASES = [
    (shape, name, model)
    for shape in ('biped', 'comb', 'worm')
    for name, model in (('U-D', 'mlp'), ('U-nD', 'snn-h'))
]

EVERY_FAULT = (
    'loss=0.2,delay=2,death=0.3@1-3,broken_sensors=random:0.5@1,'
    'broken_actuators=random:0.5@2,sensor_noise=0.1'
)


@compiled
def bare_steps(world, actuation):
    """Step only the physics, with (n_steps, n_voxels) actuation."""
    for k in range(actuation.shape[0]):
        set_rest_lengths(world, actuation[k])
        munk.space_step(world.space, world.dt)


def actuation_of(simulation: Simulation, controller: Controller, n_steps: int) -> np.ndarray:
    """Return the (n_steps, n_voxels) actuation of an episode."""
    readings, rows = simulation.reset(), []
    controller.reset()
    for _ in range(n_steps):
        rows.append(controller.step(readings))
        readings = simulation.step(rows[-1])
    return np.array(rows)


@compiled
def sensor_steps(world, robot, n_steps):
    """Read only bodies and sensors."""
    for k in range(n_steps):
        read_bodies(world)
        sense_robot(robot, world.masses, world.area_ratios, world.touching, k)


@compiled
def cell_steps(cells, neighbors, readings, actuation, n_steps):
    """Step only the cells."""
    for k in range(n_steps):
        step_all(cells, neighbors, readings, k, actuation)


@compiled
def actuation_steps(world, actuation, n_steps):
    """Set only the rest lengths."""
    for k in range(n_steps):
        set_rest_lengths(world, actuation[k % 2])


def seconds(run, *arguments) -> float:
    """Return the CPU time of a call [s]."""
    start = time.process_time()
    run(*arguments)
    return time.process_time() - start


def measure_case(shape: str, name: str, model: str, rounds: int, duration: float) -> dict:
    """Return the costs of one case; times in microseconds per control step."""
    simulation, bare = Simulation(shape), Simulation(shape, solver=Solver(physics='first'))
    architecture = Architecture.named(name, model)
    n = simulation.morphology.n_voxels
    theta = np.random.default_rng(1).uniform(-1.0, 1.0, architecture.n_parameters(n))
    controller = Controller(architecture, simulation.morphology, theta)
    n_steps = steps_in(duration)
    changes = np.array([np.full(n, 0.5), np.full(n, -0.5)])
    motion = actuation_of(simulation, controller, n_steps)
    calls = {
        'episode': lambda: run_episode(simulation, controller, duration),
        'reset': simulation.reset,
        'bare': lambda: bare_steps(bare.world, motion),
        'sensors': lambda: sensor_steps(
            simulation.world, simulation.sensing, n_steps
        ),
        'cells': lambda: cell_steps(
            controller.cells.state, controller.neighbors, simulation.readings,
            np.empty(n), n_steps,
        ),
        'actuation': lambda: actuation_steps(simulation.world, changes, n_steps),
    }
    for call in calls.values():
        call()  # compile, or load
    taken: dict[str, list[float]] = {part: [] for part in calls}
    for _ in range(rounds):
        bare.reset()
        for part, call in calls.items():
            taken[part].append(seconds(call))
    costs = {part: statistics.median(times) / n_steps * 1e6 for part, times in taken.items()}
    ratios = [e / b for e, b in zip(taken['episode'], taken['bare'], strict=True)]
    return {
        'shape': shape, 'n_voxels': n, 'architecture': name, 'neuron_model': model,
        'episode_per_bare': statistics.median(ratios),
        'episodes_per_second': 1e6 / costs['episode'] / n_steps,
        'us_per_step': costs,
    }


def measure_faults(rounds: int, duration: float) -> float:
    """Return the cost of a biped's episode with every kind of fault, relative to one without."""

    def episode(faults: Faults):
        simulation = Simulation('biped', **faults.of_body)
        architecture = Architecture.named('U-nD', 'snn-h')
        theta = np.random.default_rng(1).uniform(-1.0, 1.0, architecture.n_parameters(10))
        controller = Controller(architecture, simulation.morphology, theta, faults)
        return lambda: run_episode(simulation, controller, duration)

    faulty, sound = episode(parse_faults(EVERY_FAULT)), episode(NO_FAULTS)
    faulty(), sound()
    return statistics.median(seconds(faulty) / seconds(sound) for _ in range(rounds))


def measure(quick: bool) -> dict:
    """Measure the paper's shapes with two types of cell, and robots of 5 to 100 voxels."""
    rounds, duration = (3, 5.0) if quick else (7, EPISODE)
    return {
        'duration': duration,
        'cases': [measure_case(*case, rounds, duration) for case in CASES],
        'faulty_per_sound': measure_faults(rounds, duration),
        'sizes': [
            measure_case(shape, 'U-nD', 'snn-h', 3, duration / 3.0) for shape in SIZES
        ],
    }


def table(results: dict) -> str:
    """Return the measurements as text."""
    lines = [
        f'Episodes of {results["duration"]:g} s, one core; shares are of bare stepping',
        'episode/bare   reset  sensors  cells  actuation   episodes/s  case',
    ]
    for case in results['cases']:
        us = case['us_per_step']
        shares = '  '.join(f'{us[part] / us["bare"]:6.3f}' for part in PARTS)
        lines.append(
            f'{case["episode_per_bare"]:12.2f}  {shares}  {case["episodes_per_second"]:11.1f}  '
            f'{case["shape"]} {case["architecture"]} {case["neuron_model"]}'
        )
    lines += ['', 'Cost per voxel and step, relative to five voxels (U-nD snn-h)',
              'voxels  episode   bare   cells  sensors   episode/bare']
    first = results['sizes'][0]
    for case in results['sizes']:
        per_voxel = [
            case['us_per_step'][part] / case['n_voxels']
            / (first['us_per_step'][part] / first['n_voxels'])
            for part in ('episode', 'bare', 'cells', 'sensors')
        ]
        lines.append(
            f'{case["n_voxels"]:6d}' + ''.join(f'{ratio:8.2f}' for ratio in per_voxel)
            + f'{case["episode_per_bare"]:14.2f}'
        )
    lines += ['', f'Biped U-nD snn-h, every kind of fault: {results["faulty_per_sound"]:.2f} '
              'times the episode without']
    return '\n'.join(lines)


if __name__ == '__main__':
    run_part(__doc__, measure, table)
