"""(ROS) A voxel as a node of its own: it hears its sensors and its neighbours, and acts.

It knows its place, its parameters and its neighbours' names, and nothing of the robot's shape.
When it steps and what it takes is decided in `voxel_core`; here are its topics, parameters, timers
and diagnostics. It publishes its message(k), then `actuation`(k).
"""

import argparse
import sys
import time

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import Image, JointState

from sim_node.control_time import stamp_of_step
from sim_node.errors import InvalidInput
from sim_node.ros import topics
from sim_node.ros.declared_parameters import declare
from sim_node.ros.delivery import link_figures
from sim_node.ros.node_base import RosNode, run_nodes
from sim_node.ros.sim_interface import ACTUATION, SENSORS
from snca_ros.faults import NO_FAULTS
from snca_ros.nodes import interfaces
from snca_ros.nodes.cell_messages import CellMessages, topic_name
from snca_ros.nodes.duplicate import Double
from snca_ros.nodes.interfaces import NeighborNames, VoxelOptions
from snca_ros.nodes.mismatch import Mismatch
from snca_ros.nodes.own_part import check_names, load_own_part
from snca_ros.nodes.voxel_core import LOOK_PERIOD, Answer, Heard, VoxelCore

_JOIN_PAUSE = 0.05  # seconds without news after which a joining voxel has heard the newest
_SWEEP_PERIOD = 0.1  # seconds between looks into the mailboxes while nobody steps
_SIMULATION_PERIOD = 0.2  # seconds between looks at whether there is a simulation


class VoxelNode(RosNode):
    """One cell: the spiking network or perceptron of one voxel."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        options = declare(self, interfaces.VOXEL, VoxelOptions(voxel=name))
        names = declare(self, interfaces.NEIGHBORS, NeighborNames()).by_direction
        faults = declare(self, interfaces.FAULTS, NO_FAULTS)
        self.check_unknown_parameters()
        self._voxel, path = options.voxel, options.controller
        self._met_simulation = False
        if options.one_walk:
            self.create_timer(_SIMULATION_PERIOD, self._end_with_simulation)
        check_names(self._voxel, names, self.where())
        self._neighbors = {d: n for d, n in enumerate(names) if n}
        part = load_own_part(path, self._voxel, faults, self.where())
        self._architecture = part.architecture
        self._core = VoxelCore(
            part, self._neighbors, patience=options.patience, real_time=options.real_time,
            horizon=topics.HISTORY,
        )
        self._mismatch = Mismatch(path, part.physics, self.get_logger().warning)
        self._make_topics()
        self._double = Double(self, self._voxel)
        self._join_timer = self.create_timer(_JOIN_PAUSE, self._join)
        # Neighbours' messages nearly always come before the sensors that they are awaited with.
        self._look_timer = self.create_timer(LOOK_PERIOD, self._try_step)
        self._look_timer.cancel()
        # Nobody may step for long: a flood would push out of the mailboxes what is needed then.
        self.create_timer(_SWEEP_PERIOD, self._take_messages)

    def _make_topics(self) -> None:
        qos, queue = topics.stream_qos(), topics.stream_qos(topics.QUEUE)
        voxel, topic = self._voxel, topic_name(self._architecture)
        self._sensors_wire = topics.sensors_format(voxel, self._architecture.sensors)
        self._actuation_wire = topics.actuation_format(voxel)
        self._messages = CellMessages(self._architecture, voxel)
        self._messages_out = self.create_publisher(Image, f'{voxel}/{topic}', qos)
        self._actuation_out = self.create_publisher(
            JointState, ACTUATION.of(voxel), qos
        )
        self._neighbor_messages, self._mailboxes = {}, {}
        for d, name in self._neighbors.items():
            self._neighbor_messages[d] = CellMessages(self._architecture, name)
            self._mailboxes[d] = self.create_mailbox(Image, f'{name}/{topic}', queue)
        self.create_subscription(
            JointState, SENSORS.of(voxel), self._on_sensors, queue, raw=True
        )

    def _on_sensors(self, data: bytes) -> None:
        try:
            episode, step, readings = topics.read_joint_state(
                self._sensors_wire, data, 0.0, 1.0
            )
            heard = self._core.hear_sensors(episode, step, readings, time.monotonic())
        except InvalidInput as error:
            self.refuse(SENSORS.of(self._voxel), error)
            return
        if heard is not Heard.TAKEN:
            self.count(heard.value)
            return
        if self._core.joining:
            self._join_timer.reset()
        self._try_step()

    def _join(self) -> None:
        """Take part from now on, at the newest step, unless another node answers."""
        if self._core.join(self._double.answers):
            self._join_timer.cancel()
            self._double.close()
            self._try_step()

    def _take_messages(self) -> None:
        for direction, take in self._mailboxes.items() if self._core.joined else ():
            for data in take():
                self._note_message(direction, data)

    def _note_message(self, direction: int, data: bytes) -> None:
        try:
            episode, step, message = self._neighbor_messages[direction].decode(data)
            fresh = self._core.hear_neighbor(direction, episode, step, message)
        except InvalidInput as error:
            self.refuse(f'{self._neighbors[direction]}/{topic_name(self._architecture)}', error)
            return
        if not fresh:
            self.count('late or repeated messages')

    def health(self) -> tuple[bytes, str]:
        """Return the state for /diagnostics, and whether the simulation has another physics."""
        level, text = self._state()
        if words := self._mismatch.words:
            return DiagnosticStatus.WARN, f'{text}; {words}'
        return level, text

    def _state(self) -> tuple[bytes, str]:
        """Return a level and a line: the step, and whom the voxel waits for."""
        core = self._core
        if core.held_back:
            return DiagnosticStatus.WARN, 'held back: another node answers for this voxel'
        if core.step < 0:
            return DiagnosticStatus.OK, 'no sensors yet'
        if quiet := core.quiet:
            return DiagnosticStatus.WARN, f'step {core.step}, silent: {self._named(quiet)}'
        if not core.unanswered:
            age = time.monotonic() - core.since
            return DiagnosticStatus.OK, f'step {core.step}, its sensors came {age:.1f} s ago'
        waiting = self._named(core.awaited) or 'nobody'
        return DiagnosticStatus.OK, f'step {core.step} waits for {waiting}'

    def _named(self, directions: list[int]) -> str:
        return ', '.join(self._neighbors[d] for d in directions)

    def figures(self) -> dict[str, int]:
        """Return what came over the links, for /diagnostics."""
        topic = topic_name(self._architecture)
        links = {SENSORS.of(self._voxel): self._core.sensors_link}
        links |= {f'{self._neighbors[d]}/{topic}': link for d, link in self._core.links.items()}
        return link_figures(links)

    def _try_step(self) -> None:
        """Step if sensors(k) and all neighbours' messages(k - 1) are here; else look again soon."""
        if not (self._core.unanswered and self._core.joined):
            return
        self._take_messages()
        now = time.monotonic()
        answer = self._core.answer(now)
        if answer is None:
            self._look_timer.timer_period_ns = int(self._core.look_period(now) * 1e9)
            self._look_timer.reset()
            return
        self._look_timer.cancel()
        for d in answer.fallen:
            self.get_logger().warning(f'{self._neighbors[d]} is silent')
        if answer.fallen:
            self.count('times a neighbour fell silent')
        self._publish(answer)

    def _publish(self, answer: Answer) -> None:
        self._mismatch.note(answer.episode)
        stamp, episode = stamp_of_step(answer.step), np.frombuffer(answer.episode, np.uint8)
        self._messages_out.publish(self._messages.encode(episode, stamp, answer.outbox))
        self._actuation_out.publish(
            self._actuation_wire.encode(stamp, position=np.array([answer.actuation]),
                                        episode=episode)
        )
        self.count('steps')

    def _end_with_simulation(self) -> None:
        there = self.count_publishers(SENSORS.of(self._voxel)) > 0
        if self._met_simulation and not there:
            self.exit_code = 0
        self._met_simulation = there or self._core.step >= 0

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
