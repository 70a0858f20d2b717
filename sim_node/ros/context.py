"""(ROS) Initialises ROS in a process, with log files if they can be written."""

import os
from pathlib import Path

import rclpy
from rclpy.signals import SignalHandlerOptions


def start_ros(arguments: list[str]) -> None:
    """Initialise ROS without its signal handlers.

    Args:
        arguments: command line, may have --ros-args.

    Raises:
        RCLError, UnknownROSArgsError: the arguments are invalid.
    """
    if not _can_keep_logs():
        arguments = [*arguments, '--ros-args', '--disable-external-lib-logs']
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)


def _can_keep_logs() -> bool:
    """Return whether ROS can write its log files, which repeat what it prints.

    Without ROS_LOG_DIR and ROS_HOME they are in ~/.ros/log. ROS would not start without HOME, and
    would create a folder named ~ where HOME is that.
    """
    if os.environ.get('ROS_LOG_DIR') or os.environ.get('ROS_HOME'):
        return True
    home = Path(os.environ.get('HOME', ''))
    if not (home.is_absolute() and home.is_dir()):
        return False
    log = home / '.ros' / 'log'
    nearest = next(folder for folder in (log, *log.parents) if folder.exists())
    return nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)
