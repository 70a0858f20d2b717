"""The pymunk engine: one robot in a Munk2D space, stepped by compiled code."""
