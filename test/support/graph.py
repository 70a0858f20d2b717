"""Service calls to a running graph, and the offline walk that it is compared with."""

from std_srvs.srv import SetBool

from sim_node.simulation import Simulation
from snca_ros.controller_file import load_controller
from snca_ros.evolution.episode import run_episode


def offline(path, seconds):
    trained = load_controller(path)
    simulation = Simulation('11-10', solver=trained.solver)
    return run_episode(simulation, trained.controller(), seconds).centers


def call(node, spin_until, kind, name, **request):
    client = node.create_client(kind, f'/robot/{name}')
    spin_until(client.service_is_ready)
    future = client.call_async(kind.Request(**request))
    spin_until(future.done)
    return future.result()


def go(node, spin_until, centers):
    """Let the simulation run, once the test listens."""
    spin_until(lambda: 0 in centers[0])
    assert call(node, spin_until, SetBool, 'pause', data=False).success
