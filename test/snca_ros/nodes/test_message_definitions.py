"""Bags contain the definitions of the types that are installed, as rosbag2 writes them."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from snca_ros.nodes.message_definitions import MessageDefinitions, installed_definition

DIGEST = 'RIHS01_' + '7' * 64


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return the share folder of a package of another project."""
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    share = tmp_path / 'share'
    for name, text in {
        'mine/msg/Thing.msg': (
            '# a Comment line\nuint8 FULL=1\nPart[<=3] parts  # Other other\n'
            'other/Leaf leaf\nstring<=8 name "x"\nfloat64[4] numbers\nbool done'
        ),
        'mine/msg/Part.msg': 'other/Leaf[2] leaves\nwstring text\n',
        'other/msg/Leaf.msg': 'int32 n\n',
        'mine/msg/Lost.msg': 'nowhere/Type field\n',
    }.items():
        file = share / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return share


def test_a_type_of_another_project_is_defined_with_all_types_in_it(package):
    text, digest = MessageDefinitions().of('mine/msg/Thing', DIGEST)
    assert digest == DIGEST
    assert set(get_types_from_msg(text, 'mine/msg/Thing')) == {
        'mine/msg/Thing', 'mine/msg/Part', 'other/msg/Leaf'
    }
    assert '# a Comment line' in text


@pytest.mark.parametrize('name', ['mine/msg/Lost', 'mine/msg/None', 'nowhere/msg/Type'])
def test_a_type_that_is_not_installed_has_no_definition(package, name):
    assert installed_definition(name) == ''
    assert MessageDefinitions().of(name, 'INVALID') == ('', 'RIHS01_' + '0' * 64)


def test_a_type_that_rosbags_knows_is_defined_by_it():
    store = get_typestore(Stores.ROS2_JAZZY)
    text, digest = MessageDefinitions().of('sensor_msgs/msg/JointState', DIGEST)
    assert text == store.generate_msgdef('sensor_msgs/msg/JointState', ros_version=2)[0]
    assert digest == store.hash_rihs01('sensor_msgs/msg/JointState')
