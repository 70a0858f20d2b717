"""(ROS) A voxel as a node of its own: it hears its sensors and its neighbours, and acts.

It knows its place, its parameters and its neighbours' names, and nothing of the robot's shape.
It steps when it holds `sensors`(k) and its neighbours' messages(k - 1), publishes its own
message(k), then `actuation`(k); in real time it does not wait for its neighbours, and what has
not come is silence. When the simulation starts anew or is reset, so does the voxel.
"""

import argparse
import sys
import time
from collections import deque

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import Image, JointState

from sim_node.control_time import START_STEPS, stamp_of_step
from sim_node.errors import InvalidInput
from sim_node.model.morphology import DIRECTIONS, OPPOSITE
from sim_node.ros import topics
from sim_node.ros.delivery import Link, link_figures
from sim_node.ros.node_base import RosNode, run_nodes
from snca_ros.faults import FAULTS_OF_CELLS
from snca_ros.nodes.cell_messages import CellMessages, topic_name
from snca_ros.nodes.duplicate import Double
from snca_ros.nodes.inbox import Pending
from snca_ros.nodes.mismatch import Mismatch
from snca_ros.nodes.own_part import check_names, load_own_part

_JOIN_PAUSE = 0.05  # seconds without news after which a joining voxel has heard the newest
_JOIN_LIMIT = 0.2  # seconds after the first news; in real time there is no pause
_EPISODES = 16  # past ones that are remembered
_SWEEP_PERIOD = 0.1  # seconds between looks into the mailboxes while nobody steps
_LOOK_PERIOD = 0.001  # seconds between looks for a neighbour's message that is late, at first
_LOOK_SELDOM = 0.05  # and at last: the neighbour may be dead
_QUIET = 15  # steps without a message after which diagnostics name a neighbour
_SIMULATION_PERIOD = 0.2  # seconds between looks at whether there is a simulation


class VoxelNode(RosNode):
    """One cell: the spiking network or perceptron of one voxel."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        p = self.parameter
        self._voxel = p('voxel', name, 'place of this voxel: voxel_<x>_<y>; default: its name')
        path = p('controller', '', 'controller file (.npz) to load the parameters from')
        names = [
            p(f'neighbor.{d}', '', f'name of the voxel {d} of this one; empty: none')
            for d in DIRECTIONS
        ]
        self._patience = p(
            'patience', 0.0, 'wall time to wait for a neighbour before taking it for silent '
            '[s]; 0: for ever', 0.0, 3600.0,
        )
        self._real_time = p(
            'real_time', False, 'step when sensors come, whatever neighbours have said by then'
        )
        self._met_simulation = False
        if p('one_walk', False, 'end when the simulation has come and gone'):
            self.create_timer(_SIMULATION_PERIOD, self._end_with_simulation)
        faults = {name: p(name, *spec) for name, spec in FAULTS_OF_CELLS.items()}
        self.check_unknown_parameters()
        check_names(self._voxel, names, self.where())
        self._neighbors = {d: n for d, n in enumerate(names) if n}
        part = load_own_part(path, self._voxel, faults, self.where())
        self._architecture, self._cells, self._faults = part.architecture, part.cells, part.faults
        self._mismatch = Mismatch(path, part.physics, self.get_logger().warning)
        self._make_topics()
        self._joined = self._held_back = False
        self._double = Double(self, self._voxel)
        self._join_timer = self.create_timer(_JOIN_PAUSE, self._join)
        # Neighbours' messages nearly always come before the sensors that they are awaited with.
        self._look_timer = self.create_timer(_LOOK_PERIOD, self._try_step)
        self._look_timer.cancel()
        # Nobody may step for long: a flood would push out of the mailboxes what is needed then.
        self.create_timer(_SWEEP_PERIOD, self._take_messages)
        self._episode = b''
        self._past: deque[bytes] = deque(maxlen=_EPISODES)
        self._received = {d: Pending() for d in self._neighbors}
        self._sensors_link, self._links = Link(), {d: Link() for d in self._neighbors}
        self._restart(b'')

    def _make_topics(self) -> None:
        qos, queue = topics.stream_qos(), topics.stream_qos(topics.QUEUE)
        voxel, topic = self._voxel, topic_name(self._architecture)
        self._sensors_wire = topics.sensors_format(voxel)
        self._actuation_wire = topics.actuation_format(voxel)
        self._messages = CellMessages(self._architecture, voxel)
        self._messages_out = self.create_publisher(Image, f'{voxel}/{topic}', qos)
        self._actuation_out = self.create_publisher(
            JointState, f'{voxel}/{topics.ACTUATION_TOPIC}', qos
        )
        self._neighbor_messages, self._mailboxes = {}, {}
        for d, name in self._neighbors.items():
            self._neighbor_messages[d] = CellMessages(self._architecture, name)
            self._mailboxes[d] = self.create_mailbox(Image, f'{name}/{topic}', queue)
        self.create_subscription(
            JointState, f'{voxel}/{topics.SENSORS_TOPIC}', self._on_sensors, queue, raw=True
        )

    def _restart(self, episode: bytes) -> None:
        """Start afresh: the simulation has, or was reset.

        What neighbours that noticed it first have said in the new episode is kept.
        """
        self._past.append(self._episode)
        self._episode = episode
        self._cells.reset()
        self._faults.reset()
        self._inbox = self._cells.silence()
        self._readings: np.ndarray | None = None  # sensors(k) not yet answered
        self._step = -1  # k of the newest sensors
        self._since = self._first_heard = time.monotonic()
        self._silent: set[int] = set()
        for link in (self._sensors_link, *self._links.values()):
            link.restart()

    def _on_sensors(self, data: bytes) -> None:
        try:
            episode, step, readings = topics.read_joint_state(
                self._sensors_wire, data, 0.0, 1.0
            )
            self._check_future(episode, step)
        except InvalidInput as error:
            self.refuse(f'{self._voxel}/{topics.SENSORS_TOPIC}', error)
            return
        if episode in self._past:
            self.count('sensors of a past episode')
            return
        if episode != self._episode:
            self._restart(episode)
        elif step <= self._step:
            self._sensors_link.note_late(step)
            self.count('repeated sensors')
            return
        self._sensors_link.arrive(step)
        self._step, self._readings, self._since = step, readings, time.monotonic()
        for pending in self._received.values():
            pending.turn_to(episode, step - 1)
        if not self._joined and self._since - self._first_heard < _JOIN_LIMIT:
            self._join_timer.reset()
        self._try_step()

    def _join(self) -> None:
        """Take part from now on, at the newest step.

        A node that joins late is first told the steps that others have made long ago; to answer
        those would take its neighbours back with it.
        """
        self._held_back = self._readings is not None and self._double.answers(self._episode)
        if self._readings is not None and not self._held_back:
            self._joined = True
            self._join_timer.cancel()
            self._double.close()
            self._try_step()

    def _take_messages(self) -> None:
        for direction, take in self._mailboxes.items() if self._joined else ():
            for data in take():
                self._note_message(direction, data)

    def _note_message(self, direction: int, data: bytes) -> None:
        try:
            episode, step, message = self._neighbor_messages[direction].decode(data)
            self._check_future(episode, step)
        except InvalidInput as error:
            self.refuse(f'{self._neighbors[direction]}/{topic_name(self._architecture)}', error)
            return
        if episode == self._episode:
            self._links[direction].note_late(step)
        if not self._received[direction].put(episode, step, message):
            self.count('late or repeated messages')
        self._silent.discard(direction)

    def health(self) -> tuple[bytes, str]:
        """Return the state for /diagnostics, and whether the simulation has another physics."""
        level, text = self._state()
        if words := self._mismatch.words:
            return DiagnosticStatus.WARN, f'{text}; {words}'
        return level, text

    def _state(self) -> tuple[bytes, str]:
        """Return a level and a line: the step, and whom the voxel waits for."""
        if self._held_back:
            return DiagnosticStatus.WARN, 'held back: another node answers for this voxel'
        if self._step < 0:
            return DiagnosticStatus.OK, 'no sensors yet'
        quiet = [
            self._neighbors[d] for d, link in self._links.items()
            if self._step - link.newest > _QUIET
        ]
        if quiet:
            return DiagnosticStatus.WARN, f'step {self._step}, silent: {", ".join(quiet)}'
        if self._readings is None:
            age = time.monotonic() - self._since
            return DiagnosticStatus.OK, f'step {self._step}, its sensors came {age:.1f} s ago'
        waiting = ', '.join(self._neighbors[d] for d in self._awaited()) or 'nobody'
        return DiagnosticStatus.OK, f'step {self._step} waits for {waiting}'

    def figures(self) -> dict[str, int]:
        """Return what came over the links, for /diagnostics."""
        topic = topic_name(self._architecture)
        links = {f'{self._voxel}/{topics.SENSORS_TOPIC}': self._sensors_link}
        links |= {f'{self._neighbors[d]}/{topic}': link for d, link in self._links.items()}
        return link_figures(links)

    def _check_future(self, episode: bytes, step: int) -> None:
        """Refuse a stamp further ahead than a voxel that catches up can see."""
        latest = self._step + topics.HISTORY
        if episode == self._episode and step > latest:
            raise InvalidInput('stamp', f'step {step}', f'at most step {latest}')

    def _awaited(self) -> list[int]:
        """Return the directions from which a message of the step before is still to come.

        A neighbour that has already said something later will not say it any more: it was killed
        in the middle of it, and started again.
        """
        if self._step < 1 or (self._real_time and self._step >= START_STEPS):
            return []
        return [
            d for d, said in self._received.items()
            if self._step - 1 not in said and self._step not in said and d not in self._silent
        ]

    def _try_step(self) -> None:
        """Step if sensors(k) and all neighbours' messages(k - 1) are here."""
        if self._readings is None or not self._joined:
            return
        self._take_messages()
        if waiting := self._awaited():
            waited = time.monotonic() - self._since
            period = min(max(waited / 4.0, _LOOK_PERIOD), _LOOK_SELDOM)
            self._look_timer.timer_period_ns = int(period * 1e9)
            self._look_timer.reset()
            # At first neighbours may still be looking for each other.
            patience = self._patience if self._step > START_STEPS else 10.0 * self._patience
            if not patience or waited < patience:
                return
            for d in waiting:
                self.get_logger().warning(f'{self._neighbors[d]} is silent')
            self._silent.update(waiting)
            self.count('times a neighbour fell silent')
        self._look_timer.cancel()
        self._collect()
        self._publish_step(self._readings)

    def _collect(self) -> None:
        """Move the neighbours' messages of the step before into the inbox."""
        for d, pending in self._received.items():
            message = pending.pop(self._step - 1)
            if self._step > 0:
                self._links[d].close_step(self._step - 1, message is not None)
            if message is None:
                self._inbox[d] = 0.0
            else:
                self._inbox[d] = message[OPPOSITE[d] if self._architecture.directional else 0]

    def _publish_step(self, readings: np.ndarray) -> None:
        self._mismatch.note(self._episode)
        stamp = stamp_of_step(self._step)
        heard = self._faults.hear(self._step, self._inbox)
        if self._faults.dead(self._step):
            self._cells.reset()  # limp, silent, and to start afresh
            a = 0.0
        else:
            a = self._cells.step_cell(0, readings, heard, self._step)
        self._readings = None
        episode = np.frombuffer(self._episode, np.uint8)
        self._messages_out.publish(self._messages.encode(episode, stamp, self._cells.outbox[0]))
        self._actuation_out.publish(
            self._actuation_wire.encode(stamp, position=np.array([a]), episode=episode)
        )
        self.count('steps')

    def _end_with_simulation(self) -> None:
        there = self.count_publishers(f'{self._voxel}/{topics.SENSORS_TOPIC}') > 0
        if self._met_simulation and not there:
            self.exit_code = 0
        self._met_simulation = there or self._step >= 0

    def close(self) -> None:
        """Let readers have what was published."""
        self.wait_for_readers([self._messages_out, self._actuation_out])


def main(argv: list[str]) -> int:
    """Run one voxel node, or one per name given; return the exit code."""
    parser = argparse.ArgumentParser(
        prog='voxel_node',
        description='One voxel as a ROS node, or several in one process.',
        epilog='Everything else is set by --ros-args; see `ros2 param list`.',
    )
    parser.add_argument('name', nargs='*', default=['voxel_0_0'], help='voxel_<x>_<y>')
    names = parser.parse_args(remove_ros_args([sys.argv[0], *argv])[1:]).name
    return run_nodes(lambda: [VoxelNode(name) for name in names], argv)
