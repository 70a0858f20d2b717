"""(ROS) Publishers and subscriptions of messages with a fixed layout, for compiled code.

Compiled code compares a message that it takes with the one that it expects, which differs from the
last one in stamp and numbers only, or writes the numbers of the next message and publishes it.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import carray, types
from numba.extending import intrinsic as _intrinsic
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from sim_node.control_time import CONTROL_RATE
from sim_node.numerics.jit import compiled, compiled_inline
from sim_node.ros.cdr import STAMP, WireFormat
from sim_node.ros.rcl_functions import (
    INFO_WORDS,
    address,
    content,
    message_to_publish,
    messages_to_take,
    rcl_publish,
    rcl_take,
)

intrinsic: Any = _intrinsic  # Any: type checkers would see a signature other than that of the calls

NONE, EXPECTED, OTHER = 0, 1, 2
"""What `take` has found: no message, the expected message, or another message."""

_CAPACITY = 1024  # bytes; rcl enlarges a buffer for a longer message
_STAMP = STAMP.start
_PADDING = 3  # bytes that DDS appends at most


class Endpoints(NamedTuple):
    """n publishers or n subscriptions; their messages are templates with places for numbers."""

    handles: np.ndarray  # (n,) addresses of the rcl structures; 0 for none
    messages: np.ndarray  # (n, MESSAGE_WORDS) the messages that rcl takes or publishes
    spans: np.ndarray  # (n, 2) begin and end of each template in `templates`,
    numbers: np.ndarray  # (n, 2) of its numbers,
    episodes: np.ndarray  # (n, 2) and of the name of its episode
    templates: np.ndarray  # (n_bytes,) uint8
    info: np.ndarray  # (INFO_WORDS,) scratch space


def _handles(endpoints: Sequence[Publisher | None] | Sequence[Subscription | None]) -> list[int]:
    return [0 if one is None else address(one) for one in endpoints]


def _endpoints(
    handles: Sequence[int], formats: Sequence[WireFormat], fields: Sequence[str]
) -> Endpoints:
    all_bytes, spans = bytearray(), []
    for one in formats:
        # CDR aligns numbers from the end of the encapsulation on: 8 bytes after `begin` + 4.
        all_bytes += bytes((4 - len(all_bytes)) % 8)
        spans.append((len(all_bytes), len(all_bytes) + len(one.template)))
        all_bytes += one.template

    def places(names: Sequence[str]) -> np.ndarray:
        found = [one.place(name) for one, name in zip(formats, names, strict=True)]
        return np.array([(at.start, at.stop) for at in found]) + np.array(spans)[:, :1]

    return Endpoints(
        handles=np.array(handles, dtype=np.uintp),
        messages=np.zeros((0, 0), dtype=np.uintp),
        spans=np.array(spans),
        numbers=places(fields),
        episodes=places(['episode'] * len(formats)),
        templates=np.frombuffer(all_bytes, np.uint8).copy(),
        info=np.zeros(INFO_WORDS, dtype=np.uint64),
    )


def publishers(
    endpoints: Sequence[Publisher | None], formats: Sequence[WireFormat], fields: Sequence[str]
) -> Endpoints:
    """Return publishers for compiled code; None for a place without a publisher.

    Args:
        endpoints: the publishers.
        formats: the format of each one's messages.
        fields: name of the numbers of each one's messages.
    """
    made = _endpoints(_handles(endpoints), formats, fields)
    parts = [made.templates[begin:end] for begin, end in made.spans]
    return made._replace(messages=np.array([message_to_publish(part) for part in parts]))


def subscriptions(
    endpoints: Sequence[Subscription | None], formats: Sequence[WireFormat], fields: Sequence[str]
) -> Endpoints:
    """Return subscriptions for compiled code; None for a place without a subscription.

    No executor may take their messages.
    """
    made = _endpoints(_handles(endpoints), formats, fields)
    return made._replace(messages=messages_to_take(len(endpoints), _CAPACITY))


def set_episode(endpoints: Endpoints, episode: bytes) -> None:
    """Write the name of the episode into all templates."""
    for begin, end in endpoints.episodes:
        endpoints.templates[begin:end] = np.frombuffer(episode, np.uint8)


def taken(endpoints: Endpoints, i: int) -> bytes:
    """Return the message that was taken last from subscription i."""
    return content(endpoints.messages[i])


@intrinsic
def _pointer(typing, address):
    """Return an address as a pointer to bytes."""

    def generate(context, builder, signature, args):
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.uint8)(types.uintp), generate


@compiled_inline
def set_step(endpoints, i, step):
    """Write the stamp of a control step into template i, as `control_time.stamp_of_step`."""
    stamp = endpoints.templates[endpoints.spans[i, 0] + _STAMP :][:8].view(np.uint32)
    stamp[0] = step // CONTROL_RATE
    stamp[1] = step % CONTROL_RATE * 10**9 // CONTROL_RATE


@compiled_inline
def numbers(endpoints, i):
    """Return the numbers in template i as doubles that can be written."""
    begin, end = endpoints.numbers[i]
    return endpoints.templates[begin:end].view(np.float64)


@compiled_inline
def matches(endpoints, i, data):
    """Copy the numbers of a message into template i if the message has the template's other bytes.

    Returns whether it has.
    """
    first, last = endpoints.spans[i]
    begin, end = endpoints.numbers[i]
    templates = endpoints.templates
    n_bytes = last - first
    if not n_bytes <= len(data) <= n_bytes + _PADDING:
        return False
    same = True
    for at in range(first, begin):
        same &= data[at - first] == templates[at]
    for at in range(end, last):
        same &= data[at - first] == templates[at]
    if same:
        for at in range(begin, end):
            templates[at] = data[at - first]
    return same


@compiled_inline
def take(endpoints, i):
    """Take the oldest message of subscription i; return NONE, EXPECTED or OTHER.

    The numbers of an expected message are then in the template.
    """
    message = endpoints.messages[i]
    subscription, info = endpoints.handles[i], endpoints.info.ctypes.data
    if rcl_take(subscription, message.ctypes.data, info, 0) != 0:
        return NONE
    data = carray(_pointer(message[0]), int(message[1]))
    return EXPECTED if matches(endpoints, i, data) else OTHER


@compiled_inline
def publish(endpoints, i):
    """Publish template i."""
    rcl_publish(endpoints.handles[i], endpoints.messages[i].ctypes.data, 0)


@compiled
def read_number(data, i, endpoints, step, found, awaited):
    """Read an awaited message of one number of a control step; return whether `data` is that.

    Args:
        data: bytes of a message.
        i: index of the template.
        endpoints: with one number in each template.
        step: control step.
        found: (n,) numbers from -1 to 1; found[i] is written.
        awaited: (n,) bool; awaited[i] is set to false.
    """
    set_step(endpoints, i, step)
    if not (awaited[i] and matches(endpoints, i, data)):
        return False
    number = numbers(endpoints, i)[0]
    if not -1.0 <= number <= 1.0:
        return False
    found[i] = number
    awaited[i] = False
    return True


@compiled
def publish_numbers(endpoints, step, rows):
    """Publish a message of each row of numbers, (n, n_numbers), stamped with a control step."""
    for i in range(len(rows)):
        set_step(endpoints, i, step)
        numbers(endpoints, i)[:] = rows[i]
        publish(endpoints, i)
