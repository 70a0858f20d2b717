"""A robot whose voxels are `VoxelCore`s, over links that delay, repeat and lose without ROS.

A link hands on what a writer has said in its order; what gets lost on the way is sent again, as
reliable writers do it. When and in which order across links is up to the test.
"""

import numpy as np

from sim_node.model.morphology import parse_morphology
from sim_node.ros.actuation_buffer import Answers
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells, reset_cells
from snca_ros.controller import Controller, weights_of
from snca_ros.faults import CellFaults, Faults, VoxelFaults
from snca_ros.nodes.own_part import OwnPart
from snca_ros.nodes.voxel_core import Heard, VoxelCore

HORIZON = 1000
SQUARE = parse_morphology('11-11')  # every voxel has two neighbours


def nobody(episode):
    return False


def readings_of(actuation, step):
    """Return (n, 4) readings in [0, 1] that any wrong actuation before changes."""
    phase = np.sin(np.arange(len(actuation))[:, None] + np.arange(4) + 0.7 * step)
    return np.clip(0.5 + 0.3 * phase + 0.2 * actuation[:, None], 0.0, 1.0)


def name_of(number):
    return b'r%07x' % number


class Robot:
    """What the cells of a robot are: theta, faults, and its offline twin."""

    def __init__(self, name='U-D', model='mlp', faults=None, seed=0):
        self.architecture, self.morphology = Architecture.named(name, model), SQUARE
        self.n, self.faults = self.morphology.n_voxels, faults or Faults()
        n_parameters = self.architecture.n_parameters(self.n)
        high = 1.0 if self.architecture.spiking else 0.4  # neither silent nor saturated
        self.theta = np.random.default_rng(seed).uniform(-high, high, n_parameters)

    def part(self, i):
        weights = weights_of(self.architecture, self.theta, self.n, i)
        faults = VoxelFaults(CellFaults(self.faults, self.morphology), i)
        return OwnPart(
            self.architecture, Cells(self.architecture, weights[np.newaxis]), faults, 'reference'
        )

    def core(self, i, **options):
        directions = [d for d, j in enumerate(self.morphology.neighbors[i]) if j >= 0]
        options = {'patience': 0.0, 'real_time': False, 'horizon': HORIZON, **options}
        return VoxelCore(self.part(i), directions, **options)

    def twin(self, n_steps, afresh=()):
        """Return the (n_steps, n) actuation of the offline twin.

        Args:
            n_steps: control steps to make.
            afresh: (step, voxel) pairs: before this step the voxel's cell starts afresh.
        """
        controller = Controller(self.architecture, self.morphology, self.theta, self.faults)
        actuation, rows = np.zeros(self.n), []
        for k in range(n_steps):
            for step, i in afresh:
                if step == k:
                    said = controller.cells.state.outbox[i].copy()  # is on its way already
                    reset_cells(controller.cells.state, i, i + 1)
                    controller.cells.state.outbox[i] = said
            actuation = controller.step(readings_of(actuation, k))
            rows.append(actuation)
        return np.array(rows)


class Link:
    """What one writer has said, and how far one reader is."""

    def __init__(self):
        self.said, self.taken = [], 0

    def next(self):
        self.taken += 1
        return self.said[self.taken - 1]


class World:
    """A robot in lock-step; `events` says what may happen now.

    Attributes:
        answers: (episode, step, voxel) of each answer of a voxel, in order.
        actuation: rows of each episode so far.
        killed: (episode, step, voxel) of each kill.
    """

    def __init__(self, robot):
        self.robot = robot
        self.cores = [robot.core(i) for i in range(robot.n)]
        self.sensors = [Link() for _ in self.cores]
        self.messages = {
            (i, d): Link() for i, row in enumerate(robot.morphology.neighbors)
            for d, j in enumerate(row) if j >= 0
        }
        self.to_simulation = [Link() for _ in self.cores]
        self.answers, self.lives, self.killed = [], [0] * robot.n, []
        self.actuation = []
        self._buffer = Answers(robot.morphology.voxel_names, hold=False)
        self.reset()

    def reset(self):
        """Begin an episode."""
        self.actuation.append([])
        self._buffer.restart(0.0)
        self._send_sensors(np.zeros(self.robot.n))

    @property
    def episode(self):
        return name_of(len(self.actuation))

    @property
    def step(self):
        return len(self.actuation[-1])

    def _send_sensors(self, actuation):
        self._buffer.open_step()
        for link, readings in zip(
            self.sensors, readings_of(actuation, self.step), strict=True
        ):
            link.said.append((self.episode, self.step, readings))

    def events(self):
        """Return what may happen now, as functions: each link hands on, each voxel joins."""
        found = []
        for i, core in enumerate(self.cores):
            if self.sensors[i].taken < len(self.sensors[i].said):
                found.append(lambda i=i: self.bring_sensors(i))
            elif not core.joined:  # nothing newer has come for a while
                found.append(lambda i=i: self.join(i))
            if self.to_simulation[i].taken < len(self.to_simulation[i].said):
                found.append(lambda i=i: self.bring_actuation(i))
        for (i, d), link in self.messages.items():
            if self.cores[i].joined and link.taken < len(link.said):
                found.append(lambda i=i, d=d: self.bring_message(i, d))
        return found

    def bring_sensors(self, i):
        assert self.cores[i].hear_sensors(*self.sensors[i].next(), 0.0) is Heard.TAKEN
        self.look(i)

    def join(self, i):
        assert self.cores[i].join(nobody)
        self.look(i)

    def bring_message(self, i, d):
        self.cores[i].hear_neighbor(d, *self.messages[i, d].next())
        self.look(i)

    def bring_actuation(self, i):
        episode, step, a = self.to_simulation[i].next()
        if episode != self.episode:
            return
        self._buffer.take(i, step, a, self.step, 0.0)
        if not self._buffer.missing:
            self.actuation[-1].append(self._buffer.close_step(self.step).copy())
            self._send_sensors(self.actuation[-1][-1])

    def look(self, i):
        """Let a voxel step if it may."""
        answer = self.cores[i].answer(0.0)
        if answer is None:
            return
        self.answers.append((answer.episode, answer.step, i, self.lives[i]))
        self.to_simulation[i].said.append((answer.episode, answer.step, answer.actuation))
        for (j, d), link in self.messages.items():
            if self.robot.morphology.neighbors[j, d] == i:
                link.said.append((answer.episode, answer.step, answer.outbox))

    def may_be_killed(self, i):
        """Tell whether a voxel holds sensors of now and has not answered: its cell forgets."""
        said = self.to_simulation[i].said
        return not said or said[-1][:2] != (self.episode, self.step)

    def kill(self, i):
        """Start a voxel afresh: it is told what all have said, from the beginning."""
        self.killed.append((self.episode, self.step, i))
        self.cores[i] = self.robot.core(i)
        self.lives[i] += 1
        self.sensors[i].taken = 0
        for (j, _), link in self.messages.items():
            if j == i:
                link.taken = 0

    def finish(self, n_steps):
        """Hand on everything in turn until so many steps are made."""
        while self.step < n_steps:
            events = self.events()
            assert events, 'all wait for each other'
            for event in events:
                event()

    def expected(self, number):
        """Return what the offline twin does in an episode, by its index."""
        name = name_of(number + 1)
        afresh = [(step, i) for episode, step, i in self.killed if episode == name]
        return self.robot.twin(len(self.actuation[number]), afresh)
