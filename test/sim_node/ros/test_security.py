"""SROS 2 settings of the environment: enabled, disabled, or rejected."""

import pytest

from sim_node.errors import InvalidInput
from sim_node.ros import security


@pytest.fixture(autouse=True)
def no_security_variables(monkeypatch):
    for name in (security.ENABLE, security.STRATEGY, security.KEYSTORE):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize('value', ['', 'false'])
def test_security_is_disabled(monkeypatch, value):
    assert not security.is_requested()
    monkeypatch.setenv(security.ENABLE, value)
    assert not security.is_requested()
    security.check_middleware()


def test_security_is_enabled(monkeypatch):
    monkeypatch.setenv(security.ENABLE, 'true')
    monkeypatch.setenv(security.STRATEGY, 'Enforce')
    assert security.is_requested()


@pytest.mark.parametrize('value', ['1', 'True', 'yes', 'TRUE', 'on'])
def test_values_that_rcl_treats_as_false_are_rejected(monkeypatch, value):
    monkeypatch.setenv(security.ENABLE, value)
    with pytest.raises(InvalidInput, match=security.ENABLE):
        security.is_requested()


@pytest.mark.parametrize('value', ['', 'Permissive', 'enforce'])
def test_strategies_that_allow_nodes_without_keys_are_rejected(monkeypatch, value):
    monkeypatch.setenv(security.ENABLE, 'true')
    monkeypatch.setenv(security.STRATEGY, value)
    with pytest.raises(InvalidInput, match=security.STRATEGY):
        security.is_requested()
