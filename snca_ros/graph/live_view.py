"""(ROS) The live page of a running graph: it shows the robot and executes the page's commands."""

import rclpy

from sim_node.model.terrain import parse_terrain
from snca_ros.graph.description import NodeProcess
from snca_ros.graph.processes import RunningGraph
from snca_ros.nodes.live_view import PERIOD, ViewNode
from snca_ros.trained_controller import TrainedController
from snca_ros.web.page import live_page
from snca_ros.web.server import PageServer

LOSS = 0.5
"""The fault `loss` of a voxel with noise: the share of messages that it does not receive."""


class LiveView:
    """The live page of a running graph: it sends frames to the page and executes its commands.

    Args:
        port: of the page; 0 for a free one.
        trained: the controller.
        terrain: name of the terrain.
        reliability: of the links.
        running: the graph.

    Raises:
        InvalidInput: the port is not available.
    """

    def __init__(
        self, port: int, trained: TrainedController, terrain: str, reliability: str,
        running: RunningGraph,
    ) -> None:
        robot, self._running = running.graph.robot, running
        page = live_page(trained, parse_terrain(terrain), f'{robot} on {terrain}')
        self._server = PageServer(port, page)
        self._node = ViewNode(robot, trained, self._server.send, reliability)
        self._processes = {name: p for p in running.graph.voxels for name in p.names}
        self._killed: set[NodeProcess] = set()
        self.address = self._server.address

    def spin_once(self) -> None:
        """Process ROS messages and the page's commands, for at most the period of a frame."""
        rclpy.spin_once(self._node, timeout_sec=PERIOD)
        for revived in [p for p in self._killed if self._running.exit_code(p) is None]:
            self._killed.remove(revived)  # restarted, by the page or by --respawn
            for name in revived.names:
                self._node.note_started(name)
        while not self._server.commands.empty():
            command = self._server.commands.get()
            process = self._processes.get(str(command.get('voxel')))
            if process is not None:
                self._execute(str(command.get('action')), process)

    def _execute(self, action: str, process: NodeProcess) -> None:
        """Kill the process of one or more voxels, restart it, or restart it with noise."""
        if action not in ('kill', 'revive', 'noise'):
            return
        if action in ('kill', 'noise'):
            self._running.kill(process)
            self._killed.add(process)
            for name in process.names:
                self._node.note_killed(name)
        if action in ('revive', 'noise') and self._running.exit_code(process) is not None:
            parameters = {'loss': LOSS} if action == 'noise' else {}
            self._running.start_again(process, **parameters)

    def close(self) -> None:
        """Destroy the node, and close the page's connections and the port."""
        self._node.destroy_node()
        self._server.close()
