"""Sensors from outside the tree; `tilt_plugin` registers one of them."""

from typing import NamedTuple

from sim_node.model.sensors import own_axes
from sim_node.numerics.jit import compiled_inline


class Turned(NamedTuple):
    """Sine of the angle by which the voxel is turned."""

    window: int = 3  # control steps
    low: float = -1.0
    high: float = 1.0

    @staticmethod
    @compiled_inline
    def measure(sensor, voxel):
        _, sine = own_axes(voxel)
        return sine


class Height(NamedTuple):
    """Mean height of the masses over `top`."""

    window: int = 1  # control steps
    top: float = 10.0  # m

    @staticmethod
    @compiled_inline
    def measure(sensor, voxel):
        y = voxel.y
        return (y[0] + y[1] + y[2] + y[3]) / (4.0 * sensor.top)
