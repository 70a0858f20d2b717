"""What an episode costs beside bare Munk2D stepping of the same space: ratios first.

    python benchmarks/offline.py [--quick] [--json FILE]

Every figure is the median over rounds that take turns, in CPU time of one process. The bare cost
is that of stepping, from C to C, the space in which the episode has just been walked, as often as
the episode did; the episode includes building its space, sensors, cells and rest lengths.
"""

import argparse
import json
import statistics
import time
from pathlib import Path

import numpy as np

from sim_node import munk
from sim_node.compiled import compiled
from sim_node.simulation import Simulation, sense, set_rest_lengths
from snca_ros.cell.nca import Architecture
from snca_ros.controller import Controller, step_all
from snca_ros.evolution.locomotion import EPISODE, run_episode

CASES = [
    (shape, name, model)
    for shape in ('biped', 'comb', 'worm')
    for name, model in (('U-D', 'mlp'), ('U-nD', 'snn-h'))
]


@compiled
def bare_steps(world, n_steps):
    """Step the physics and nothing else."""
    for _ in range(n_steps):
        munk.space_step(world.space, world.dt)


@compiled
def sensor_steps(world, n_steps):
    """Read bodies and sensors and nothing else."""
    for k in range(n_steps):
        sense(world, k)


@compiled
def cell_steps(cells, neighbors, readings, actuation, n_steps):
    """Step the cells and nothing else."""
    for k in range(n_steps):
        step_all(cells, neighbors, readings, k, actuation)


@compiled
def actuation_steps(world, actuation, n_steps):
    """Set all rest lengths anew and nothing else."""
    for k in range(n_steps):
        set_rest_lengths(world, actuation[k % 2])


def seconds(run, *arguments) -> float:
    """Return the CPU time of a call [s]."""
    start = time.process_time()
    run(*arguments)
    return time.process_time() - start


def measure(shape: str, name: str, model: str, rounds: int, duration: float) -> dict:
    """Return the costs of one case; times in microseconds per control step."""
    simulation = Simulation(shape)
    architecture = Architecture.named(name, model)
    n = simulation.morphology.n_voxels
    theta = np.random.default_rng(1).uniform(-1.0, 1.0, architecture.n_parameters(n))
    controller = Controller(architecture, simulation.morphology, theta)
    n_steps = round(duration * 60)
    run_episode(simulation, controller, 0.1)
    actuation = np.array([np.full(n, 0.5), np.full(n, -0.5)])
    parts = {
        'bare': lambda: bare_steps(simulation.world, n_steps),
        'episode': lambda: run_episode(simulation, controller, duration),
        'reset': simulation.reset,
        'sensors': lambda: sensor_steps(simulation.world, n_steps),
        'cells': lambda: cell_steps(
            controller.cells.state, controller.neighbors, simulation.world.readings,
            np.empty(n), n_steps,
        ),
        'actuation': lambda: actuation_steps(simulation.world, actuation, n_steps),
    }
    order = ('episode', 'bare', 'reset', 'sensors', 'cells', 'actuation')
    for part in order:
        parts[part]()  # compile, or load
    taken: dict[str, list[float]] = {part: [] for part in order}
    for _ in range(rounds):
        for part in order:
            taken[part].append(seconds(parts[part]))
    costs = {part: statistics.median(times) / n_steps * 1e6 for part, times in taken.items()}
    ratios = [e / b for e, b in zip(taken['episode'], taken['bare'], strict=True)]
    return {
        'shape': shape, 'architecture': name, 'neuron_model': model,
        'episode_per_bare': statistics.median(ratios), 'us_per_step': costs,
    }


def main() -> None:
    """Measure all cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--quick', action='store_true', help='shorter and fewer episodes')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    args = parser.parse_args()
    rounds, duration = (3, 5.0) if args.quick else (7, EPISODE)
    print('episode/bare   share of bare: reset  sensors  cells  actuation   case')
    results = []
    for case in CASES:
        result = measure(*case, rounds, duration)
        results.append(result)
        us = result['us_per_step']
        shares = '  '.join(
            f'{us[part] / us["bare"]:7.3f}' for part in ('reset', 'sensors', 'cells', 'actuation')
        )
        print(f'{result["episode_per_bare"]:12.2f}   {"":14}{shares}   {" ".join(case)}')
    if args.json:
        args.json.write_text(json.dumps(results, indent=1))


if __name__ == '__main__':
    main()
