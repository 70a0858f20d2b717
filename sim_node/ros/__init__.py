"""(ROS) The simulation node, and the base of all nodes of a robot."""
