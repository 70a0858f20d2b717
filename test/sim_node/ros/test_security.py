"""What the environment asks for, of SROS 2: all of it, nothing, or a refusal."""

import pytest

from sim_node.errors import InvalidInput
from sim_node.ros import security


@pytest.fixture(autouse=True)
def nothing_asked_for(monkeypatch):
    for name in (security.ENABLE, security.STRATEGY, security.KEYSTORE):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize('value', ['', 'false'])
def test_nothing_is_asked_for(monkeypatch, value):
    assert not security.is_requested()
    monkeypatch.setenv(security.ENABLE, value)
    assert not security.is_requested()
    security.check_middleware()


def test_all_is_asked_for(monkeypatch):
    monkeypatch.setenv(security.ENABLE, 'true')
    monkeypatch.setenv(security.STRATEGY, 'Enforce')
    assert security.is_requested()


@pytest.mark.parametrize('value', ['1', 'True', 'yes', 'TRUE', 'on'])
def test_what_rcl_would_take_for_a_no_is_refused(monkeypatch, value):
    monkeypatch.setenv(security.ENABLE, value)
    with pytest.raises(InvalidInput, match=security.ENABLE):
        security.is_requested()


@pytest.mark.parametrize('value', ['', 'Permissive', 'enforce'])
def test_leave_to_go_on_in_the_open_is_refused(monkeypatch, value):
    monkeypatch.setenv(security.ENABLE, 'true')
    monkeypatch.setenv(security.STRATEGY, value)
    with pytest.raises(InvalidInput, match=security.STRATEGY):
        security.is_requested()
