"""SIGINT and SIGTERM are not lost, wherever they arrive."""

import signal
import subprocess
import sys

import pytest

from sim_node.ros.stop_signals import STOP_SIGNALS, StopRequest, blocked_stop_signals

IN_A_FINALISER = """
import signal
from sim_node.ros.stop_signals import exit_at_stop_signals
from snca_ros.interrupts import exiting_at_interrupt

class Item:  # whose finaliser, as in an import, is interrupted
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
        for _ in range(10): pass

signal.signal(signal.SIGINT, signal.default_int_handler)
"""


@pytest.mark.parametrize(('block', 'code'), [
    ('Item()', 3),  # Python reports the exception and ignores it
    ('exit_at_stop_signals(0); Item()', 0),
    ('with exiting_at_interrupt(): Item()', 130),
])
def test_an_interrupt_in_a_finaliser(block, code):
    program = f'{IN_A_FINALISER}\n{block}\nraise SystemExit(3)'
    ended = subprocess.run([sys.executable, '-c', program], capture_output=True, check=False)
    assert ended.returncode == code, ended.stderr


@pytest.mark.parametrize('number', STOP_SIGNALS)
def test_a_request_is_noted_and_handlers_are_restored(number):
    before = [signal.signal(n, signal.default_int_handler) for n in STOP_SIGNALS]
    try:
        with StopRequest() as stop:
            stop.raise_if_requested()
            with blocked_stop_signals():
                signal.raise_signal(number)
                assert not stop.requested
            assert stop.requested
            with pytest.raises(KeyboardInterrupt):
                stop.raise_if_requested()
        assert all(signal.getsignal(n) is signal.default_int_handler for n in STOP_SIGNALS)
    finally:
        for n, handler in zip(STOP_SIGNALS, before, strict=True):
            signal.signal(n, handler)


def test_an_ignored_signal_remains_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with StopRequest() as stop:
            signal.raise_signal(signal.SIGINT)
        assert not stop.requested
    finally:
        signal.signal(signal.SIGINT, before)
