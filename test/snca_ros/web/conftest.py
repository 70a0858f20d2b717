"""Pages in a real browser: headless Chromium, driven by Playwright."""

import os
import shutil

import pytest
from support.limits import LIMIT

NAMES = ('chromium', 'chromium-browser', 'google-chrome')
SIZES = {'phone': {'width': 390, 'height': 844}, 'wide': {'width': 1600, 'height': 950}}


def pytest_collection_modifyitems(items):
    """Mark the tests that open a page."""
    for item in items:
        if 'browser' in getattr(item, 'fixturenames', ()):
            item.add_marker('browser')


@pytest.fixture(scope='session')
def browser():
    """Return a Chromium; tests that need one are skipped where none is installed."""
    playwright = pytest.importorskip('playwright.sync_api')
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip(f'none of {", ".join(NAMES)} is installed')
    with playwright.sync_playwright() as driver:
        arguments = ['--no-sandbox'] if os.geteuid() == 0 else []
        chromium = driver.chromium.launch(executable_path=path, args=arguments)
        yield chromium
        chromium.close()


def new_page(context):
    """Return a new page, whose waits end only if they hang."""
    page = context.new_page()
    page.set_default_timeout(1000 * LIMIT)
    return page


@pytest.fixture
def open_page(browser):
    """Return a function that opens a page and waits until it is ready.

    At the end no page may have written to its console, or have used the network.
    """
    contexts, messages = [], []

    def open_(address: str, size: str = 'wide', scheme: str = 'light'):
        context = browser.new_context(viewport=SIZES[size], color_scheme=scheme)
        contexts.append(context)
        page = new_page(context)
        page.on('console', lambda message: messages.append(message.text))
        page.on('pageerror', lambda error: messages.append(str(error)))
        page.on('request', lambda request: note(request.url))
        page.goto(address)
        page.wait_for_function('window.player')
        return page

    def note(url: str):
        if not url.startswith(('file:', 'data:', 'blob:', 'http://127.0.0.1:')):
            messages.append(url)

    yield open_
    for context in contexts:
        context.close()
    assert messages == []
