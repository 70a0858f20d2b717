"""(ROS) The voxel node, the recorder node and the node of the live view."""
