"""A module for SNCA_PLUGINS: its import registers a sensor."""

from support.tilt_sensor import Tilt

from sim_node.model.sensors import SENSORS

SENSORS.register('tilt', Tilt())
