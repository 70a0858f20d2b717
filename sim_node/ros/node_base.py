"""(ROS) The base of all nodes: parameters, executor, diagnostics, and a clean exit."""

import os
import platform
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterUninitializedException,
)
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer

from sim_node.errors import InvalidInput
from sim_node.ros import domain, security
from sim_node.ros.context import start_ros
from sim_node.ros.deadlines import ListeningTime
from sim_node.ros.interface import DIAGNOSTICS, DIAGNOSTICS_PERIOD
from sim_node.ros.stop_signals import StopRequest

BAD_INPUT = 2

_FAILED = 1
_STOP_LATENCY = 0.1  # seconds between checks for a signal
_SPIN_PERIOD = 60.0  # seconds; without a timeout EventsExecutor busy-waits
_DRAIN_LIMIT = 3.0
_READERS_LIMIT = 2.0
_REFUSAL_PERIOD = 1.0  # seconds between two lines about invalid messages


class RosNode(Node):
    """A node with checked parameters, diagnostics and an exit code.

    Attributes:
        ended: future that is done as soon as `exit_code` is set.
        listening: the time that limits count; nodes with limits call it at least every 0.2 s.
        counters: counts by name that /diagnostics shows, see `count`.
    """

    def __init__(self, name: str, **options: Any) -> None:
        self._taken_by_node: list[Subscription] = []
        super().__init__(name, **options)
        self.ended = Future()
        self.listening = ListeningTime()
        self._diagnostics = self.create_publisher(DiagnosticArray, DIAGNOSTICS.name, 10)
        self.create_timer(DIAGNOSTICS_PERIOD, self.publish_diagnostics)
        self.counters: dict[str, int] = {}
        self._reported = time.monotonic(), 0  # time, and number of steps at that time
        self._next_refusal = 0.0  # time from which on the next one is logged

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Return the subscriptions that executors serve: all but the mailboxes."""
        return (s for s in super().subscriptions if s not in self._taken_by_node)

    def create_mailbox(self, kind: type, topic: str, qos: QoSProfile) -> Subscription:
        """Subscribe to serialised messages without a callback; `take_all` returns them."""
        mailbox = self.create_subscription(kind, topic, lambda data: None, qos, raw=True)
        self._taken_by_node.append(mailbox)
        return mailbox

    @property
    def exit_code(self) -> int | None:
        """Return the exit code, None while the node runs; setting it ends the process."""
        return self.ended.result()

    @exit_code.setter
    def exit_code(self, code: int) -> None:
        self.ended.set_result(code)

    def fail(self, reason: str) -> None:
        """Log an error, and end the process with exit code 1."""
        self.get_logger().error(reason)
        self.exit_code = _FAILED

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[..., Any],
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        autostart: bool = True,
    ) -> Timer:
        """Create a timer on wall time, which continues while simulated time stands still."""
        steady = clock or Clock(clock_type=ClockType.STEADY_TIME)
        return super().create_timer(timer_period_sec, callback, callback_group, steady, autostart)

    def parameter(
        self,
        name: str,
        default: Any,
        text: str,
        low: float | None = None,
        high: float | None = None,
        *,
        any_type: bool = False,
    ) -> Any:
        """Declare a read-only parameter with its description and range; return its value.

        Args:
            name: name of the parameter.
            default: default value, of the type of the parameter.
            text: meaning of the parameter, for its description and for errors.
            low, high: inclusive range of a number.
            any_type: whether values may have another type than `default`; the caller then checks
                them.

        Raises:
            InvalidInput: the given value has another type or is out of range.
        """
        descriptor = ParameterDescriptor(
            description=text, read_only=True, dynamic_typing=any_type
        )
        expected = f'{type(default).__name__}: {text}'
        if low is not None and high is not None:
            expected = f'{type(default).__name__} from {low:g} to {high:g}: {text}'
            if isinstance(default, float):
                of_floats = FloatingPointRange(from_value=low, to_value=high)
                descriptor.floating_point_range = [of_floats]
            else:
                of_integers = IntegerRange(from_value=int(low), to_value=int(high))
                descriptor.integer_range = [of_integers]
        override = self._parameter_overrides.get(name)
        given = override.value if override is not None else None
        number = given if type(given) in (int, float) else None
        if number is not None and isinstance(default, (float, str)) and not any_type:
            # ROS parses 1 as an integer where 1.0, the grid 1 or a share is meant.
            value = type(default)(number)
            self._parameter_overrides[name] = rclpy.Parameter(name, value=value)
        try:
            return self.declare_parameter(name, default, descriptor).value
        except (
            InvalidParameterTypeException,
            InvalidParameterValueException,
            ParameterUninitializedException,
        ):
            raise InvalidInput(name, given, expected, self.where()) from None

    def where(self) -> str:
        """Return the source of the parameters for errors: parameter files and the node's name."""
        files = [b for a, b in zip(sys.argv, sys.argv[1:], strict=False) if a == '--params-file']
        return ', '.join([*files, self.get_fully_qualified_name()])

    def count(self, name: str) -> None:
        """Add one to a counter that the diagnostics show."""
        self.counters[name] = self.counters.get(name, 0) + 1

    def refuse(self, topic: str, error: Exception) -> None:
        """Count an invalid message, and log the error at most once a second."""
        self.count('refused messages')
        # rclpy's own throttle takes 0.25 ms for each message that it does not log.
        now = time.monotonic()
        if now >= self._next_refusal:
            self._next_refusal = now + _REFUSAL_PERIOD
            self.get_logger().warning(f'{topic}: refused: {error}')

    def draining(self) -> bool:
        """Return whether an ending node still has to process messages; nodes override it."""
        return False

    def wait_for_readers(self, publishers: Sequence[Any]) -> None:
        """Wait up to 2 s until subscribers have acknowledged all published messages."""
        waited = ListeningTime()
        for publisher in (*publishers, self._diagnostics):
            while publisher.get_subscription_count() and waited.now() < _READERS_LIMIT:
                if publisher.wait_for_all_acked(Duration(seconds=_STOP_LATENCY)):
                    break

    def close(self) -> None:
        """Finish pending work before the node is destroyed; nodes override it."""

    def health(self) -> tuple[bytes, str]:
        """Return (DiagnosticStatus level, one-line message); nodes override it."""
        return DiagnosticStatus.OK, 'running'

    def statistics(self) -> Mapping[str, object]:
        """Return further values for /diagnostics besides the counters; nodes override it."""
        return {}

    def publish_diagnostics(self) -> None:
        """Publish the state: called once a second, at the end, and when the state changes."""
        level, text = self.health()
        now, steps = time.monotonic(), self.counters.get('steps', 0)
        then, before = self._reported
        self._reported = now, steps
        rate = (steps - before) / max(now - then, 1e-3)
        values = {**self.counters, 'steps per second': round(rate, 1), **self.statistics()}
        status = DiagnosticStatus(
            level=level, name=self.get_fully_qualified_name(), message=text,
            hardware_id=f'{platform.node()}:{os.getpid()}',
            values=[KeyValue(key=k, value=str(v)) for k, v in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def take_all(mailbox: Subscription) -> list[bytes]:
    """Return the messages in a mailbox, oldest first."""
    found = []
    while (message := mailbox.handle.take_message(mailbox.msg_type, True)) is not None:
        found.append(message[0])
    return found


def new_executor() -> Executor:
    """Return an EventsExecutor, or a SingleThreadedExecutor if rclpy has none."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:  # rclpy is older
        return SingleThreadedExecutor()
    return EventsExecutor()


def run_nodes(make_nodes: Callable[[], Sequence[RosNode]], argv: list[str]) -> int:
    """Spin nodes until one of them ends, or until Ctrl-C or SIGTERM; return the exit code.

    Args:
        make_nodes: makes the nodes; may raise InvalidInput.
        argv: command line after the program name, with --ros-args.
    """
    stop = StopRequest()
    nodes: Sequence[RosNode] = ()
    secured = False
    try:
        domain.check_domain()
        secured = security.is_requested()
        start_ros([sys.argv[0], *argv])
        nodes = make_nodes()
    except InvalidInput as error:
        print(f'error: {error}', file=sys.stderr)
        return BAD_INPUT
    except Exception as error:
        if not _is_bad_arguments(error):
            raise
        reason = ' '.join(str(error).split())
        text = security.explained(reason) if secured else f'ROS arguments: {reason}'
        print(f'error: {text}', file=sys.stderr)
        return BAD_INPUT
    executor = new_executor()
    for node in nodes:
        executor.add_node(node)
    end = Future()

    def check_end() -> None:
        if stop.requested or any(node.exit_code is not None for node in nodes):
            end.set_result(None)

    for node in nodes:
        node.ended.add_done_callback(lambda _: check_end())
    # A timer, since the executor ignores its timeout while messages keep arriving.
    nodes[0].create_timer(_STOP_LATENCY, check_end)
    check_end()
    while not end.done():
        executor.spin_until_future_complete(end, _SPIN_PERIOD)
    drained = ListeningTime()
    while any(node.draining() for node in nodes) and drained.now() < _DRAIN_LIMIT:
        executor.spin_once(_STOP_LATENCY)
    for node in nodes:
        node.publish_diagnostics()
        node.close()
    executor.shutdown()
    codes = [node.exit_code or 0 for node in nodes]
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()
    return max(codes, default=0)


def _is_bad_arguments(error: Exception) -> bool:
    """Return whether rcl rejected the command line or a parameter file."""
    kinds = ('RCLError', 'UnknownROSArgsError', 'RCLInvalidROSArgsError', 'InvalidNodeName',
             'NodeNameNonExistentError', 'InvalidNamespace', 'InvalidNodeNameException',
             'InvalidNamespaceException')
    return any(kind.__name__ in kinds for kind in type(error).__mro__)
