"""Draws the pictures of docs/concepts.md from the model: `python -m docs.concept_pictures`."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from sim_node.control_time import CONTROL_RATE
from sim_node.drawing import area_colors
from sim_node.model.body import SPRING, build_body
from sim_node.model.material import Material
from sim_node.model.morphology import OFFSETS, parse_morphology
from sim_node.model.terrain import parse_terrain
from sim_node.simulation import Simulation
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.cell.coding import F_MAX, F_MIN, NEVER, SNN_RATE, SNN_STEPS, encode, spike_period
from snca_ros.cell.models.lif import SNN, SNN_H
from snca_ros.cell.models.model import step
from snca_ros.controller_file import load_controller
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.history import read_history
from snca_ros.figures import own_style
from snca_ros.files import write_text

PICTURES = Path(__file__).parent / 'concepts'
_STYLE: Any = {'font.size': 9.0, 'svg.fonttype': 'none', 'svg.hashsalt': 'snca_ros',
          'axes.spines.top': False, 'axes.spines.right': False}
_CONTRACTED, _REST, _EXPANDED = area_colors(np.array([0.75, 1.0, 1.25]))


def draw_voxel() -> Figure:
    """Draw a voxel at rest, its masses and springs, and how far actuation moves its sides."""
    body = build_body(parse_morphology('1'), parse_terrain('flat'), Material())
    figure = Figure(figsize=(6.4, 2.6), layout='constrained')
    material = Material()
    for axes, actuation, color in zip(
        figure.subplots(1, 3), (1.0, 0.0, -1.0), (_CONTRACTED, _REST, _EXPANDED), strict=True
    ):
        side = material.actuated_side(-actuation * material.area_range)
        half, mass = side / 2, material.mass_side
        axes.add_patch(Rectangle((-half, -half), side, side, facecolor=color, edgecolor='0.6'))
        centers = np.sign(body.positions - body.positions.mean(axis=0)) * (side - mass) / 2
        for center in centers:
            corner = tuple(center - mass / 2)
            axes.add_patch(Rectangle(corner, mass, mass, facecolor='0.85', edgecolor='0.2'))
        constraints = body.constraints
        for i in np.flatnonzero(constraints.kinds == SPRING):
            (a, b), anchors = constraints.ends[i], constraints.anchors[i]
            x, y = np.stack([centers[a] + anchors[:2], centers[b] + anchors[2:]]).T
            axes.plot(x, y, color='0.1', linewidth=0.7)
        axes.set(xlim=(-2, 2), ylim=(-2, 2), aspect='equal')
        axes.set_title(f'a = {actuation:.0f}, side {side:.2f} m')
        axes.axis('off')
    return figure


def draw_robot() -> Figure:
    """Draw the biped's voxels and who hears whom."""
    morphology = parse_morphology('biped')
    figure = Figure(figsize=(6.4, 3.4), layout='constrained')
    axes = figure.subplots()
    for (x, y), name, neighbors in zip(
        morphology.squares, morphology.voxel_names, morphology.neighbors, strict=True
    ):
        axes.add_patch(Rectangle((x - 0.32, y - 0.3), 0.64, 0.6, facecolor=_REST, edgecolor='0.2'))
        axes.text(x, y, f'{name}\nits cell', ha='center', va='center', fontsize=8)
        for (dx, dy), neighbor in zip(OFFSETS, neighbors, strict=True):
            if neighbor < 0:
                continue
            start, shift = np.array([x + 0.33 * dx, y + 0.31 * dy]), 0.07 * np.array([dy, dx])
            axes.annotate(
                '', tuple(start + shift + (0.34 * dx, 0.38 * dy)), tuple(start + shift),
                arrowprops={'arrowstyle': '->', 'color': 'C0'},
            )
    axes.set(xlim=(-0.5, morphology.width - 0.5), ylim=(-0.5, morphology.height - 0.5))
    axes.axis('off')
    return figure


def draw_coding() -> Figure:
    """Draw the spike trains of some readings, as `encode` makes them."""
    figure = Figure(figsize=(6.4, 2.2), layout='constrained')
    axes = figure.subplots()
    readings, n_steps = (0.0, 0.25, 0.5, 1.0), 30
    for row, reading in enumerate(readings):
        last, steps = NEVER, []
        for first in range(0, n_steps * SNN_STEPS, SNN_STEPS):
            train, last = encode(SNN_H, reading, last, first)
            steps += [first + h for h in range(SNN_STEPS) if train >> h & 1]
        axes.eventplot(np.array(steps) / SNN_RATE, lineoffsets=row, linelengths=0.6)
    rates = [SNN_RATE / spike_period(SNN_H, r) for r in readings]
    labels = [f'r = {r:g}: {f:.1f} Hz' for r, f in zip(readings, rates, strict=True)]
    axes.set_yticks(range(len(readings)), labels)
    axes.set(xlabel='time [s]', title=f'f = r ({F_MAX:g} - {F_MIN:g}) + {F_MIN:g} Hz')
    return figure


def draw_neuron() -> Figure:
    """Draw a neuron under a regular train of spikes, without and with homeostasis."""
    figure = Figure(figsize=(6.4, 2.8), layout='constrained')
    time = np.arange(15 * SNN_STEPS)
    current = np.where(time % 3 == 0, 0.6, 0.0)
    panels = zip(figure.subplots(1, 2, sharey=True), (SNN, SNN_H), strict=True)
    for axes, model in panels:
        state = tuple(model.state.values())
        potentials, thresholds, spikes = [], [], []
        for h in time:
            thresholds.append(model.theta_0 + state[1])
            potentials.append(state[0] + current[h])
            fires, state = step(model, state, (model.theta_0,), current[h])
            spikes += [h] if fires else []
        ms = 1000 / SNN_RATE
        axes.plot(time * ms, potentials, linewidth=0.8, label='potential v')
        axes.plot(time * ms, thresholds, linewidth=1.2, label='threshold θ')
        axes.plot(np.array(spikes) * ms, np.full(len(spikes), 2.6), '|', color='0.2', label='spike')
        name = 'snn-h, with homeostasis' if model.homeostasis else 'snn'
        axes.set(xlabel='time [ms]', title=f'{name}: {len(spikes)} spikes')
    figure.axes[0].set(ylabel='[mV]')
    figure.axes[1].legend(loc='lower right', fontsize=7, framealpha=1.0)
    return figure


def draw_episode() -> Figure:
    """Draw what scores a controller: the way of its centre in one episode."""
    trained = load_controller(find_controller(DEFAULT_CONTROLLER))
    episode = run_episode(Simulation(trained.morphology), trained.controller(), 30.0)
    x = episode.centers[:, 0] - episode.centers[0, 0]
    time = np.arange(len(x)) / CONTROL_RATE
    figure = Figure(figsize=(6.4, 2.4), layout='constrained')
    way, curve = figure.subplots(1, 2)
    way.plot(time, x)
    way.plot([5.0, 30.0], [x[300], x[-1]], '--', color='0.3', linewidth=0.9)
    way.axvspan(0.0, 5.0, color='0.92')
    way.set(xlabel='time [s]', ylabel='way of the centre [m]', title='an episode, its v_x dashed')
    rows = read_history(find_controller(DEFAULT_CONTROLLER).with_suffix('.csv')).rows
    _, spent, _, median, _, best_so_far = rows.T
    curve.plot(spent, best_so_far, label='best so far')
    curve.plot(spent, median, linewidth=0.7, label='median')
    curve.set(xlabel='episodes', ylabel='v_x [m/s]', title='a run')
    curve.legend(fontsize=7)
    return figure


DRAWINGS = {
    'voxel': draw_voxel, 'robot': draw_robot, 'coding': draw_coding, 'neuron': draw_neuron,
    'episode': draw_episode,
}
"""Name of a picture to what draws it."""


def svg(name: str) -> str:
    """Return the SVG text of a picture; always the same on the same version of matplotlib."""
    with own_style(_STYLE):
        text = io.StringIO()
        metadata = dict.fromkeys(('Creator', 'Date', 'Format', 'Type'))
        DRAWINGS[name]().savefig(text, format='svg', metadata=metadata, facecolor='white')
        return text.getvalue()


if __name__ == '__main__':
    PICTURES.mkdir(exist_ok=True)
    for name in DRAWINGS:
        write_text(PICTURES / f'{name}.svg', svg(name))
