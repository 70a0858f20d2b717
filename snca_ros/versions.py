"""The versions of the code and of packages that determine the result of an episode."""

import functools
import subprocess
from importlib import metadata
from pathlib import Path

from snca_ros import __version__

_GIT_LIMIT = 30.0  # s
_CODE = 'sim_node', 'snca_ros'  # folders of a checkout that determine the result of an episode


@functools.cache
def code_version() -> str:
    """Return the version of the code: the commit that last changed it, or the package version.

    In a git checkout it is the first 12 digits of the last commit that changed one of the two
    packages, with '-dirty' if they have changes that are not committed. Commits of documents or
    results do not change it. Elsewhere, or without git, it is the version of the package. The
    result is cached.
    """
    root = Path(__file__).resolve().parents[1]
    if (root / '.git').exists():
        git = ['git', '--no-optional-locks', '-C', str(root)]
        try:
            commit, changes = (
                subprocess.run(
                    [*git, *command, '--', *_CODE],
                    capture_output=True, text=True, check=True, timeout=_GIT_LIMIT,
                ).stdout.strip()
                for command in (
                    ('log', '-1', '--format=%h', '--abbrev=12'),
                    ('status', '--porcelain', '--untracked-files=no'),
                )
            )
        except (OSError, subprocess.SubprocessError):
            commit = ''
        if commit:
            return f'{commit}-dirty' if changes else commit
    return __version__


@functools.cache
def package_versions() -> dict[str, str]:
    """Return the versions of the code and of packages that determine the result of an episode."""
    versions = {'code': code_version()}
    for name in ('snca_ros', 'numpy', 'numba', 'pymunk'):
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = 'not installed'
    return versions
