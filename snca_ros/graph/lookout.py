"""(ROS) Looks for a running simulation of a robot before another one is started."""

import multiprocessing
import os
import signal
import time
from multiprocessing.connection import Connection

import rclpy

from sim_node.errors import InvalidInput
from sim_node.ros.context import start_ros
from sim_node.ros.simulations import Simulations
from snca_ros.graph.environment import graph_environment

_LOOK = 1.0  # seconds within which a new participant discovers a running simulation
_ENDING = 4.0  # seconds that a simulation may take to end
_PERIOD = 0.05  # seconds between two looks


class Lookout:
    """Looks for a simulation of a robot, in a process of its own, while this process does more.

    This process must not start ROS before it has forked its nodes.

    Args:
        robot: its namespace.
        enclave: SROS 2 enclave of the process.
        reach: as for `graph_environment`.
    """

    def __init__(self, robot: str, enclave: str, reach: str) -> None:
        self._robot = robot
        self._answer, end = multiprocessing.Pipe(duplex=False)
        self._process = multiprocessing.Process(
            target=_look, args=(robot, enclave, reach, end), daemon=True
        )
        self._process.start()
        end.close()

    def check(self) -> None:
        """Wait for the result; raise InvalidInput if there is a simulation of this robot."""
        try:
            found = self._answer.recv()
        except EOFError:
            found = ''  # it has failed: the simulation itself looks again
        self._process.join()
        if found:
            raise InvalidInput(
                '--robot', self._robot, f'a robot that is not running: {found} simulates it'
            )


def _look(robot: str, enclave: str, reach: str, answer: Connection) -> None:
    """Send who simulates a robot now, empty for nobody."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this
    os.environ.update(graph_environment(reach))
    start_ros(['--ros-args', '--enclave', enclave])
    node = rclpy.create_node('walk', namespace=f'/{robot}', enable_rosout=False)
    simulations, begun = Simulations(node), time.monotonic()
    found, waited = '', 0.0
    while waited < (_ENDING if found else _LOOK):
        rclpy.spin_once(node, timeout_sec=_PERIOD)
        found, waited = simulations.with_precedence(), time.monotonic() - begun
    answer.send(found)
    rclpy.try_shutdown()
