"""Measures alternatives of the physics and prints the tables that docs/physics.md explains."""

import argparse
import time
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pymunk
from pymunk._chipmunk import ffi, lib

from sim_node.control_time import steps_in
from sim_node.model.body import LIMIT, Constraints, build_body
from sim_node.model.material import Material
from sim_node.model.physics import PHYSICS
from sim_node.model.solver import Solver
from sim_node.model.terrain import Terrain
from sim_node.munk2d import c_functions as munk
from sim_node.munk2d import engine
from sim_node.munk2d.engine import PymunkEngine
from sim_node.munk2d.pymunk_view import pymunk_view
from sim_node.munk2d.space import Space
from sim_node.simulation import Diverged, Simulation
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.episode import mean_velocity

SOLVERS = [Solver(*s) for s in ((1, 5), (1, 7), (1, 10), (1, 20), (2, 10), (4, 20), (1, 10, True))]
ROUGH = ('flat', 'hilly-1-10-0', 'steppy-1-20-0')
SHAPES = ('1', 'biped', 'comb', 'worm', '11-11', 'tripod', 'ball-5', 'box-5x5')


class Watched(Simulation):
    """A simulation whose space consists of pymunk objects."""

    backend: PymunkEngine

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.view = pymunk_view(self.backend.space)
        self.bodies = self.view.bodies


def new(shape, terrain='flat', solver=None, ground=None, lift=(0.0, 0.0), **material):
    with mock.patch.object(engine, 'Space', ground or Space):
        sim = Watched(shape, terrain, solver=solver, material=Material(**material))
    for b in sim.bodies:
        b.position += lift
    return sim


def drive(sim, seconds, signal=lambda k: 0.0, watch=lambda sim: 0.0):
    seen = []
    for k in range(steps_in(seconds)):
        sim.step(np.broadcast_to(signal(k), sim.morphology.n_voxels))
        seen.append(watch(sim))
    return np.array(seen)


def flips(sim, seed, period, binary=True, common=False):
    """Return a signal that takes new random values every `period` steps."""
    n = 1 if common else sim.morphology.n_voxels
    values = np.random.default_rng(seed).uniform(-1, 1, (1000, n))
    return lambda k: (np.sign if binary else np.array)(values[k // period])


def sine(sim, seed, rates=(0.5, 2.5)):
    """Return a travelling sine wave of random frequency (within `rates` [Hz]) and phases."""
    rng, x = np.random.default_rng(seed), np.array(sim.morphology.squares)[:, 0]
    rate, phase = rng.uniform(*rates), rng.uniform(0.3, 1.2) * x + rng.uniform(0, 0.5, len(x))
    return lambda k: np.sin(2 * np.pi * rate * k / 60 - phase)


def state(sim):
    return np.hypot(*sim.world.masses[:, 3:5].T).max(), *sim.world.area_ratios


def energy(sim):
    return sum(b.kinetic_energy for b in sim.bodies)


def depth(sim):
    """Return the depth [m] of the deepest voxel corner right of the wall below the profile."""
    x, y = sim.world.corners[sim.world.corners[:, :, 0] > sim.terrain.start].T
    return (np.interp(x, sim.terrain.x, sim.terrain.y) - y).max(initial=-9.0)


def table(text, columns):
    print(f'\n{text}\n\n| {columns} |\n|{"---|" * (columns.count("|") + 1)}')


def row(name, *cells):
    if isinstance(name, Solver):
        extra = ', self-coll.' if name.self_collision else ''
        name = f'{name.substeps} x {name.iterations}{extra}'
    texts = [c if isinstance(c, str) else f'{c:.2g}' for c in (name, *cells)]
    print('|', ' | '.join(texts), '|', flush=True)


def costs(variants, default, rounds):
    """Return CPU time relative to that of the default, as the best of alternating rounds."""
    times = np.full((rounds, len(variants)), np.inf)
    for r, i in np.ndindex(times.shape):
        sim = new('biped', **variants[i])
        signal, start = flips(sim, r, 10), time.process_time()
        drive(sim, 3, signal)
        times[r, i] = time.process_time() - start
    return times.min(axis=0) / times.min(axis=0)[default]


def swing(shape, rate, physics, slop=None, **material):
    """Return the standard deviation of areas [%] under a sine gait, from 3 s to 10 s."""
    rules = PHYSICS[physics]
    other = replace(rules, slop=rules.slop if slop is None else slop)
    with mock.patch.dict(PHYSICS, {physics: other}):
        sim = new(shape, solver=Solver(physics=physics), **material)
    phase = np.arange(sim.morphology.n_voxels)
    areas = drive(sim, 10, lambda k: np.sin(2 * np.pi * rate * k / 60 + phase),
                  lambda sim: sim.world.area_ratios.copy())
    return 100.0 * areas[180:].std(axis=0).mean()


def two_physics(quick):
    rates = (1.0, 2.5, 5.0, 8.0, 12.0, 15.0)
    table('Swing of areas [%] of the reference, and of others relative to it, by frequency [Hz]',
          'robot, physics | ' + ' | '.join(f'{rate:g}' for rate in rates))
    cases = [('first', 'first', {}), ('first, damping ratio 0.4718', 'first',
                                      {'damping_ratio': 0.4718}),
             ('reference, slop 0.02', 'reference', {'slop': 0.02}),
             ('reference, slop 0.1', 'reference', {'slop': 0.1})]
    for shape, world in (('1', {'gravity': 0.0}), ('worm', {}), ('biped', {})):
        basis = [swing(shape, rate, 'reference', **world) for rate in rates]
        row(f'{shape}, reference', *(f'{b:.1f}' for b in basis))
        for name, physics, options in cases:
            of_it = [swing(shape, rate, physics, **options, **world) for rate in rates]
            row(f'{shape}, {name}', *(f'{a / b:.3f}' for a, b in zip(of_it, basis, strict=True)))


def actuation(quick):
    table('Area ratio after 5 s at a = +1, -1; wobble and speed [m/s] of the last second',
          'solver | voxel | -1 | wobble | speed | biped | -1 | wobble | speed | within 5 % | cost')
    solvers = [Solver(s, i, c) for c in (False, True) for s in (1, 2, 4) for i in (5, 7, 10, 20)]
    cost = costs([{'solver': s} for s in solvers], 2, 3 if quick else 10)
    for solver, ratio in zip(solvers, cost, strict=True):
        cells, fine = [], True
        for shape in ('1', 'biped'):
            last = []
            for a, target in ((1.0, 0.775), (-1.0, 1.225)):
                sim = new(shape, solver=solver)
                drive(sim, 4, lambda k, a=a: a)
                seen = drive(sim, 1, lambda k, a=a: a, state)
                low, high = seen[-1, 1:].min(), seen[-1, 1:].max()
                fine &= bool(0.95 * target < low and high < 1.05 * target)
                last.append((np.ptp(seen[:, 1:], axis=0).max(), seen[:, 0].max()))
                cells.append(f'{low:.3f}..{high:.3f}')
            cells += list(np.max(last, axis=0))
        row(solver, *cells, 'yes' if fine else 'NO', f'{ratio:.2f}')


def rest(quick):
    table('Dropped: fastest mass [m/s] by time, last energy [J], drift from 5 s on [m], depth [m]',
          'solver | shape | 5 s | 10 s | 20 s | energy | drift | deepest | at last')
    for solver in SOLVERS:
        for shape in ('biped', 'comb', 'worm'):
            sim = new(shape, solver=solver)
            deep, x, v = drive(sim, 20, watch=lambda s: (depth(s), s.center[0], *state(s))).T[:3]
            row(solver, shape, *v[[299, 599, -1]], energy(sim), x[-1] - x[299], max(deep), deep[-1])


def random_sequences(quick):
    table('Random actuation, 5 s (insane: area ratio beyond 0.3..2; tangled: 0.7..1.3 3 s later)',
          'solver | sequences | not finite | insane | tangled | area | to | fastest')
    for solver in SOLVERS:
        n = (1000 if solver == Solver() else 250) // (10 if quick else 1)
        low, high, speed, after = np.full((4, n), np.nan)
        for i in range(n):
            sim = new(SHAPES[i % 8], solver=solver)
            signal = flips(sim, i, (1, 2, 3, 6, 10, 20, 30, 60)[i // 8 % 8], i % 3 > 0, i % 5 == 0)
            try:
                seen = drive(sim, 5, signal, state)
                drive(sim, 3)
            except Diverged:
                continue
            low[i], high[i], speed[i] = seen[:, 1:].min(), seen[:, 1:].max(), seen[:, 0].max()
            after[i] = np.abs(sim.world.area_ratios - 1.0).max()
        counts = n, np.isnan(low).sum(), ((low < 0.3) | (high > 2.0)).sum(), (after > 0.3).sum()
        row(solver, *map(str, counts), np.nanmin(low), np.nanmax(high), np.nanmax(speed))


def errors(sim):
    """Return widest gap [% of a mass side] and angle [degrees]; 100 if far voxels overlap."""
    joints = [j for j in sim.view.constraints if isinstance(j, pymunk.PivotJoint)]
    gaps = [j.a.local_to_world(j.anchor_a) - j.b.local_to_world(j.anchor_b) for j in joints]
    angles = [abs(j.a.angle - j.b.angle) for j in joints]
    cells, p = np.array(sim.morphology.squares), sim.world.masses[:, :2]
    far = np.repeat(np.repeat(np.abs(cells[:, None] - cells[None]).max(axis=2) > 1, 4, 0), 4, 1)
    overlap = (np.hypot(*(p[:, None] - p[None]).transpose(2, 0, 1)) < sim.material.mass_side)[far]
    gap = max(g.length for g in gaps) / sim.material.mass_side
    return 100 * gap, np.degrees(max(angles)), 100 * overlap.any()


def welds(quick):
    table('Welds: gap [% of a mass side], angle [deg]; overlap [% of steps]; afloat [%, rad/s]',
          'solver | gap | angle | overlap | energy left | spin')
    for solver in SOLVERS:
        sims = [new(s, solver=solver) for s in ('biped', 'worm', 'comb') for _ in range(4)]
        seen = [drive(s, 3, flips(s, i, (1, 3, 10, 30)[i % 4]), errors) for i, s in enumerate(sims)]
        marks = np.percentile(np.concatenate(seen)[:, :2], (50, 99, 100), axis=0).T
        left = []
        for i in range(3 if quick else 12):
            sim = new(('biped', 'comb', 'box-5x5')[i % 3], solver=solver, lift=(100.0, 200.0),
                      gravity=0.0, damping=0.0)
            drive(sim, 2, flips(sim, i, 10))
            before = energy(sim)
            drive(sim, 20)
            spin = abs(np.mean([b.angular_velocity for b in sim.bodies]))
            left.append((100 * energy(sim) / before, spin))
        row(solver, *(' / '.join(f'{m:.1f}' for m in three) for three in marks),
            np.mean(seen[8:], axis=(0, 1))[2], *np.mean(left, axis=0))


def ground_of(radius, chain=False):
    """Return a space with polygons or a chain of segments, shrunk and rounded by `radius`."""
    class Variant(Space):
        def _add_ground(self, polygons, friction, restitution):
            p = np.vstack([polygons[:, 3], polygons[-1:, 2]])
            along = np.diff(p, axis=0)
            normals = along[:, ::-1] * (-1, 1) / np.linalg.norm(along, axis=1)[:, None]
            both = np.vstack([2 * normals[:1], normals[:-1] + normals[1:], 2 * normals[-1:]])
            p = (p - 2 * radius * both / (both**2).sum(axis=1)[:, None]).tolist()
            space, body = (ffi.cast('void *', h) for h in (self.handle, self.ground))
            shapes, base = [], polygons[0, 0, 1]
            for k, (a, b) in enumerate(zip(p[:-1], p[1:], strict=True)):
                if chain:
                    shape = lib.cpSegmentShapeNew(body, a, b, radius)
                    before, after = p[max(k - 1, 0)], p[min(k + 2, len(p) - 1)]
                    lib.cpSegmentShapeSetNeighbors(shape, before, after)
                else:
                    corners = [(a[0], base), (b[0], base), b, a]
                    shape = lib.cpPolyShapeNewRaw(body, 4, corners, radius)
                lib.cpShapeSetFriction(shape, friction)
                lib.cpShapeSetElasticity(shape, restitution)
                lib.cpShapeSetFilter(shape, pymunk.ShapeFilter(categories=0b10))
                shapes.append(munk.handle(lib.cpSpaceAddShape(space, shape)))
            return np.array(shapes, dtype=np.uintp)
    return Variant


GROUNDS = {'polygons': ground_of(0.0), 'polygons, r 0.2': ground_of(0.2),
           'polygons, r 0.5': ground_of(0.5), 'segments, r 0.1': ground_of(0.1, True),
           'segments, r 0.2': ground_of(0.2, True), 'segments, r 0.5': ground_of(0.5, True)}


def slide(case, spacing, ground):
    """Push a resting robot; return its distance in 4 s and the largest loss of v_x in a step."""
    x = np.concatenate([[0.0], np.arange(10.0, 300.0, spacing), [300.0, 310.0]])
    terrain = Terrain('level', x, np.where((x < 10.0) | (x > 300.0), 100.0, 5.0))
    sim = new(case[0], terrain, ground=ground, friction=case[2])
    start = drive(sim, 3, watch=lambda s: s.center[0])[-1]
    for b in sim.bodies:
        b.velocity = (case[1], 0.0)
    v = drive(sim, 4, watch=lambda s: s.velocity[0])
    return sim.center[0] - start, -np.diff(v, prepend=case[1]).min()


def grounds(quick):
    n, h = (12, 8) if quick else (36, 128)
    cases = [(s, *c) for s in ('1', 'worm', 'biped') for c in ((5.0, 0.2), (8.0, 0.0))]
    table('Pushed over level ground, seams every 7.3 / 1 m: way relative to none; jolt [m/s]',
          f'ground | {" | ".join(f"{s}, {v:g}, {f:g}" for s, v, f in cases)} | jolt | cost')
    for name, ground in GROUNDS.items():
        runs = np.array([[slide(c, d, ground) for d in (1e3, 7.3, 1.0)] for c in cases])
        row(name, *(f'{w[1] / w[0]:.2f} / {w[2] / w[0]:.2f}' for w in runs[:, :, 0]),
            runs[:, 1:, 1].max(), f'{costs([{}, {"ground": ground}], 0, 5)[1]:.2f}')
    table(f'{h} sine gaits, 10 s: way on flat [m], change with seams every 10 m, two every 1.5 m',
          'ground | worm 3-12 Hz | 10 m | 1.5 m | biped 0.5-2.5 Hz | 10 m | 1.5 m')
    for name in ('polygons', 'polygons, r 0.2', 'segments, r 0.2', 'segments, r 0.5'):
        cells = []
        for shape, rates in (('worm', (3, 12)), ('biped', (0.5, 2.5))):
            ways = np.zeros((3, h))
            for i, seed in np.ndindex(3, h):
                terrain = ('flat', 'hilly-0-10-0', 'steppy-0-1-0')[i]
                sim = new(shape, terrain, ground=GROUNDS[name])
                x = drive(sim, 10, sine(sim, seed, rates), lambda s: s.center[0])
                ways[i, seed] = abs(x[-1] - x[0])
            changes = [f'{w.mean():+.1f} +- {w.std() / h**0.5:.1f}' for w in ways[1:] - ways[0]]
            cells += [ways[0].mean(), *changes]
        row(name, *cells)
    table(f'Deepest corner [m] ({n} dropped voxels, how many stay deeper than 0.6; gaits)',
          'ground | from 60 m | from 150 m | gaits hilly | gaits steppy')
    for name, ground in GROUNDS.items():
        cells = []
        for fall in (60, 150):
            sims = [new('1', ROUGH[i % 3], None, ground, (20.0 + i, fall)) for i in range(n)]
            deep = [drive(sim, 2 + (fall / 4.9) ** 0.5, watch=depth) for sim in sims]
            cells.append(f'{np.max(deep):.2f} ({sum(d[-1] > 0.6 for d in deep)} stay)')
        for terrain in ROUGH[1:]:
            sims = [new(s, terrain, ground=ground) for s in ('biped', 'comb', 'worm')]
            cells.append(np.max([drive(s, 30, sine(s, i), depth) for i, s in enumerate(sims)]))
        row(name, *cells)


def without_limits(*args):
    """Return a body without contraction limits."""
    body = build_body(*args)
    kept = body.constraints.kinds != LIMIT
    return replace(body, constraints=Constraints(*(column[kept] for column in body.constraints)))


def champion(quick):
    """Run the bundled biped with a cheaper solver, from starts pushed by up to 1e-6 m."""
    table('The evolved biped: v_x [m/s], mean, sd and range over pushed starts; cost of stepping',
          'solver | mean | sd | least | most | cost')
    cases = [(f'{i} iterations', Solver(1, i), build_body) for i in (3, 5, 7, 10, 20)]
    cases.append(('10, no contraction limits', Solver(), without_limits))
    trained = load_controller(find_controller(DEFAULT_CONTROLLER))
    taken = np.zeros((len(cases), 3 if quick else 24))
    speeds = np.zeros_like(taken)
    for start, i in np.ndindex(taken.T.shape):
        with mock.patch.object(engine, 'build_body', cases[i][2]):
            sim = new('biped', solver=cases[i][1])
        rng, controller = np.random.default_rng(start), trained.controller()
        for b in sim.bodies:
            b.velocity = tuple(rng.uniform(-1e-6, 1e-6, 2))
        readings, x = sim.readings.copy(), [sim.center[0]]
        begin = time.process_time()
        for _ in range(1800):
            readings = sim.step(controller.step(readings))
            x.append(sim.center[0])
        taken[i, start] = time.process_time() - begin
        speeds[i, start] = mean_velocity(np.array(x))
    cost = np.median(taken, axis=1) / np.median(taken[3])
    for (name, *_), v, ratio in zip(cases, speeds, cost, strict=True):
        row(name, *(f'{f(v):.2f}' for f in (np.mean, np.std, np.min, np.max)), f'{ratio:.2f}')


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--quick', action='store_true', help='fewer runs: two minutes, not ten')
    quick = parser.parse_args().quick
    for part in (two_physics, actuation, rest, random_sequences, welds, champion, grounds):
        part(quick)
