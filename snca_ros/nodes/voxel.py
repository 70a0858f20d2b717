"""(ROS) The voxel node: runs the cell of one voxel on its sensors and its neighbours' messages.

It knows its own name, the weights of its cell and its neighbours' names, but not the robot's shape.
`voxel_core` decides when it steps and which messages it uses; this module holds topics, parameters,
timers and diagnostics. In control step k it publishes message(k), then `actuation`(k).
"""

import argparse
import contextlib
import sys

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import DurabilityPolicy
from rclpy.subscription import Subscription
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import Image, JointState

from sim_node.errors import InvalidInput
from sim_node.ros import rcl_functions, topics
from sim_node.ros.declared_parameters import check_unknown_parameters, declare
from sim_node.ros.delivery import delivery_statistics
from sim_node.ros.node_base import BAD_INPUT, RosNode, run_nodes, take_all
from sim_node.ros.sim_interface import BEST_EFFORT, SENSORS
from sim_node.ros.simulations import Simulations
from snca_ros.faults import NO_FAULTS
from snca_ros.nodes import interfaces
from snca_ros.nodes.cell_messages import CellMessages, topic_name
from snca_ros.nodes.compiled_step import CompiledStep
from snca_ros.nodes.duplicate import DuplicateDetector
from snca_ros.nodes.interfaces import NeighborNames, VoxelOptions
from snca_ros.nodes.mismatch import PhysicsMismatch
from snca_ros.nodes.own_part import check_names, load_own_part
from snca_ros.nodes.voxel_core import POLL_PERIOD, Answer, SensorsResult, VoxelCore
from snca_ros.nodes.voxel_health import describe_voxel
from snca_ros.nodes.voxel_publishers import VoxelPublishers

_JOIN_PAUSE = 0.05  # seconds without sensors after which a joining voxel has received the newest
_SWEEP_PERIOD = 0.1  # seconds between emptyings of the mailboxes when no step is made
_SIMULATION_PERIOD = 0.2  # seconds between checks whether there is a simulation


class VoxelNode(RosNode):
    """The ROS node of one voxel."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        options = declare(self, interfaces.VOXEL, VoxelOptions(voxel=name))
        names = declare(self, interfaces.NEIGHBORS, NeighborNames()).by_direction
        faults = declare(self, interfaces.FAULTS, NO_FAULTS)
        check_unknown_parameters(self)
        self._voxel, path = options.voxel, options.controller
        self._simulations, self._simulation_seen = Simulations(self), False
        if options.one_walk:
            self.create_timer(_SIMULATION_PERIOD, self._end_with_simulation)
        check_names(self._voxel, names, self.where())
        self._neighbors = {d: n for d, n in enumerate(names) if n}
        part = load_own_part(
            path, self._voxel, faults, self.where(), options.arithmetic, options.device
        )
        self._architecture = part.architecture
        self._core = VoxelCore(
            part, self._neighbors, patience=options.patience, real_time=options.real_time,
            horizon=topics.HISTORY, simulations=self._simulations,
        )
        self._mismatch = PhysicsMismatch(path, part.physics, self.get_logger().warning)
        self._reliability = options.reliability
        self._create_topics()
        self._usual = self._compiled_step()
        self._duplicate = DuplicateDetector(self, self._voxel, self._reliability)
        self._newest: Subscription | None = None  # only while it joins late, in real time
        self._join_timer = self.create_timer(_JOIN_PAUSE, self._join)
        # Runs only while a neighbour's message or a device's answer is late.
        self._poll_timer = self.create_timer(POLL_PERIOD, self._try_step)
        self._poll_timer.cancel()
        # While no step is made, a flood of messages would push needed ones out of the mailboxes.
        self.create_timer(_SWEEP_PERIOD, self._sweep)
        self._swept_step, self._trouble = -1, ''

    def _create_topics(self) -> None:
        queue = topics.link_qos(self._reliability, topics.QUEUE)
        voxel, topic = self._voxel, topic_name(self._architecture)
        self._sensors_wire = topics.sensors_format(voxel, self._architecture.sensors)
        self._outputs = VoxelPublishers(self, voxel, self._architecture, self._reliability)
        self._neighbor_messages, self._mailboxes = {}, {}
        for d, name in self._neighbors.items():
            self._neighbor_messages[d] = CellMessages(self._architecture, name)
            self._mailboxes[d] = self.create_mailbox(Image, f'{name}/{topic}', queue)
        self.create_subscription(
            JointState, SENSORS.of(voxel), self._on_sensors, queue, raw=True
        )

    def _compiled_step(self) -> CompiledStep | None:
        """Return what makes usual steps, None if the cell or this ROS is not usual."""
        state = self._core.cell.plain_state
        if state is None or not rcl_functions.AVAILABLE:
            return None
        inputs = {
            d: (mailbox, self._neighbor_messages[d].format)
            for d, mailbox in self._mailboxes.items()
        }
        directional = self._architecture.directional
        return CompiledStep(
            state, directional, self._sensors_wire, inputs, self._outputs.formats
        )

    def _on_sensors(self, data: bytes) -> None:
        if self._usual:
            if self._usual.attempt(data):
                self._core.note_usual_step(self.listening.now())
                self.count('steps')
                return
            self._end_usual_steps()
        try:
            episode, step, readings = topics.read_joint_state(
                self._sensors_wire, data, 0.0, 1.0
            )
            result = self._core.receive_sensors(episode, step, readings, self.listening.now())
        except InvalidInput as error:
            self.refuse(SENSORS.of(self._voxel), error)
            return
        if result is not SensorsResult.ACCEPTED:
            self.count(result.value)
            if result is SensorsResult.REPEATED:
                self._outputs.repeat(episode, self._core.step)
            return
        if self._reliability == BEST_EFFORT:  # no sensors of the past arrive
            self._core.note_published(episode, step)
        self._use_sensors()

    def _use_sensors(self) -> None:
        if self._core.joining:
            self._join_timer.reset()
        if self._core.needs_newest and self._newest is None:
            self._subscribe_to_newest()
        self._try_step()

    def _end_usual_steps(self) -> None:
        """Leave the next step to `voxel_core`."""
        if self._usual:
            for direction, message in self._usual.give_back():
                self._receive_message(direction, message)

    def _sweep(self) -> None:
        """Follow another simulation if the current one is gone; empty the mailboxes.

        While no step is made, a flood of messages would push needed ones out of the mailboxes.
        """
        now = self.listening.now()
        if self._core.follow_other_simulation(now):
            self._use_sensors()
        if self._core.step == self._swept_step:
            self._end_usual_steps()
            self._take_messages()
        self._swept_step = self._core.step
        if (trouble := self._core.cell.trouble()) and trouble != self._trouble:
            self.get_logger().warning(f'the device does not answer: {trouble}')
        self._trouble = trouble
        if self._core.unanswered:
            return
        try:
            self._core.cell.poll(now)  # lets a device say hello, or finds it again
        except InvalidInput as error:
            self._refuse_device(error)

    def _subscribe_to_newest(self) -> None:
        """Subscribe to the sensors that are published from now on, besides those of the past."""
        qos = topics.link_qos(self._reliability, 1)
        qos.durability = DurabilityPolicy.VOLATILE
        self._newest = self.create_subscription(
            JointState, SENSORS.of(self._voxel), self._on_newest, qos, raw=True
        )

    def _on_newest(self, data: bytes) -> None:
        with contextlib.suppress(InvalidInput):  # `_on_sensors` refuses it
            episode, step, _ = topics.read_joint_state(self._sensors_wire, data, 0.0, 1.0)
            self._core.note_published(episode, step)

    def _join(self) -> None:
        """Take part from the newest step on, unless another node of this voxel is active."""
        if self._core.join(self._duplicate.is_active):
            self._join_timer.cancel()
            self._duplicate.close()
            self.publish_diagnostics()  # so that a bag knows each process, if it is killed soon
            if self._newest:
                self.destroy_subscription(self._newest)
            if (step := self._core.missed_step) is not None:
                self._outputs.publish_silence(self._core.episode, step)
            self._try_step()

    def _take_messages(self) -> None:
        for direction, mailbox in self._mailboxes.items() if self._core.joined else ():
            for data in take_all(mailbox):
                self._receive_message(direction, data)

    def _receive_message(self, direction: int, data: bytes) -> None:
        try:
            episode, step, message = self._neighbor_messages[direction].decode(data)
            accepted = self._core.receive_message(direction, episode, step, message)
        except InvalidInput as error:
            self.refuse(f'{self._neighbors[direction]}/{topic_name(self._architecture)}', error)
            return
        if not accepted:
            self.count('late or repeated messages')

    def health(self) -> tuple[bytes, str]:
        """Return level and text for /diagnostics: its state, and what is wrong around it."""
        now = self.listening.now()
        is_wrong, text = describe_voxel(self._core, self._neighbors, now)
        ignored = self._core.episodes.ignores(now)
        others = 'sensors of another simulation are ignored' if ignored else ''
        wrong = [part for part in (others, self._mismatch.text) if part]
        level = DiagnosticStatus.WARN if is_wrong or wrong else DiagnosticStatus.OK
        return level, '; '.join([text, *wrong])

    def statistics(self) -> dict[str, int]:
        """Return the counts of messages on time, late and lost by topic, for /diagnostics."""
        topic = topic_name(self._architecture)
        deliveries = {SENSORS.of(self._voxel): self._core.sensors_delivery}
        deliveries |= {f'{self._neighbors[d]}/{topic}': x for d, x in self._core.deliveries.items()}
        return {**delivery_statistics(deliveries), **self._core.cell.counts()}

    def _try_step(self) -> None:
        """Step if sensors(k) and all neighbours' messages(k - 1) have arrived; else poll again."""
        if not (self._core.unanswered and self._core.joined):
            return
        self._take_messages()
        now = self.listening.now()
        try:
            answer = self._core.answer(now)
        except InvalidInput as error:
            self._refuse_device(error)
            return
        if answer is None:
            self._poll_timer.timer_period_ns = int(self._core.poll_period(now) * 1e9)
            self._poll_timer.reset()
            return
        self._poll_timer.cancel()
        for d in answer.newly_silent:
            self.get_logger().warning(
                f'no message from {self._neighbors[d]}: stepping without it until one arrives'
            )
        if answer.newly_silent:
            self.count('times a neighbour fell silent')
        self._publish(answer)
        if self._core.unanswered:  # by sensors that came before the answer of a device
            self._try_step()

    def _refuse_device(self, error: InvalidInput) -> None:
        """End the process, since the device runs other firmware."""
        if self.exit_code is None:
            print(f'error: {self.get_fully_qualified_name()}: {error}', file=sys.stderr)
            self.exit_code = BAD_INPUT

    def _publish(self, answer: Answer) -> None:
        self._mismatch.check(answer.episode)
        episode, step = answer.episode, answer.step
        self._outputs.publish_message(episode, step, answer.outbox)
        self._outputs.publish_actuation(episode, step, answer.actuation)
        self.count('steps')
        if self._usual and self._core.usual and not self._outputs.keeps(step + 1):
            self._usual.prepare(episode, step, self._core.received())

    def _end_with_simulation(self) -> None:
        exists = bool(self._simulations.others())
        if self._simulation_seen and not exists:
            self.exit_code = 0
        self._simulation_seen = exists or self._core.step >= 0

    def close(self) -> None:
        """Close the line to a device; wait until the subscribers have received what was sent."""
        self._core.cell.close()
        self.wait_for_readers([publisher for publisher, _ in self._outputs.formats])


def main(argv: list[str]) -> int:
    """Run one voxel node per name on the command line; return the exit code."""
    parser = argparse.ArgumentParser(
        prog='voxel_node',
        description='Run the node of one voxel, or of several in one process.',
        epilog='Parameters are set by --ros-args; see `ros2 param list`.',
    )
    parser.add_argument(
        'name', nargs='*', default=['voxel_0_0'], help='name of a node, voxel_<x>_<y>'
    )
    names = parser.parse_args(remove_ros_args([sys.argv[0], *argv])[1:]).name
    return run_nodes(lambda: [VoxelNode(name) for name in names], argv)
