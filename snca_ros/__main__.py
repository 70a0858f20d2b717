"""Runs the `snca` command as `python -m snca_ros`."""

import sys

from snca_ros.cli import main

sys.exit(main())
