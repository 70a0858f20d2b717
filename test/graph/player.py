"""A process that plays a bag in a loop, like `ros2 bag play --loop`: `player.py BAG`."""

import importlib
import itertools
import sys
import threading
from pathlib import Path

import rclpy

from sim_node.ros.topics import stream_qos
from snca_ros.recording.storage import read_storage

PERIOD = 0.002  # s between two messages


def message_class(name):
    package, kind, message = name.split('/')
    return getattr(importlib.import_module(f'{package}.{kind}'), message)


def play(path):
    """Publish all messages below a namespace and /clock in their order, again and again."""
    topics, _ = read_storage(path)
    played = {n: t for n, t in topics.items() if n.count('/') > 1 or n == '/clock'}
    node = rclpy.create_node('player')
    publishers = {
        name: node.create_publisher(message_class(topic.type), name, stream_qos())
        for name, topic in played.items()
    }
    messages = sorted(
        (t, name, i) for name, topic in played.items() for i, t in enumerate(topic.times)
    )
    pace = threading.Event()
    for _, name, i in itertools.cycle(messages):
        publishers[name].publish(played[name].messages[i])
        pace.wait(PERIOD)


if __name__ == '__main__':
    rclpy.init()
    play(Path(sys.argv[1]))
