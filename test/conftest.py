"""For all tests: one profile of hypothesis, the order of files, what CI says of skipped tests."""

import signal

import pytest
from hypothesis import settings

pytest.register_assert_rewrite('support')

from support.skips import unexcused  # noqa: E402

settings.register_profile(
    'steady', deadline=None, derandomize=True, database=None, max_examples=50
)
settings.load_profile('steady')  # the same examples every time, and no deadline

# Shells start background jobs with SIGINT ignored, and what tests start would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    """Begin with the files that have slow tests, so that no worker is left with one at the end."""
    slow = {item.path for item in items if item.get_closest_marker('slow')}
    items.sort(key=lambda item: item.path not in slow)


def failures_of_ci(config):
    """Return the reasons for which tests were skipped that this machine should have run."""
    reporter = config.pluginmanager.get_plugin('terminalreporter')
    skipped = reporter.stats.get('skipped', []) if reporter else []
    reasons = (report.longrepr[2].removeprefix('Skipped: ') for report in skipped)
    return unexcused(reasons)


def pytest_sessionfinish(session):
    """Fail where CI runs if a test was skipped without an excuse; workers leave it to the first."""
    if not hasattr(session.config, 'workerinput') and failures_of_ci(session.config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    """Name the reasons."""
    for reason in failures_of_ci(config):
        terminalreporter.write_line(f'SKIPPED IN CI, which should have run it: {reason}', red=True)
