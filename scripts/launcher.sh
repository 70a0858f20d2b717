#!/bin/sh
# Started by `ros2 run snca_ros <name>`: runs that command with the Python of its own prefix, or,
# where the prefix has none (colcon), with the Python that the environment names.
prefix=$(dirname "$0")/../..
python=$prefix/bin/python3
[ -x "$python" ] || python=python3
# Modules in the working directory are not imported (from Python 3.11 on).
export PYTHONSAFEPATH=1
exec "$python" -m snca_ros "$(basename "$0")" "$@"
