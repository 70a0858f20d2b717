"""A process that publishes invalid messages on a robot's topics: `attacker.py /robot`.

It derives them from messages that it receives, as any node could. Every millisecond it publishes
one: a topic's message with one error, 300 to the same topic before it continues with the next.
"""

import itertools
import random
import sys

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

from sim_node.ros.node_base import new_executor
from sim_node.ros.topics import stream_qos

BURST = 300
RANDOM = random.Random(0)
NAN = float('nan')

STAMPS = ((-1, 0), (0, 7), (2**31 - 1, 0), (10_000, 0), (0, 10**9), (0, 0))
WRONG = {
    JointState: {
        'name': (['someone'], [], ['x'] * 1000),
        'position': ([NAN] * 4, [NAN], [2.0], [-7.0] * 4, [], [0.5] * 1000),
        'velocity': ([0.5],),
        'effort': ([NAN] * 4,),
    },
    Image: {
        'encoding': ('rgb8', '', 'mono8' * 100),
        'height': (0, 2**32 - 1, 3),
        'width': (0, 2**32 - 1, 15),
        'step': (0, 2**32 - 1),
        'is_bigendian': (1,),
        'data': (b'', b'\x07' * 64, bytes(10**5)),
    },
}
FRAMES = ('', 'someone', 'voxel_0_0', 'voxel_0_0@', 'x' * 10_000)


def spoilt(kind, data):
    """Yield serialised messages: `data` with one error each, and once unchanged but late."""
    def message():
        return deserialize_message(data, kind)

    for stamp in STAMPS:
        bad = message()
        bad.header.stamp.sec, bad.header.stamp.nanosec = stamp
        yield serialize_message(bad)
    for frame in FRAMES:
        bad = message()
        bad.header.frame_id = frame
        yield serialize_message(bad)
    for field, values in WRONG[kind].items():
        for value in values:
            bad = message()
            setattr(bad, field, value)
            yield serialize_message(bad)
    for length in (4, 5, 12, len(data) // 2, len(data) - 1):
        yield data[:length]
    yield data + bytes(1000)
    yield data[:4] + RANDOM.randbytes(len(data) - 4)
    yield RANDOM.randbytes(len(data))
    yield data


class Attacker:
    """Publishes one invalid message per millisecond on the topics of a robot."""

    def __init__(self, robot):
        self._node = rclpy.create_node('attacker')
        self._received = {}
        self._publishers = {}
        for topic, kind in self._topics(robot):
            self._node.create_subscription(
                kind, topic, lambda data, topic=topic: self._received.setdefault(topic, data),
                stream_qos(), raw=True,
            )
            self._publishers[topic] = kind, self._node.create_publisher(kind, topic, stream_qos())
        unreliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        context = rclpy.Context()  # a second participant: other types on the same topics
        rclpy.init(context=context)
        liar = rclpy.create_node('liar', context=context)
        self._others = [
            (liar.create_publisher(String, topic, unreliable), String(data='no'))
            for topic in [*self._publishers, f'{robot}/odometry', f'{robot}/markers', '/clock']
        ]
        status = DiagnosticStatus(
            name=f'{robot}/sim_node', values=[KeyValue(key='steps', value='nan')]
        )
        self._others.append(
            (self._node.create_publisher(DiagnosticArray, '/diagnostics', 10),
             DiagnosticArray(status=[status]))
        )
        sequence = self._sequence()
        self._node.create_timer(0.001, lambda: next(sequence))

    @staticmethod
    def _topics(robot):
        for voxel in ('voxel_0_0', 'voxel_0_1', 'voxel_1_1'):
            yield f'{robot}/{voxel}/sensors', JointState
            yield f'{robot}/{voxel}/actuation', JointState
            yield f'{robot}/{voxel}/spikes', Image

    def _sequence(self):
        for topic in itertools.cycle(self._publishers):
            for publisher, message in self._others:
                publisher.publish(message)
            kind, publisher = self._publishers[topic]
            if topic not in self._received:
                yield
                continue
            wrong = itertools.cycle(list(spoilt(kind, self._received[topic])))
            for data in itertools.islice(wrong, BURST):
                publisher.publish(data)
                yield

    def run(self):
        executor = new_executor()
        executor.add_node(self._node)
        while rclpy.ok():
            executor.spin_once(1.0)


if __name__ == '__main__':
    rclpy.init()
    Attacker(sys.argv[1]).run()
