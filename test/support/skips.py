"""Skipped tests that a machine excuses. Where CI runs (`.ci/run`), any other skip is a failure."""

import os
import re
from collections.abc import Iterable

FLAG = 'SNCA_CI'
"""Environment variable that is set where every test must run that the machine can run."""

EXCUSES = (
    r'none of chromium, .* is installed',  # .ci/run installs one where it can
    r'needs arm-none-eabi-gcc and qemu-system-arm',  # likewise
    r'no network namespaces, which need root and iproute2: ',
    r'no nft; ',
    r'root may ',  # tests of what is forbidden to everybody else
    r'an installed package has nothing to build',
    r'needs pkill \(procps\)',
    r'needs git',
)
"""Beginnings of reasons: what a machine may lack although CI has tried to get it."""


def unexcused(reasons: Iterable[str]) -> list[str]:
    """Return the reasons of skips, each once, that are failures where CI runs."""
    if not os.environ.get(FLAG):
        return []
    return [
        reason for reason in dict.fromkeys(reasons)
        if not any(re.match(excuse, reason) for excuse in EXCUSES)
    ]
