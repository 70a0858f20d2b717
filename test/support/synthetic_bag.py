"""Bags written as the recorder writes them, without ROS."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from sim_node.control_time import stamp_of_step
from sim_node.model.sensors import DEFAULT_SENSORS

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types
STORAGES = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}
STEP_TIME = 2_000_000  # wall time of a control step [ns]: 500 steps/s

Message = tuple[str, object]
"""Topic and message."""


@dataclass(frozen=True)
class Walk:
    """Numbers of a walk; shapes as in `snca_ros.recording.bag.Recording`, messages per voxel."""

    voxels: tuple[str, ...]
    centers: np.ndarray  # (n + 1, 2)
    readings: np.ndarray  # (n, n_voxels, n_sensors)
    actuation: np.ndarray  # (n, n_voxels)
    spikes: np.ndarray | None = None  # (n, n_voxels, n_channels, 16)
    values: np.ndarray | None = None  # (n, n_voxels, n_channels)
    corners: np.ndarray | None = None  # (n + 1, n_voxels, 4, 2)
    ground: np.ndarray | None = None  # (n_points, 2)
    episode: str = 'r5f0c17e'  # its name; empty in bags that are older than names of episodes
    sensors: tuple[str, ...] = DEFAULT_SENSORS
    ages: np.ndarray | None = None  # (n, n_voxels) of the answers; None in older bags
    applied: np.ndarray | None = None  # (n, n_voxels), None if it is the actuation
    body: str = 'biped'  # child_frame_id of the odometry


def make_walk(
    n_steps: int = 60, voxels: tuple[str, ...] = ('voxel_0_0', 'voxel_1_0'), seed: int = 0,
    **changes: object,
) -> Walk:
    """Return a walk of random numbers, 4 spike channels."""
    rng, n = np.random.default_rng(seed), len(voxels)
    walk = Walk(
        voxels,
        centers=rng.normal(size=(n_steps + 1, 2)).cumsum(axis=0),
        readings=rng.uniform(size=(n_steps, n, 4)),
        actuation=rng.uniform(-1, 1, size=(n_steps, n)),
        spikes=rng.integers(0, 2, size=(n_steps, n, 4, 16), dtype=np.uint8),
    )
    return replace(walk, **changes)


def _header(step: int, frame: str):
    stamp = TYPES['builtin_interfaces/msg/Time'](*stamp_of_step(step))
    return TYPES['std_msgs/msg/Header'](stamp=stamp, frame_id=frame)


def joint_state(
    step: int, frame: str, names: Iterable[str], position: np.ndarray,
    effort: np.ndarray | None = None,
):
    none = np.zeros(0)
    effort = none if effort is None else np.array(effort, dtype=float)
    return TYPES['sensor_msgs/msg/JointState'](
        _header(step, frame), list(names), np.atleast_1d(position), none, effort
    )


def image(step: int, frame: str, encoding: str, pixels: np.ndarray):
    height, width = pixels.shape
    data = np.frombuffer(np.ascontiguousarray(pixels).tobytes(), np.uint8)
    return TYPES['sensor_msgs/msg/Image'](
        _header(step, frame), height, width, encoding, 0, len(data) // height, data
    )


def odometry(step: int, center: np.ndarray, body: str = 'biped'):
    vector = TYPES['geometry_msgs/msg/Vector3'](0.0, 0.0, 0.0)
    pose = TYPES['geometry_msgs/msg/Pose'](
        TYPES['geometry_msgs/msg/Point'](center[0], 0.0, center[1]),
        TYPES['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0),
    )
    none = np.zeros(36)
    return TYPES['nav_msgs/msg/Odometry'](
        _header(step, 'world'), body,
        TYPES['geometry_msgs/msg/PoseWithCovariance'](pose, none),
        TYPES['geometry_msgs/msg/TwistWithCovariance'](
            TYPES['geometry_msgs/msg/Twist'](vector, vector), none
        ),
    )


def _marker(namespace: str, places: np.ndarray):
    point, vector = TYPES['geometry_msgs/msg/Point'], TYPES['geometry_msgs/msg/Vector3']
    black = TYPES['std_msgs/msg/ColorRGBA'](0.0, 0.0, 0.0, 1.0)
    pose = TYPES['geometry_msgs/msg/Pose'](
        point(0.0, 0.0, 0.0), TYPES['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0)
    )
    return TYPES['visualization_msgs/msg/Marker'](
        header=_header(0, 'world'), ns=namespace, id=0, type=11, action=0, pose=pose,
        scale=vector(1.0, 1.0, 1.0), color=black,
        lifetime=TYPES['builtin_interfaces/msg/Duration'](0, 0), frame_locked=False,
        points=[point(x, 0.0, y) for x, y in places.tolist()], colors=[],
        texture_resource='', texture=TYPES['sensor_msgs/msg/CompressedImage'](
            _header(0, ''), '', np.zeros(0, np.uint8)
        ),
        uv_coordinates=[], text='', mesh_resource='',
        mesh_file=TYPES['visualization_msgs/msg/MeshFile']('', np.zeros(0, np.uint8)),
        mesh_use_embedded_materials=False,
    )


def clock(step: int):
    return TYPES['rosgraph_msgs/msg/Clock'](
        TYPES['builtin_interfaces/msg/Time'](*stamp_of_step(step))
    )


def markers(points: Mapping[str, np.ndarray]):
    """Return a marker per namespace, with its (n, 2) points."""
    return TYPES['visualization_msgs/msg/MarkerArray'](
        [_marker(namespace, places) for namespace, places in points.items()]
    )


def diagnostics(node: str, figures: Mapping[str, object], process: str = 'host:1'):
    pairs = [
        TYPES['diagnostic_msgs/msg/KeyValue'](key, str(value)) for key, value in figures.items()
    ]
    status = TYPES['diagnostic_msgs/msg/DiagnosticStatus'](0, node, 'fine', process, pairs)
    return TYPES['diagnostic_msgs/msg/DiagnosticArray'](_header(0, ''), [status])


def messages_of_step(walk: Walk, step: int, robot: str = 'biped') -> list[Message]:
    """Return the messages that the graph publishes in control step `step`."""
    out = [
        ('/clock', clock(step)),
        (f'/{robot}/odometry', odometry(step, walk.centers[step], walk.body)),
    ]
    if walk.ages is not None and step > 0:
        applied = walk.actuation if walk.applied is None else walk.applied
        out.insert(0, (f'/{robot}/applied_actuation', joint_state(
            step - 1, f'{robot}@{walk.episode}', walk.voxels, applied[step - 1],
            walk.ages[step - 1],
        )))
    if step % 2 == 0:
        points = {} if walk.corners is None else {
            'voxels': walk.corners[step][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 2)
        }
        out.append((f'/{robot}/markers', markers(points)))
    if step % 60 == 0 and walk.ground is not None:
        out.append((f'/{robot}/markers', markers({'ground': walk.ground})))
    if step == len(walk.actuation):
        return out
    frames = [f'{voxel}@{walk.episode}' if walk.episode else voxel for voxel in walk.voxels]
    for i, (voxel, frame) in enumerate(zip(walk.voxels, frames, strict=True)):
        out.append((
            f'/{robot}/{voxel}/sensors',
            joint_state(step, frame, walk.sensors, walk.readings[step, i]),
        ))
    for i, (voxel, frame) in enumerate(zip(walk.voxels, frames, strict=True)):
        if walk.spikes is not None:
            pixels = walk.spikes[step, i] * np.uint8(255)
            out.append((f'/{robot}/{voxel}/spikes', image(step, frame, 'mono8', pixels)))
        if walk.values is not None:
            pixels = walk.values[step, i][:, None]
            out.append((f'/{robot}/{voxel}/values', image(step, frame, '64FC1', pixels)))
        a = walk.actuation[step, i]
        out.append((f'/{robot}/{voxel}/actuation', joint_state(step, frame, [voxel], a)))
    return out


def messages_of_walk(walk: Walk, robot: str = 'biped') -> list[list[Message]]:
    """Return the messages that the graph publishes, by step."""
    return [messages_of_step(walk, k, robot) for k in range(len(walk.centers))]


def death(n_steps: int, voxel: int, dead: int, backlog: int, alive: int) -> list[list[Message]]:
    """Return the messages of a walk in real time, in which a voxel dies and is restarted.

    It answers the steps before `dead`, and from step `alive` on. At that step it also answers,
    late, those since `backlog`. The simulation holds its last answer for two steps.
    """
    walk = make_walk(n_steps)
    steps = np.arange(n_steps)
    gone = (steps >= dead) & (steps < alive)
    ages = np.zeros(walk.actuation.shape)
    ages[gone, voxel] = np.where(steps - dead < 2, steps - dead + 1, -1)[gone]
    applied = walk.actuation.copy()
    applied[gone, voxel] = np.where(steps - dead < 2, walk.actuation[dead - 1, voxel], 0.0)[gone]
    messages = messages_of_walk(replace(walk, ages=ages, applied=applied))
    late: list[Message] = []
    for k in np.flatnonzero(gone):
        answers = [
            m for m in messages[k]
            if f'/{walk.voxels[voxel]}/' in m[0] and not m[0].endswith('/sensors')
        ]
        messages[k] = [m for m in messages[k] if all(m is not answer for answer in answers)]
        late += answers if k >= backlog else []
    messages[alive] += late
    return messages


def write_messages(
    path: Path,
    steps: Iterable[list[Message]],
    storage: str = 'mcap',
    killed: bool = False,
    silent: Mapping[str, str] = MappingProxyType({}),
    clock_error: Callable[[int], int] = lambda k: 0,
) -> Path:
    """Write messages, step by step, into a new bag; `silent` topics have a type and no message.

    `clock_error` returns by how much the clock of the recorder is wrong in a step [ns]. A message
    may also be the bytes of one, as a pair with its type.

    With `killed` it is left as a recorder leaves it that is killed: a chunk for each step, and half
    a record.
    """
    writer = Writer(path, version=9, storage_plugin=STORAGES[storage])
    writer.open()
    connections = {
        (topic, kind): writer.add_connection(topic, kind, typestore=STORE)
        for topic, kind in silent.items()
    }
    for k, messages in enumerate(steps):
        for i, (topic, message) in enumerate(messages):
            if isinstance(message, tuple):
                data, kind = message
            else:
                kind = message.__msgtype__
                data = STORE.serialize_cdr(message, kind)
            if (topic, kind) not in connections:
                connections[topic, kind] = writer.add_connection(topic, kind, typestore=STORE)
            time = 10**18 + k * STEP_TIME + i + clock_error(k)
            writer.write(connections[topic, kind], time, data)
        if killed:
            writer.storage.close_chunk()
    if killed:
        writer.storage.bio.write(b'\x06\x00\x01')
        writer.storage.bio.close()
    else:
        writer.close()
    return path


def count_of(recording, topic):
    """Return the message counts of one topic."""
    return next(count for count in recording.counts if count.topic == topic)
