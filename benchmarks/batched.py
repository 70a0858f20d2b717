"""Measures the cost of a robot-step in the batched engine, relative to Munk2D.

    python -m benchmarks.batched [--quick] [--json FILE]

For physics alone, it compares the robot's space in Munk2D, stepped from compiled code, with a step
of the lanes, both with the same actuation, which changes in every step. An episode includes sensors
and cells; in faulty ones, each robot has a start and faults of its own. Rounds of both engines
alternate in one process; results are medians of CPU time. It also counts the vector registers in
the assembly of the sweep, and fused multiply-adds, of which there must be none.
"""

import re
import statistics
import time
from typing import Any

import numba
import numpy as np

from benchmarks.command import run_part
from sim_node.batched.engine import Robots
from sim_node.batched.step import physics_step, sweep
from sim_node.control_time import steps_in
from sim_node.munk2d.engine import set_rest_lengths, step_physics
from sim_node.numerics.jit import compiled
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.episode_lanes import run_episodes
from snca_ros.faults import parse_faults

SHAPES = ('biped', 'comb', 'worm')
MODELS = (('U-D', 'mlp'), ('U-nD', 'snn-h'))
WIDTHS = (1, 4, 8, 16, 32)
FAULTS = (
    'loss=0.3',
    'loss=0.3,delay=1,death=0.2@2-4,sensor_noise=0.01,broken_actuators=zero:0.1@3',
)


@compiled
def munk_steps(world, gaits):
    """Step one robot of Munk2D through the first of the gaits, (n_steps, n_voxels, W)."""
    actuation = np.empty(gaits.shape[1])
    for k in range(gaits.shape[0]):
        actuation[:] = gaits[k, :, 0]
        set_rest_lengths(world, actuation)
        step_physics(world)


@compiled
def lane_steps(group, gaits):
    """Step W robots, each through its gait."""
    for k in range(gaits.shape[0]):
        group.actuation_lanes[:, 0] = gaits[k]
        physics_step(group)


def gaits(n_steps: int, n_voxels: int, width: int) -> np.ndarray:
    """Draw a sine gait of 1 Hz and random phases for each of `width` robots."""
    phase = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (n_voxels, width))
    return np.sin(2.0 * np.pi * np.arange(n_steps)[:, None, None] / 60.0 + phase)


def seconds(run, *arguments) -> float:
    """Return the CPU time of a call [s]."""
    start = time.process_time()
    run(*arguments)
    return time.process_time() - start


def new_robots(simulation: Simulation, width: int) -> Robots:
    s = simulation
    return Robots(s.morphology, s.terrain, s.material, s.solver, width)


def take_turns(reference, batched, rounds: int, per_reference: int, per_batched: int) -> dict:
    """Run both alternately, `rounds` times; return microseconds per robot-step and their ratio."""
    a, b = [], []
    reference(), batched()
    for _ in range(rounds):
        a.append(seconds(reference) / per_reference * 1e6)
        b.append(seconds(batched) / per_batched * 1e6)
    ratios = [x / y for x, y in zip(a, b, strict=True)]
    return {
        'ratio': statistics.median(ratios),
        'pymunk_us': statistics.median(a), 'batched_us': statistics.median(b),
    }


def measure_physics(shape: str, width: int, rounds: int, n_steps: int) -> dict:
    simulation = Simulation(shape)
    robots = new_robots(simulation, width)
    moves = gaits(n_steps, simulation.morphology.n_voxels, width)
    costs = take_turns(
        lambda: munk_steps(simulation.world, moves), lambda: lane_steps(robots.group, moves),
        rounds, n_steps, n_steps * width,
    )
    return {'what': 'physics', 'shape': shape, 'width': width, **costs}


def measure_episode(shape: str, name: str, model: str, rounds: int, duration: float) -> dict:
    simulation = Simulation(shape)
    robots = new_robots(simulation, 16)
    architecture = Architecture.named(name, model)
    n, n_steps = simulation.morphology.n_voxels, steps_in(duration)
    thetas = np.random.default_rng(1).uniform(-1.0, 1.0, (16, architecture.n_parameters(n)))
    controllers = [Controller(architecture, simulation.morphology, t) for t in thetas[:4]]

    def reference() -> None:
        for controller in controllers:
            run_episode(simulation, controller, duration)

    def batched() -> None:
        run_episodes(robots, architecture, simulation.morphology, thetas, duration)

    costs = take_turns(reference, batched, rounds, 4 * n_steps, 16 * n_steps)
    return {'what': f'{name} {model} episode', 'shape': shape, 'width': 16, **costs}


def measure_faulty_episode(
    shape: str, name: str, model: str, text: str, rounds: int, duration: float
) -> dict:
    """Compare faulty episodes, each with a start and faults of its own, as `assess` runs them."""
    simulation = Simulation(shape)
    morphology, terrain = simulation.morphology, simulation.terrain
    robots, architecture = new_robots(simulation, 16), Architecture.named(name, model)
    n, n_steps = morphology.n_voxels, steps_in(duration)
    thetas = np.random.default_rng(1).uniform(-1.0, 1.0, (16, architecture.n_parameters(n)))
    pushes, faults = [*range(1, 17)], [parse_faults(f'{text},seed={seed}') for seed in range(16)]

    def reference() -> None:
        for theta, push, own in zip(thetas[:4], pushes, faults, strict=False):
            robot = Simulation(morphology, terrain, push=push, **own.of_body)
            run_episode(robot, Controller(architecture, morphology, theta, own), duration)

    def batched() -> None:
        run_episodes(robots, architecture, morphology, thetas, duration, pushes, faults)

    costs = take_turns(reference, batched, rounds, 4 * n_steps, 16 * n_steps)
    return {'what': f'{name} {model} episode, {text}', 'shape': shape, 'width': 16, **costs}


def registers() -> dict:
    """Count vector registers and fused multiply-adds in the assembly of the sweep, W = 16."""
    function: Any = sweep
    anew = numba.njit(function.py_func, error_model='numpy')  # nothing cached can be inspected
    anew(new_robots(Simulation('1'), 16).group)
    assembly = '\n'.join(anew.inspect_asm().values())
    names = {kind: len(re.findall(rf'%{kind}\d+', assembly)) for kind in ('zmm', 'ymm', 'xmm')}
    return {**names, 'fused': len(re.findall(r'vfn?m(?:add|sub)', assembly))}


def measure(quick: bool) -> dict:
    """Measure all cases."""
    rounds, n_steps, duration = (3, 600, 5.0) if quick else (7, 3000, 30.0)
    results = [measure_physics(shape, 16, rounds, n_steps) for shape in SHAPES]
    results += [
        measure_episode(shape, *model, rounds, duration) for shape in SHAPES for model in MODELS
    ]
    results += [
        measure_faulty_episode('biped', *model, text, rounds, duration)
        for model in MODELS for text in FAULTS
    ]
    if not quick:
        results += [measure_physics('biped', w, rounds, n_steps) for w in WIDTHS if w != 16]
    return {'results': results, 'registers': registers()}


def table(figures: dict) -> str:
    """Return the measurements as text."""
    lines = ['pymunk / batched   us per robot-step: pymunk  batched   W   shape, what']
    for r in figures['results']:
        lines.append(
            f'{r["ratio"]:16.1f}   {"":20}{r["pymunk_us"]:8.1f} {r["batched_us"]:8.2f}'
            f'{r["width"]:5d}  {r["shape"]}, {r["what"]}'
        )
    counts = ', '.join(f'{n} {name}' for name, n in figures['registers'].items())
    return '\n'.join([*lines, f'assembly of the sweep: {counts}'])


if __name__ == '__main__':
    run_part(__doc__, measure, table)
