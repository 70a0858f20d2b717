"""(ROS) The publishers of the simulation: its state, the sensors and the applied actuation."""

from collections.abc import Sequence

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState
from visualization_msgs.msg import MarkerArray

from sim_node.control_time import CONTROL_RATE, MARKER_PERIOD, stamp_of_step
from sim_node.numerics.jit import entry_point, warm_up
from sim_node.ros import rcl_functions, topics
from sim_node.ros.clock_topic import ClockTopic
from sim_node.ros.endpoints import publish_numbers, publishers, set_episode
from sim_node.ros.sim_interface import ACTUATION, APPLIED, MARKERS, ODOMETRY, SENSORS
from sim_node.simulation import Simulation


class Broadcast:
    """The publishers of a simulation, owned by its node.

    Args:
        node: the node.
        simulation: the simulation.
        clock: name of the topic of simulated time, as for `ClockTopic`.
        reliability: of the sensors, see `topics.link_qos`.
    """

    def __init__(
        self, node: Node, simulation: Simulation, clock: str, reliability: str
    ) -> None:
        self._node, self._simulation = node, simulation
        qos = topics.stream_qos()
        self._clock = ClockTopic(node, clock)
        self.settle = self._clock.settle
        self._odometry = node.create_publisher(Odometry, ODOMETRY.name, qos)
        self._odometry_wire = topics.odometry_format(simulation.morphology.name)
        self._markers = node.create_publisher(MarkerArray, MARKERS.name, qos)
        voxels = simulation.morphology.voxel_names
        self._robot = topics.RobotMarkers(len(voxels))
        self._ground = topics.ground_markers(simulation.terrain.x, simulation.terrain.y)
        robot = node.get_namespace().strip('/') or simulation.morphology.name
        self._applied = node.create_publisher(JointState, APPLIED.name, qos)
        self._applied_wire = topics.applied_format(robot, voxels)
        of_links = topics.link_qos(reliability)
        self._sensors = [
            (node.create_publisher(JointState, SENSORS.of(voxel), of_links),
             topics.sensors_format(voxel, simulation.sensors))
            for voxel in voxels
        ]
        self._compiled = None
        if rcl_functions.AVAILABLE:
            to_voxels, formats = zip(*self._sensors, strict=True)
            self._endpoints = publishers(to_voxels, formats, ['position'] * len(voxels))
            self._compiled = warm_up('sensors', lambda: entry_point(
                publish_numbers, self._endpoints, 0, np.zeros((1, 1))
            ))
        self._episode = np.zeros(0, np.uint8)

    def begin_episode(self, episode: np.ndarray) -> None:
        """Name this episode in all messages from now on, as from `EpisodeNames`."""
        self._episode = episode
        if self._compiled:
            set_episode(self._endpoints, episode.tobytes())

    @property
    def publishers(self) -> Sequence[Publisher]:
        """Return all publishers."""
        sensors = [publisher for publisher, _ in self._sensors]
        return [self._odometry, self._markers, self._clock.publisher, self._applied, *sensors]

    def unrecorded_topics(self, recorders: int) -> list[str]:
        """Return the topics to which fewer than `recorders` recorders have subscribed."""
        if not recorders:
            return []
        names = [self._odometry.topic_name, self._applied.topic_name]
        needed = [recorders] * len(names)
        for voxel in self._simulation.morphology.voxel_names:
            for topic in (ACTUATION, SENSORS):
                names.append(self._node.resolve_topic_name(topic.of(voxel)))
        # A voxel's topics have one more subscriber: the voxel or the simulation.
        needed += [recorders + 1] * (len(names) - len(needed))
        return [
            name for name, need in zip(names, needed, strict=True)
            if self._node.count_subscribers(name) < need
        ]

    def publish_state(self) -> None:
        """Publish clock, odometry and markers of the present step."""
        simulation = self._simulation
        step = simulation.step_count
        stamp = stamp_of_step(step)
        self._clock.publish(stamp)
        self._odometry.publish(
            self._odometry_wire.encode(
                stamp,
                position=topics.upright(simulation.center),
                velocity=topics.upright(simulation.velocity),
            )
        )
        if step % MARKER_PERIOD == 0:
            world = simulation.world
            self._markers.publish(self._robot.encode(world.corners, world.area_ratios))
        if step % CONTROL_RATE == 0:  # repeated for viewers that join late
            self._markers.publish(self._ground)

    def publish_applied(self, step: int, ages: np.ndarray) -> None:
        """Publish the actuation that has moved the body in a step, just made.

        Args:
            step: the control step k.
            ages: (n_voxels,) as from `Answers.close_step`.
        """
        self._applied.publish(self._applied_wire.encode(
            stamp_of_step(step), position=self._simulation.world.actuation, effort=ages,
            episode=self._episode,
        ))

    def publish_sensors(self, readings: np.ndarray) -> None:
        """Publish each voxel's readings at the present step.

        Args:
            readings: (n_voxels, n_sensors).
        """
        if self._compiled:
            self._compiled(self._endpoints, self._simulation.step_count, readings)
            return
        stamp = stamp_of_step(self._simulation.step_count)
        for (publisher, wire), own in zip(self._sensors, readings, strict=True):
            publisher.publish(wire.encode(stamp, position=own, episode=self._episode))
