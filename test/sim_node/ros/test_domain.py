import pytest

from sim_node.errors import InvalidInput
from sim_node.ros.domain import check_domain


@pytest.mark.parametrize('text', ['', '0', ' 42', '232'])
def test_domains(text, monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', text)
    check_domain()


@pytest.mark.parametrize('text', ['abc', '-1', '233', '1.5', '٣', '1 2'])
def test_what_is_no_domain_is_refused(text, monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', text)
    with pytest.raises(InvalidInput, match=f"ROS_DOMAIN_ID: got '{text}', expected an integer"):
        check_domain()
