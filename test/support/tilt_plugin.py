"""A module for SNCA_PLUGINS: its import registers a sensor."""

from support.tilt_sensor import Turned

from sim_node.model.sensors import SENSORS

SENSORS.register('tilt', Turned())
