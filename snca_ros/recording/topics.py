"""Finds the topics of one robot in a bag, by their declared names or by their content."""

import re
from collections.abc import Mapping
from itertools import islice
from typing import Any, NamedTuple

from sim_node.control_time import step_of_stamp
from sim_node.errors import InvalidInput
from snca_ros.recording.storage import Topic
from snca_ros.recording.streams import KINDS, types

MARKERS_TYPE = 'visualization_msgs/msg/MarkerArray'

_VOXEL = r'voxel_\d+_\d+'
_VOXEL_TOPIC = re.compile(rf'(.*)/({_VOXEL})/(sensors|actuation|spikes|values)')
_OF_ROBOT = ('odometry', 'markers', 'applied_actuation', 'clock')
_TRIED = 10  # messages of a topic whose content is examined


class Role(NamedTuple):
    """What a topic is for: its kind, one of `KINDS` or 'markers', and the voxel it belongs to."""

    kind: str
    voxel: str = ''


ODOMETRY, CLOCK, MARKERS = Role('odometry'), Role('clock'), Role('markers')
APPLIED = Role('applied_actuation')


def declared_name(robot: str, role: Role) -> str:
    """Return the name of a topic of a robot that is not remapped."""
    if role == CLOCK:
        return '/clock'
    return '/' + '/'.join(filter(None, [robot, role.voxel, role.kind]))


def voxel_names(roles: Mapping[Role, object], others: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the names of all voxels that have a role or are among `others`.

    They are in the morphology's order, row by row from the bottom.
    """
    names = {role.voxel for role in roles if role.voxel}
    names |= {name for name in others if re.fullmatch(_VOXEL, name)}
    return tuple(sorted(names, key=lambda name: [int(n) for n in name.split('_')[:0:-1]]))


def find_topics(topics: Mapping[str, Topic]) -> tuple[str, dict[Role, str]]:
    """Return the namespace of the robot of a bag, and the names of its topics by role.

    A declared name has precedence over the content of a remapped topic.

    Raises:
        InvalidInput: the bag has the odometry of no robot, or of several.
    """
    odometry = _odometry(topics)
    robot = _robot(odometry, topics)
    found: dict[Role, str] = {ODOMETRY: odometry}
    for name in topics:
        match = _VOXEL_TOPIC.fullmatch(name)
        if match and match[1] == f'/{robot}':
            found[Role(match[3], match[2])] = name
    for kind in _OF_ROBOT:
        if f'/{robot}/{kind}' in topics:
            found.setdefault(Role(kind), f'/{robot}/{kind}')
    if '/clock' in topics:
        found.setdefault(CLOCK, '/clock')
    taken = {*found.values()}
    for name, topic in topics.items():
        unknown = name not in taken and not _VOXEL_TOPIC.fullmatch(name)
        if unknown and (role := role_by_content(topic)):
            found.setdefault(role, name)
    return robot, found


def _odometry(topics: Mapping[str, Topic]) -> str:
    """Return the name of the only robot's odometry."""
    kind, end = KINDS['odometry'].type, '/odometry'
    candidates = [n for n, topic in topics.items() if topic.type == kind and topic.messages]
    spaces = {name.removesuffix(end) for name in candidates if name.endswith(end)}
    # Other nodes may publish their own odometry below the robot's namespace.
    spaces = {s for s in spaces if not any(s.startswith(f'{other}/') for other in spaces)}
    declared = [f'{space}{end}' for space in sorted(spaces)]
    remapped = [
        name for name in candidates
        if not any(name.startswith(f'{space}/') for space in spaces)
        and role_by_content(topics[name]) == ODOMETRY
    ]
    found = [*declared, *remapped]
    if len(found) != 1:
        robots = ', '.join(name.removesuffix(end)[1:] for name in found)
        shown = f'odometry of {robots or "no robot"} in {len(topics)} topics'
        raise InvalidInput('robot', shown, f'one topic /<robot>/odometry of type {kind}')
    return found[0]


def _robot(odometry: str, topics: Mapping[str, Topic]) -> str:
    """Return the robot's namespace: that of its voxels if its odometry is remapped."""
    space = odometry.rpartition('/')[0]
    spaces = {match[1] for name in topics if (match := _VOXEL_TOPIC.fullmatch(name))}
    if not odometry.endswith('/odometry') and space not in spaces and len(spaces) == 1:
        space = spaces.pop()
    return space[1:]


def role_by_content(topic: Topic) -> Role | None:
    """Return the role of a topic by its type and its first messages; None if it has none."""
    known = {kind.type for kind in KINDS.values()} | {MARKERS_TYPE}
    for data in islice(topic.messages, _TRIED if topic.type in known else 0):
        try:
            role = _role_of_message(types().deserialize_cdr(data, topic.type))
        except Exception:  # rosbags raises various ones for bytes of another layout
            continue
        if role:
            return role
    return None


def _role_of_message(message: Any) -> Role | None:
    kind = message.__msgtype__
    if kind == KINDS['clock'].type:
        return CLOCK
    if kind == MARKERS_TYPE:
        return MARKERS if any(marker.ns == 'voxels' for marker in message.markers) else None
    stamp, (sender, _, _) = message.header.stamp, message.header.frame_id.partition('@')
    step_of_stamp(stamp.sec, stamp.nanosec)
    if kind == KINDS['odometry'].type:
        return ODOMETRY if sender == 'world' else None
    if kind == KINDS['spikes'].type:
        cells = {'mono8': 'spikes', '64FC1': 'values'}
        found = cells.get(message.encoding)
        return Role(found, sender) if found and re.fullmatch(_VOXEL, sender) else None
    names = list(message.name)
    if re.fullmatch(_VOXEL, sender):
        return Role('actuation' if names == [sender] else 'sensors', sender)
    are_voxels = names and all(re.fullmatch(_VOXEL, name) for name in names)
    return APPLIED if are_voxels and len(message.effort) == len(names) else None
