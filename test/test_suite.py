"""What all tests rely on: their ROS domains, their limits, and what CI says of skipped tests."""

import os
import re
import subprocess
import sys

from support.domains import DOMAINS, claim_domain
from support.limits import LIMIT
from support.paths import ROOT
from support.skips import FLAG, unexcused

CLAIM = """
import sys
from support.domains import claim_domain
domain, claim = claim_domain()
print(domain, flush=True)
sys.stdin.read()
"""


def test_no_two_processes_claim_a_domain():
    environment = {**os.environ, 'PYTHONPATH': str(ROOT / 'test')}
    children = [
        subprocess.Popen([sys.executable, '-c', CLAIM], env=environment, text=True,
                         stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        for _ in range(4)
    ]
    mine = [claim_domain() for _ in range(3)]
    domains = [int(child.stdout.readline()) for child in children]
    domains += [domain for domain, _ in mine]
    assert len(set(domains)) == 7
    assert set(domains) <= set(DOMAINS)
    for child in children:
        child.communicate(timeout=LIMIT)
    for _, claim in mine:
        claim.close()
    domain, claim = claim_domain()  # a claim ends with its socket
    claim.close()
    assert domain <= max(domains)


SKIPPED = """
import pytest

@pytest.mark.skip(reason='the author was tired')
def test_one():
    pass

@pytest.mark.skip(reason='none of chromium, google-chrome is installed')
def test_other():
    pass
"""


def test_ci_fails_on_a_skip_without_an_excuse(tmp_path, monkeypatch):
    (tmp_path / 'test_one.py').write_text(SKIPPED)
    (tmp_path / 'conftest.py').write_text((ROOT / 'test' / 'conftest.py').read_text())
    found = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-rs', '-p', 'no:cacheprovider', tmp_path],
        env={**os.environ, FLAG: '1', 'PYTHONPATH': str(ROOT / 'test')}, cwd=tmp_path,
        capture_output=True, text=True, check=False, timeout=LIMIT,
    )
    assert found.returncode == 1, found.stdout
    assert found.stdout.count('SKIPPED IN CI') == 1
    assert 'SKIPPED IN CI, which should have run it: the author was tired' in found.stdout
    assert 'none of chromium' in found.stdout  # listed by -rs
    monkeypatch.delenv(FLAG, raising=False)
    assert unexcused(['the author was tired']) == []


def test_limits_are_in_one_place():
    number = re.compile(r'timeout=\d|\b\w+\.(?<!TICK\.)wait\(\d|\.join\(\d|[^_]sleep\(')
    for path in (ROOT / 'test').rglob('*.py'):
        if path.name != 'test_suite.py':
            assert not number.search(path.read_text()), path
