"""(ROS) The simulation as a node, and what all nodes of a robot share."""
