"""Runs the `snca` command, as the program `snca` and as `python -m snca_ros`."""

import sys

from snca_ros.interrupts import exiting_at_interrupt


def main() -> int:
    """Run the command or node of this process's command line; return the exit code."""
    with exiting_at_interrupt():
        from snca_ros import cli
    return cli.main()


if __name__ == '__main__':
    sys.exit(main())
