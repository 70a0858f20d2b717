"""Compares walks in the batched engine with those in pymunk, and pushed with unpushed starts.

    python -m benchmarks.agreement [--quick] [--json FILE]

A closed loop is chaotic: a push of 1e-6 m leads to another walk in the same engine. So the
question is whether an engine differs from pymunk by more than that. Each controller walks 30 s
on flat ground in pymunk, in pymunk with every mass moved by up to 1e-6 m at the start, and in the
batched engine. Half of the controllers are random; the other half are mutants of the bundled biped,
for shapes that it fits.
"""

import numpy as np

from benchmarks.command import run_part
from sim_node.batched.engine import WIDTH, Robots
from sim_node.simulation import Simulation
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.episode import Episode, run_episode
from snca_ros.evolution.episode_lanes import run_episodes

CASES = (
    ('biped', 'U-nD', 'snn-h'), ('comb', 'U-nD', 'snn-h'),
    ('biped', 'U-D', 'mlp'), ('worm', 'U-D', 'mlp'),
)
PARTED = 1e-3  # m


def draw_controllers(shape: str, architecture: Architecture, n: int) -> np.ndarray:
    """Return (n, n_parameters) weights, random or mutants of the bundled biped."""
    rng = np.random.default_rng(0)
    n_voxels = Simulation(shape).morphology.n_voxels
    thetas = rng.uniform(-1.0, 1.0, (n, architecture.n_parameters(n_voxels)))
    champion = load_controller(find_controller(DEFAULT_CONTROLLER))
    if architecture == champion.architecture:
        children = champion.parameters + 0.1 * rng.standard_normal(thetas.shape)
        thetas[n // 2 :] = children[n // 2 :]
    return thetas


def parting_time(a: Episode, b: Episode) -> float:
    """Return the time [s] at which two centres of mass are 1 mm apart; 30 s if never."""
    n = min(len(a.centers), len(b.centers))
    apart = np.hypot(*(a.centers[:n] - b.centers[:n]).T) > PARTED
    return float(np.argmax(apart) if apart.any() else n) / 60.0


def rank_correlation(x: np.ndarray, y: np.ndarray) -> float:
    """Return Spearman's rank correlation."""
    return float(np.corrcoef(np.argsort(np.argsort(x)), np.argsort(np.argsort(y)))[0, 1])


def measure_case(shape: str, name: str, model: str, n: int) -> dict:
    """Return how the walks of n controllers differ."""
    architecture = Architecture.named(name, model)
    thetas = draw_controllers(shape, architecture, n)
    plain, pushed = Simulation(shape), Simulation(shape, push=1)
    morphology = plain.morphology
    robots = Robots(morphology, plain.terrain, plain.material, plain.solver, WIDTH)
    walks = {
        'pymunk': [run_episode(plain, Controller(architecture, morphology, t)) for t in thetas],
        'pushed': [run_episode(pushed, Controller(architecture, morphology, t)) for t in thetas],
        'batched': [
            episode
            for i in range(0, n, WIDTH)
            for episode in run_episodes(robots, architecture, morphology, thetas[i : i + WIDTH])
        ],
    }
    v = {engine: np.array([e.velocity() for e in episodes]) for engine, episodes in walks.items()}
    result: dict = {'shape': shape, 'architecture': name, 'neuron_model': model, 'controllers': n}
    for other in ('pushed', 'batched'):
        times = [parting_time(*pair) for pair in zip(walks['pymunk'], walks[other], strict=True)]
        difference = v[other] - v['pymunk']
        result[other] = {
            'rank_correlation': rank_correlation(v['pymunk'], v[other]),
            'bias': float(difference.mean()),
            'standard_error': float(difference.std() / np.sqrt(n)),
            'parted_after_median_s': float(np.median(times)),
            'never_parted': int(np.sum(np.array(times) >= 30.0)),
        }
    return result


def measure(quick: bool) -> dict:
    """Measure all cases."""
    return {'cases': [measure_case(*case, 16 if quick else 64) for case in CASES]}


def table(results: dict) -> str:
    """Return the measurements as text."""
    lines = [
        'against pymunk: rank correlation of v_x, bias +- standard error [m/s], median time to '
        'part by 1 mm [s], walks that never do',
    ]
    for case in results['cases']:
        lines.append(f'{case["shape"]} {case["architecture"]} {case["neuron_model"]}')
        for other in ('pushed', 'batched'):
            r = case[other]
            lines.append(
                f'  {other:8}{r["rank_correlation"]:6.2f}   {r["bias"]:+.3f} +- '
                f'{r["standard_error"]:.3f}   {r["parted_after_median_s"]:5.1f}   '
                f'{r["never_parted"]} of {case["controllers"]}'
            )
    return '\n'.join(lines)


if __name__ == '__main__':
    run_part(__doc__, measure, table)
