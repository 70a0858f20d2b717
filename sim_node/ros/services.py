"""(ROS) The services of the simulation: reset, pause and step."""

from typing import Protocol

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from sim_node.ros.sim_interface import PAUSE, RESET, STEP


class Controlled(Protocol):
    """What services control, see `sim_node.ros.node.SimNode`."""

    begun: bool
    paused: bool

    @property
    def step(self) -> int:
        """Return the present control step."""

    def begin(self) -> None:
        """Begin an episode."""

    def pause(self, paused: bool) -> None:
        """Pause or continue."""

    def request_step(self) -> None:
        """Make one step while paused, or as soon as it is possible."""


def create_services(node: Node, simulation: Controlled) -> None:
    """Create the services of a simulation on its node."""
    waiting = 'still waiting for recorders'

    def reset(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = simulation.begun
        response.message = 'at step 0' if simulation.begun else waiting
        if simulation.begun:
            simulation.begin()
        return response

    def pause(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success = True
        response.message = f'{"paused" if request.data else "running"} at step {simulation.step}'
        simulation.pause(request.data)
        return response

    def step(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = simulation.paused and simulation.begun
        response.message = f'one step from step {simulation.step}'
        if response.success:
            simulation.request_step()
        else:
            response.message = 'not paused' if simulation.begun else waiting
        return response

    node.create_service(Trigger, RESET.name, reset)
    node.create_service(SetBool, PAUSE.name, pause)
    node.create_service(Trigger, STEP.name, step)
