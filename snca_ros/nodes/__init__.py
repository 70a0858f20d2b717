"""(ROS) The voxel and recorder nodes, and the graph of processes that they make."""
