"""`python -m snca_ros`: the same as the `snca` command."""

import sys

from snca_ros.cli import main

sys.exit(main())
