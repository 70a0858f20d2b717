"""A plug-in as if this ROS lacked the functions that compiled code calls."""

from sim_node.ros import rcl_functions

rcl_functions.AVAILABLE = False
