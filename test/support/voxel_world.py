"""A robot of `VoxelCore`s without ROS, whose connections deliver messages in any order and delay.

A connection delivers the messages of a publisher in order, as a reliable publisher does. The test
decides when, and in which order across connections.
"""

import numpy as np

from sim_node.model.morphology import parse_morphology
from sim_node.ros.actuation_buffer import Answers
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells, reset_cells
from snca_ros.controller import Controller, own_parameters
from snca_ros.faults import CellFaults, Faults, VoxelFaults
from snca_ros.nodes.own_cell import LocalCell
from snca_ros.nodes.own_part import OwnPart
from snca_ros.nodes.voxel_core import SensorsResult, VoxelCore

HORIZON = 1000
SQUARE = parse_morphology('11-11')  # every voxel has two neighbours


def no_duplicate(episode):
    return False


class NoSimulations:
    """A graph in which no simulation announces itself."""

    def is_live(self, identity):
        return False

    def is_silent(self, identity):
        return False


def readings_of(actuation, step):
    """Return (n, 4) readings in [0, 1] that any wrong actuation before changes."""
    phase = np.sin(np.arange(len(actuation))[:, None] + np.arange(4) + 0.7 * step)
    return np.clip(0.5 + 0.3 * phase + 0.2 * actuation[:, None], 0.0, 1.0)


def name_of(number):
    return b'r%07x' % number


class Robot:
    """The parameters of a robot's cells, its faults and its offline twin."""

    def __init__(self, name='U-D', model='mlp', faults=None, seed=0):
        self.architecture, self.morphology = Architecture.named(name, model), SQUARE
        self.n, self.faults = self.morphology.n_voxels, faults or Faults()
        n_parameters = self.architecture.n_parameters(self.n)
        high = 1.0 if self.architecture.spiking else 0.4  # neither silent nor saturated
        self.parameters = np.random.default_rng(seed).uniform(-high, high, n_parameters)

    def part(self, i):
        weights = own_parameters(self.architecture, self.parameters, self.n, i)
        faults = VoxelFaults(CellFaults(self.faults, self.morphology), i)
        return OwnPart(
            self.architecture, LocalCell(Cells(self.architecture, weights[np.newaxis])), faults,
            'reference',
        )

    def core(self, i, **options):
        directions = [d for d, j in enumerate(self.morphology.neighbors[i]) if j >= 0]
        options = {'patience': 0.0, 'real_time': False, 'horizon': HORIZON,
                   'simulations': NoSimulations(), **options}
        return VoxelCore(self.part(i), directions, **options)

    def twin(self, n_steps, resets=()):
        """Return the (n_steps, n) actuation of the offline twin.

        Args:
            n_steps: control steps to make.
            resets: (step, voxel) pairs: the voxel's cell is reset before this step.
        """
        controller = Controller(self.architecture, self.morphology, self.parameters, self.faults)
        actuation, rows = np.zeros(self.n), []
        for k in range(n_steps):
            for step, i in resets:
                if step == k:
                    sent = controller.cells.state.outbox[i].copy()  # was published before
                    reset_cells(controller.cells.state, i, i + 1)
                    controller.cells.state.outbox[i] = sent
            actuation = controller.step(readings_of(actuation, k))
            rows.append(actuation)
        return np.array(rows)


class Connection:
    """The messages of one publisher, and how many of them one subscriber has taken."""

    def __init__(self):
        self.sent, self.taken = [], 0

    def next(self):
        self.taken += 1
        return self.sent[self.taken - 1]


class World:
    """A robot in lock-step; `events` returns what can happen next.

    Attributes:
        answers: (episode, step, voxel, number of restarts) of each answer of a voxel, in order.
        actuation: rows of each episode so far.
        killed: (episode, step, voxel) of each kill.
    """

    def __init__(self, robot):
        self.robot = robot
        self.cores = [robot.core(i) for i in range(robot.n)]
        self.sensors = [Connection() for _ in self.cores]
        self.messages = {
            (i, d): Connection() for i, row in enumerate(robot.morphology.neighbors)
            for d, j in enumerate(row) if j >= 0
        }
        self.to_simulation = [Connection() for _ in self.cores]
        self.answers, self.restarts, self.killed = [], [0] * robot.n, []
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
            link.sent.append((self.episode, self.step, readings))

    def events(self):
        """Return the possible events as functions: deliver a message, or let a voxel join."""
        found = []
        for i, core in enumerate(self.cores):
            if self.sensors[i].taken < len(self.sensors[i].sent):
                found.append(lambda i=i: self.deliver_sensors(i))
            elif not core.joined:  # no newer sensors have arrived for a while
                found.append(lambda i=i: self.join(i))
            if self.to_simulation[i].taken < len(self.to_simulation[i].sent):
                found.append(lambda i=i: self.deliver_actuation(i))
        for (i, d), link in self.messages.items():
            if self.cores[i].joined and link.taken < len(link.sent):
                found.append(lambda i=i, d=d: self.deliver_message(i, d))
        return found

    def deliver_sensors(self, i):
        assert self.cores[i].receive_sensors(*self.sensors[i].next(), 0.0) is SensorsResult.ACCEPTED
        self.step_voxel(i)

    def join(self, i):
        assert self.cores[i].join(no_duplicate)
        self.step_voxel(i)

    def deliver_message(self, i, d):
        self.cores[i].receive_message(d, *self.messages[i, d].next())
        self.step_voxel(i)

    def deliver_actuation(self, i):
        episode, step, a = self.to_simulation[i].next()
        if episode != self.episode:
            return
        self._buffer.take(i, step, a, self.step, 0.0)
        if not self._buffer.missing:
            self.actuation[-1].append(self._buffer.close_step(self.step).copy())
            self._send_sensors(self.actuation[-1][-1])

    def step_voxel(self, i):
        """Step a voxel if its inputs are complete."""
        answer = self.cores[i].answer(0.0)
        if answer is None:
            return
        self.answers.append((answer.episode, answer.step, i, self.restarts[i]))
        self.to_simulation[i].sent.append((answer.episode, answer.step, answer.actuation))
        for (j, d), link in self.messages.items():
            if self.robot.morphology.neighbors[j, d] == i:
                link.sent.append((answer.episode, answer.step, answer.outbox))

    def may_be_killed(self, i):
        """Return whether a voxel has not answered the current step: then its twin can be reset."""
        sent = self.to_simulation[i].sent
        return not sent or sent[-1][:2] != (self.episode, self.step)

    def kill(self, i):
        """Restart a voxel: it receives all messages from the first."""
        self.killed.append((self.episode, self.step, i))
        self.cores[i] = self.robot.core(i)
        self.restarts[i] += 1
        self.sensors[i].taken = 0
        for (j, _), link in self.messages.items():
            if j == i:
                link.taken = 0

    def finish(self, n_steps):
        """Deliver all messages in turn until `n_steps` steps are made."""
        while self.step < n_steps:
            events = self.events()
            assert events, 'all wait for each other'
            for event in events:
                event()

    def expected(self, number):
        """Return the actuation of the offline twin in an episode, by its index."""
        name = name_of(number + 1)
        resets = [(step, i) for episode, step, i in self.killed if episode == name]
        return self.robot.twin(len(self.actuation[number]), resets)
