"""The model of a robot and its world: shape, ground, material, masses, springs, sensors, faults."""
