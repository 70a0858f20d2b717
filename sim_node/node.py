"""(ROS) The simulation node: publishes each voxel's sensors, applies each voxel's actuation.

Lock-step: it publishes `sensors`(k), waits until every voxel has answered with `actuation`(k),
steps the physics and goes on with k + 1. It never computes a control signal itself.
"""

import time
from dataclasses import fields
from functools import partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from sim_node import interface
from sim_node.compiled import warm_up
from sim_node.errors import InvalidInput
from sim_node.faults import FAULTS_OF_BODY
from sim_node.material import Material
from sim_node.morphology import parse_morphology
from sim_node.ros import RosNode, run_nodes
from sim_node.simulation import Diverged, Simulation
from sim_node.solver import ENGINES, Solver
from sim_node.stamps import CONTROL_RATE, stamp_of_step

_MARKER_PERIOD = 2  # control steps: 30 Hz of simulated time
_FAILED = 1


class SimNode(RosNode):
    """One robot's body in its world, as a ROS node."""

    def __init__(self) -> None:
        super().__init__('sim_node')
        self.simulation = self._simulation_from_parameters()
        p = self.parameter
        self._duration = p(
            'duration', 0.0, 'simulated time after which the node ends [s]; 0: never', 0.0, 1e6
        )
        self._silence_limit = p(
            'silence_limit', 10.0, 'wall time a voxel may take to answer [s]', 0.1, 3600.0
        )
        self._start_limit = p(
            'start_limit', 60.0, 'wall time until all voxels must have answered [s]', 0.1, 3600.0
        )
        self._on_silence = p(
            'on_silence', 'stop', 'what to do about a silent voxel: stop | go_on'
        )
        self._recorders = p(
            'recorders', 0, 'recorders that must listen before step 0 is published', 0, 10
        )
        self._paused = p('start_paused', False, 'wait for the service pause(false) or step')
        self.check_unknown_parameters()
        if self._on_silence not in ('stop', 'go_on'):
            raise InvalidInput('on_silence', self._on_silence, 'stop or go_on', self._where())
        self._voxels = self.simulation.morphology.voxel_names
        warm_up('simulation', lambda: self.simulation.step(np.zeros(len(self._voxels))))
        self._make_topics()
        self._make_services()
        self._silent: set[str] = set()
        self._begun = False
        self._to_make: int | None = None
        self._waiting_since = time.monotonic()
        self._actuation = np.zeros(len(self._voxels))
        self._awaited: dict[int, str] = {}  # voxels that have not acted at this step
        self.create_timer(0.25, self._watch)
        if self._recorders:
            self._start_timer = self.create_timer(0.02, self._begin_if_recorded)
        else:
            self._begin()

    def _simulation_from_parameters(self) -> Simulation:
        p = self.parameter
        shape = p('morphology', 'biped', 'shape name or grid, e.g. biped, comb-7x2, 1111-1001')
        terrain = p('terrain', 'flat', 'flat | hilly-h-w-seed | steppy-h-w-seed | uphill-a | ...')
        engine = p('engine', ENGINES[0], f'physics engine: {" | ".join(ENGINES)}')
        constants = {
            f.name: p(
                f'material.{f.name}', f.default,
                f'{f.metadata["text"]} [{f.metadata["unit"] or "1"}]',
                f.metadata['low'], f.metadata['high'],
            )
            for f in fields(Material)
        }
        solver = Solver(
            substeps=p('solver.substeps', 1, 'physics steps per control step', 1, 100),
            iterations=p('solver.iterations', 10, 'sweeps of the impulse solver', 1, 1000),
            self_collision=p(
                'solver.self_collision', False, 'whether masses of the robot collide'
            ),
        )
        faults = {name: p(name, *spec) for name, spec in FAULTS_OF_BODY.items()}
        try:
            return Simulation(
                parse_morphology(shape), terrain, material=Material(**constants),
                solver=solver, engine=engine, **faults,
            )
        except InvalidInput as error:
            raise error.found_in(self._where()) from None

    def _make_topics(self) -> None:
        qos = interface.stream_qos()
        self._clock_out = self.create_publisher(Clock, '/clock', qos)
        self._clock_wire = interface.clock_format()
        self._odometry_out = self.create_publisher(Odometry, 'odometry', qos)
        self._odometry_wire = interface.odometry_format(self.simulation.morphology.name)
        self._markers_out = self.create_publisher(MarkerArray, 'markers', qos)
        self._robot_markers = interface.RobotMarkers(len(self._voxels))
        self._sensors_out = []
        self._actuation_wires = []
        for i, voxel in enumerate(self._voxels):
            publisher = self.create_publisher(
                JointState, f'{voxel}/{interface.SENSORS_TOPIC}', qos
            )
            self._sensors_out.append((publisher, interface.sensors_format(voxel)))
            self._actuation_wires.append(interface.actuation_format(voxel))
            self.create_subscription(
                JointState, f'{voxel}/{interface.ACTUATION_TOPIC}',
                partial(self._on_actuation, i), interface.stream_qos(interface.QUEUE), raw=True,
            )
        terrain = self.simulation.terrain
        self._ground = interface.ground_markers(terrain.x, terrain.y)

    def _make_services(self) -> None:
        self.create_service(Trigger, 'reset', self._serve_reset)
        self.create_service(SetBool, 'pause', self._serve_pause)
        self.create_service(Trigger, 'step', self._serve_step)

    def _begin_if_recorded(self) -> None:
        """Begin as soon as every recorder listens to all that will be said."""
        topics = [self._odometry_out.topic_name]
        for voxel in self._voxels:
            topics += [self.resolve_topic_name(f'{voxel}/{interface.ACTUATION_TOPIC}'),
                       self.resolve_topic_name(f'{voxel}/{interface.SENSORS_TOPIC}')]
        # Every voxel topic has a listener besides: the voxel, or this node.
        needed = [self._recorders] + [self._recorders + 1] * (len(topics) - 1)
        heard = [self.count_subscribers(topic) for topic in topics]
        if all(have >= need for have, need in zip(heard, needed, strict=True)):
            self._start_timer.cancel()
            self._begin()
        elif time.monotonic() - self._waiting_since > self._start_limit:
            missing = [t for t, have, need in zip(topics, heard, needed, strict=True)
                       if have < need]
            self.get_logger().error(
                f'within {self._start_limit:g} s too few nodes listen to: {", ".join(missing)}'
            )
            self.exit_code = _FAILED

    def _begin(self) -> None:
        """Put the robot down, expect every voxel again, and publish step 0."""
        self._episode = interface.new_episode()
        self._begun, self._to_make = True, None
        self._silent.clear()
        self._readings = self.simulation.reset()
        self._publish_step()

    def _publish_step(self) -> None:
        """Publish the state at the present step and start to wait for actuation."""
        simulation = self.simulation
        self._awaited = dict(enumerate(self._voxels))
        self._actuation = np.zeros(len(self._voxels))
        self._waiting_since = time.monotonic()
        stamp = stamp_of_step(simulation.step_count)
        self._clock_out.publish(self._clock_wire.encode(stamp))
        self._odometry_out.publish(
            self._odometry_wire.encode(
                stamp,
                position=interface.upright(simulation.center),
                velocity=interface.upright(simulation.velocity),
            )
        )
        if simulation.step_count % _MARKER_PERIOD == 0:
            world = simulation.world
            self._markers_out.publish(
                self._robot_markers.encode(world.corners, world.area_ratios)
            )
        if simulation.step_count % CONTROL_RATE == 0:  # again and again, for viewers that come late
            self._markers_out.publish(self._ground)
        if self._duration and simulation.step_count >= self._duration * CONTROL_RATE:
            self._finish()
            return
        for (publisher, wire), readings in zip(self._sensors_out, self._readings, strict=True):
            publisher.publish(wire.encode(stamp, position=readings, episode=self._episode))

    def _on_actuation(self, i: int, data: bytes) -> None:
        voxel = self._voxels[i]
        step = self.simulation.step_count
        try:
            episode, sent, a = interface.read_joint_state(
                self._actuation_wires[i], data, -1.0, 1.0
            )
            mine = self._begun and episode == self._episode.tobytes()
            if mine and sent > step:
                raise InvalidInput('stamp', f'step {sent}', f'at most step {step}')
        except InvalidInput as error:
            self.refuse(f'{voxel}/{interface.ACTUATION_TOPIC}', error)
            return
        if not mine:
            self.count('actuation of another episode')
            return
        if sent != step or i not in self._awaited:
            self.count('late or repeated actuation')
            return
        self._actuation[i] = a[0]
        del self._awaited[i]
        if voxel in self._silent:
            self._silent.discard(voxel)
            self.get_logger().info(f'{voxel} answers again')
        self._advance_if_ready()

    def _advance_if_ready(self) -> None:
        ready = all(voxel in self._silent for voxel in self._awaited.values())
        if not ready or not self._begun or self.exit_code is not None:
            return
        if self._paused and not self._to_make:
            return
        self._to_make = None if self._to_make is None else self._to_make - 1
        try:
            self._readings = self.simulation.step(self._actuation)
        except Diverged as error:
            self.get_logger().error(f'the physics diverged: {error}')
            self.exit_code = _FAILED
            return
        self.count('steps')
        self._publish_step()

    def _watch(self) -> None:
        """Name the voxels that let everybody wait too long; stop or go on without them."""
        waited = time.monotonic() - self._waiting_since
        # Until step 2 every voxel has not only to start but to find its neighbours.
        started = self.simulation.step_count >= 2
        limit = self._silence_limit if started else self._start_limit
        missing = [voxel for voxel in self._awaited.values() if voxel not in self._silent]
        paused = self._paused and not self._to_make
        if waited <= limit or not missing or paused or self.exit_code is not None:
            return
        self.get_logger().error(
            f'no actuation for step {self.simulation.step_count} within {limit:g} s from: '
            f'{", ".join(missing)}'
        )
        if self._on_silence == 'stop':
            self.exit_code = _FAILED
            return
        self._silent.update(missing)
        if len(self._silent) == len(self._voxels):
            self.get_logger().error('every voxel is silent')
            self.exit_code = _FAILED
            return
        self._advance_if_ready()

    def _finish(self) -> None:
        self.get_logger().info(
            f'done: {self.simulation.time:g} s, centre at x = {self.simulation.center[0]:.3f} m'
        )
        self.exit_code = 0

    def close(self) -> None:
        """Let readers have what was published."""
        publishers = [self._odometry_out, self._markers_out, self._clock_out]
        self.wait_for_readers(publishers + [publisher for publisher, _ in self._sensors_out])

    def health(self) -> tuple[bytes, str]:
        """Return the state for /diagnostics."""
        if self._silent:
            return DiagnosticStatus.ERROR, f'silent: {", ".join(sorted(self._silent))}'
        state = 'paused' if self._paused else 'running'
        return DiagnosticStatus.OK, f'{state}, step {self.simulation.step_count}'

    def _serve_reset(self, request: Trigger.Request, response: Trigger.Response):
        if not self._begun:
            response.success, response.message = False, 'still waiting for recorders'
            return response
        self._begin()
        response.success, response.message = True, 'at step 0'
        return response

    def _serve_pause(self, request: SetBool.Request, response: SetBool.Response):
        self._paused, self._to_make = request.data, None
        self._waiting_since = time.monotonic()
        response.success = True
        response.message = f'{"paused" if request.data else "running"} at step ' + str(
            self.simulation.step_count
        )
        self._advance_if_ready()
        return response

    def _serve_step(self, request: Trigger.Request, response: Trigger.Response):
        if not self._paused or not self._begun:
            response.success = False
            response.message = 'not paused' if self._begun else 'still waiting for recorders'
            return response
        self._to_make = (self._to_make or 0) + 1
        response.success = True
        response.message = f'one step from step {self.simulation.step_count}'
        self._advance_if_ready()
        return response


def main(argv: list[str]) -> int:
    """Run the simulation node; return the exit code."""
    return run_nodes(lambda: [SimNode()], argv)
