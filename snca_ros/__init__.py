"""The cells of a modular soft robot, and all that trains, runs and studies them."""

__version__ = '0.1.0'
