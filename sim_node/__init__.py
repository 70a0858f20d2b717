"""The body and its world: voxels, masses and springs on a terrain, stepped by pymunk.

The body knows no mind: nothing in here imports `snca_ros`.
"""
