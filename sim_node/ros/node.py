"""(ROS) The simulation node: publishes each voxel's sensors, applies each voxel's actuation.

In lock-step it publishes `sensors`(k), waits until every voxel has answered with `actuation`(k),
steps the physics and continues with k + 1. In real time it steps at each deadline without waiting.
It never computes a control signal itself.
"""

import time
from collections.abc import Mapping
from functools import partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import JointState

from sim_node.control_time import CONTROL_RATE, START_STEPS, steps_in
from sim_node.episode import EpisodeNames
from sim_node.numerics.jit import warm_up
from sim_node.ros import topics
from sim_node.ros.actuation_buffer import Answers
from sim_node.ros.answer_reader import AnswerReader
from sim_node.ros.deadlines import Pace, StepTimes
from sim_node.ros.declared_parameters import check_unknown_parameters
from sim_node.ros.delivery import delivery_statistics
from sim_node.ros.node_base import RosNode, run_nodes
from sim_node.ros.parameters import options_of, simulation_of
from sim_node.ros.publishers import Broadcast
from sim_node.ros.services import create_services
from sim_node.ros.sim_interface import ACTUATION, BEST_EFFORT, SIM_NODE
from sim_node.ros.start import Start
from sim_node.ros.strangers import Strangers
from sim_node.simulation import Diverged

_SLOW = 0.5  # seconds after which the diagnostics name the voxels without an answer
_WATCH_PERIOD = 0.1  # seconds between checks for silent voxels
_SOON = 1000  # nanoseconds until a step whose deadline has passed
_STOPPED = 1  # exit code


class SimNode(RosNode):
    """A ROS node that simulates one robot's body in its world.

    Attributes:
        simulation: the body and its world.
        begun: whether the first episode has begun.
        paused: whether steps are made only on request.
    """

    def __init__(self) -> None:
        super().__init__(SIM_NODE.name)
        self._start = Start(self)
        self._strangers = Strangers(self, self.get_logger().warning)
        self.simulation = simulation_of(self)
        self._options = options_of(self)
        check_unknown_parameters(self)
        self._voxels = self.simulation.morphology.voxel_names
        warm_up('simulation', lambda: self.simulation.step(np.zeros(len(self._voxels))))
        self._make_topics()
        duration = self._options.duration
        self._last_step = steps_in(duration) if duration else None
        factor = self._options.real_time_factor
        self._real_time = factor > 0.0
        self._answers = Answers(self._voxels, hold=self._real_time)
        self._reader = AnswerReader(self, self._voxels, self._answers)
        self._names = EpisodeNames(self.simulation.solver.physics, self._start.identity)
        self.begun, self.paused = False, self._options.start_paused
        self._requested_steps: int | None = None
        self._waiting_since = self.listening.now()
        self._reported_step = -1
        self._times = StepTimes()
        self._pace = Pace(CONTROL_RATE * (factor or 1.0))  # used in real time only
        self._tick_timer = self.create_timer(1.0, self._tick, autostart=False)
        self.create_timer(_WATCH_PERIOD, self._watch)
        self._start.begin_when_possible(
            self._offer, self.begin,
            lambda: self._broadcast.unrecorded_topics(self._options.recorders),
            self._options.start_limit,
        )

    def _make_topics(self) -> None:
        reliability = self._options.reliability
        self._best_effort = reliability == BEST_EFFORT
        self._broadcast = Broadcast(self, self.simulation, self._options.clock, reliability)
        for i, voxel in enumerate(self._voxels):
            self.create_subscription(
                JointState, ACTUATION.of(voxel),
                partial(self._on_actuation, i), topics.link_qos(reliability, topics.QUEUE),
                raw=True,
            )

    @property
    def step(self) -> int:
        """Return the present control step."""
        return self.simulation.step_count

    def _offer(self) -> None:
        self._broadcast.settle()
        create_services(self, self)

    def begin(self) -> None:
        """Begin an episode: put the robot down, wait for every voxel again, publish step 0."""
        self._episode = self._names.next()
        self.begun, self._requested_steps = True, None
        if not self._real_time:
            self._answers.silent.clear()
        self._answers.restart(self.listening.now())
        self._tick_timer.cancel()
        self._times.restart()
        self._readings = self.simulation.reset()
        self._reader.begin_episode(self._episode)
        self._broadcast.begin_episode(self._episode)
        self._publish_step()

    def _publish_step(self) -> None:
        """Publish state and sensors at the present step and start to wait for actuation."""
        self._answers.open_step()
        self._waiting_since = self.listening.now()
        self._broadcast.publish_state()
        if self.simulation.step_count == self._last_step:
            self._finish()
        else:
            self._broadcast.publish_sensors(self._readings)

    def _on_actuation(self, i: int, data: bytes) -> None:
        silent = self._answers.silent
        was_silent = self._voxels[i] in silent
        if not self._reader.read(i, data, self.simulation.step_count, self.listening.now()):
            return
        if was_silent and self._voxels[i] not in silent:
            self.get_logger().info(f'{self._voxels[i]} answers again')
            self.publish_diagnostics()
        self._advance_if_ready()

    def _advance_if_ready(self) -> None:
        """Make the next step in lock-step if all voxels but the silent ones have answered."""
        ready = self._answers.complete and not self._free_running
        if self.begun and ready and not self._halted:
            self._make_step()

    @property
    def _halted(self) -> bool:
        """Return whether the node has ended, or is paused without a requested step."""
        return self.exit_code is not None or (self.paused and not self._requested_steps)

    @property
    def _free_running(self) -> bool:
        """Return whether steps are made at their deadlines, without waiting for answers."""
        return self._real_time and self.simulation.step_count >= START_STEPS

    def _make_step(self) -> None:
        self._requested_steps = None if self._requested_steps is None else self._requested_steps - 1
        step = self.simulation.step_count
        actuation, ages = self._answers.close_step(step), self._answers.ages(step)
        try:
            self._readings = self.simulation.step(actuation)
        except Diverged as error:
            self.fail(f'the physics diverged: {error}')
            return
        self._broadcast.publish_applied(step, ages)
        self.count('steps')
        if self.simulation.step_count > START_STEPS:
            self._times.note(time.monotonic())
        self._publish_step()
        if self._real_time and self.simulation.step_count == START_STEPS and not self.paused:
            self._run_freely()

    def _run_freely(self) -> None:
        """Start the deadlines of real time, at the beginning or after a pause."""
        now = time.monotonic()
        self._pace.start(self.simulation.step_count, now)
        self._answers.restart_timeouts(self.listening.now())
        self._times.restart()
        self._await_tick()

    def _await_tick(self) -> None:
        wait = self._pace.due(self.simulation.step_count + 1) - time.monotonic()
        self._tick_timer.timer_period_ns = max(int(wait * 1e9), _SOON)
        self._tick_timer.reset()

    def _tick(self) -> None:
        """Make the step that is due, in real time, with the actuation received so far."""
        now, step = time.monotonic(), self.simulation.step_count + 1
        if self._halted:
            self._tick_timer.cancel()
            return
        if now >= self._pace.due(step):
            self._pace.note(step, now)
            limit = max(self._options.hold_limit, 2.0 * self._pace.period)
            if silent := self._answers.mark_silent(self.listening.now(), limit):
                self.get_logger().error(f'limp, silent for {limit:g} s: {", ".join(silent)}')
                self.publish_diagnostics()
            self._make_step()
        self._await_tick()

    def _watch(self) -> None:
        """Report voxels that have not answered for too long; stop or continue without them."""
        step, waited = self.simulation.step_count, self.listening.now() - self._waiting_since
        missing = self._answers.missing
        if not missing or self._free_running or self.exit_code is not None:
            return
        if self._best_effort and waited > _WATCH_PERIOD:  # voxels repeat their messages, too
            self._broadcast.publish_sensors(self._readings)
        if self._halted:
            return
        if waited > _SLOW and self._reported_step != step:
            self._reported_step = step
            self.publish_diagnostics()
        # Before `START_STEPS` the voxels still start and discover their neighbours.
        limit = self._options.silence_limit if step >= START_STEPS else self._options.start_limit
        if waited <= limit:
            return
        self.get_logger().error(
            f'no actuation for step {step} within {limit:g} s from: {", ".join(missing)}'
        )
        self._answers.silent.update(missing)
        if not self._real_time and self._options.on_silence == 'stop':
            self.exit_code = _STOPPED
        elif not self._real_time and len(self._answers.silent) == len(self._voxels):
            self.fail('every voxel is silent')
        else:
            self._advance_if_ready()

    def _finish(self) -> None:
        self.get_logger().info(
            f'done: {self.simulation.time:g} s, centre at x = {self.simulation.center[0]:.3f} m'
        )
        self.exit_code = 0

    def close(self) -> None:
        """Wait until subscribers have received the last messages."""
        self.wait_for_readers(self._broadcast.publishers)

    def health(self) -> tuple[bytes, str]:
        """Return the state for /diagnostics, and which other nodes publish its topics."""
        level, text = self._state()
        if strangers := self._strangers.text(p.topic_name for p in self._broadcast.publishers):
            return max(level, DiagnosticStatus.WARN), f'{text}; {strangers}'
        return level, text

    def _state(self) -> tuple[bytes, str]:
        step = self.simulation.step_count
        if silent := self._answers.silent:
            return DiagnosticStatus.ERROR, f'silent: {", ".join(sorted(silent))}'
        if not self.begun:
            return DiagnosticStatus.OK, 'not begun'
        if self.paused:
            return DiagnosticStatus.OK, f'paused, step {step}'
        waiting = self.begun and not self._free_running and self.exit_code is None
        if waiting and self.listening.now() - self._waiting_since > _SLOW:
            missing = ', '.join(self._answers.missing)
            return DiagnosticStatus.WARN, f'step {step} waits for {missing}'
        text = ', '.join([f'running, step {step}', *self.simulation.walls.describe()])
        return DiagnosticStatus.OK, text

    def publish_diagnostics(self) -> None:
        """Publish the state, unless another simulation of this name does."""
        if self._start.alone:
            super().publish_diagnostics()

    def statistics(self) -> Mapping[str, object]:
        """Return step times, missed deadlines and delivery statistics for /diagnostics."""
        missed = {'missed deadlines': self._pace.missed} if self._real_time else {}
        best_effort = {'best-effort links': len(self._voxels)} if self._best_effort else {}
        deliveries = {
            ACTUATION.of(voxel): delivery
            for voxel, delivery in zip(self._voxels, self._answers.deliveries, strict=True)
        }
        return {
            **self._times.summary(), **missed, **best_effort, **delivery_statistics(deliveries)
        }

    def pause(self, paused: bool) -> None:
        """Pause, or continue."""
        self.paused, self._requested_steps = paused, None
        self._waiting_since = self.listening.now()
        self._times.restart()
        self._resume()

    def request_step(self) -> None:
        """Make one step while paused, as soon as all voxels have answered."""
        self._requested_steps = (self._requested_steps or 0) + 1
        self._resume()

    def _resume(self) -> None:
        """Make the steps that a service call has made possible."""
        if not self._free_running:
            self._advance_if_ready()
        elif not self.paused:
            self._run_freely()
        elif self._requested_steps:
            self._make_step()


def main(argv: list[str]) -> int:
    """Run the simulation node; return the exit code."""
    return run_nodes(lambda: [SimNode()], argv)
