"""Studying recorded walks: bags, gaits, figures and reports; nothing in here needs ROS."""
