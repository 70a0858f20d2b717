"""Folders of the checkout that these tests lie in."""

from pathlib import Path

TEST = Path(__file__).resolve().parents[1]
ROOT = TEST.parent
CONFIG = ROOT / 'config'
FIXTURES = TEST / 'fixtures'
