import subprocess
import sys

from support.limits import LIMIT


def test_without_compilation_the_reason_is_one_line(monkeypatch):
    monkeypatch.setenv('NUMBA_DISABLE_JIT', '1')
    program = "import sys; from snca_ros.cli import main; sys.exit(main(['evolve', '--help']))"
    run = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, timeout=LIMIT, check=False
    )
    assert (run.returncode, run.stdout) == (2, '')
    assert run.stderr.startswith('snca evolve: error: NUMBA_DISABLE_JIT: got 1, expected 0: ')
    assert run.stderr.count('\n') == 1
