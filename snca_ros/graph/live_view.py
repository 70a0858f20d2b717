"""(ROS) The live page of a running graph: it shows the robot and obeys the page's commands."""

import rclpy

from sim_node.model.terrain import parse_terrain
from snca_ros.controller_file import TrainedController
from snca_ros.graph.description import NodeProcess
from snca_ros.graph.processes import RunningGraph
from snca_ros.nodes.live_view import PERIOD, ViewNode
from snca_ros.web.page import live_page
from snca_ros.web.server import PageServer

LOSS = 0.5
"""Share of the messages that a voxel with noise does not hear: the fault `loss`."""


class LiveView:
    """The live page of a running graph: it tells how the robot is and obeys its page.

    Args:
        port: of the page; 0 for a free one.
        trained: the controller.
        terrain: its name.
        running: the graph.

    Raises:
        InvalidInput: the port cannot be had.
    """

    def __init__(
        self, port: int, trained: TrainedController, terrain: str, running: RunningGraph
    ) -> None:
        robot, self._running = running.graph.robot, running
        page = live_page(trained, parse_terrain(terrain), f'{robot} on {terrain}')
        self._server = PageServer(port, page)
        self._node = ViewNode(robot, trained, self._server.tell)
        self._processes = {name: p for p in running.graph.voxels for name in p.names}
        self._killed: set[NodeProcess] = set()
        self.address = self._server.address

    def spin_once(self) -> None:
        """Do what is due, within a frame's time."""
        rclpy.spin_once(self._node, timeout_sec=PERIOD)
        for revived in [p for p in self._killed if self._running.exit_code(p) is None]:
            self._killed.remove(revived)  # started again, by the page or to respawn it
            for name in revived.names:
                self._node.note_started(name)
        while not self._server.commands.empty():
            command = self._server.commands.get()
            process = self._processes.get(str(command.get('voxel')))
            if process is not None:
                self._obey(str(command.get('action')), process)

    def _obey(self, action: str, process: NodeProcess) -> None:
        """Kill, revive or disturb the process of a voxel, and of those that share it."""
        if action not in ('kill', 'revive', 'noise'):
            return
        if action in ('kill', 'noise'):
            self._running.kill(process)
            self._killed.add(process)
            for name in process.names:
                self._node.note_killed(name)
        if action in ('revive', 'noise') and self._running.exit_code(process) is not None:
            disturbed = {'loss': LOSS} if action == 'noise' else {}
            self._running.start_again(process, **disturbed)

    def close(self) -> None:
        """Close the page's connections and the port."""
        self._node.destroy_node()
        self._server.close()
