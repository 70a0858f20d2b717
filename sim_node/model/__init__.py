"""What a robot and its world are: shape, ground, material, masses and springs, sensors, faults."""
