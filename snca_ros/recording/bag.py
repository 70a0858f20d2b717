"""Reads one episode of a bag as a `Recording`."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from sim_node.episode import UNKNOWN_PHYSICS, physics_of_episode
from sim_node.errors import InvalidInput
from sim_node.model.sensors import DEFAULT_SENSORS
from snca_ros.recording.diagnostics import NodeHealth, read_health
from snca_ros.recording.poses import read_poses
from snca_ros.recording.recording import Recording, TopicCount
from snca_ros.recording.storage import Topic, read_storage
from snca_ros.recording.streams import KINDS, Stream, decode

_VOXEL_TOPIC = re.compile(r'/(voxel_\d+_\d+)/(sensors|actuation|spikes|values)')


def read_bag(path: Path | str, episode: int = -1) -> Recording:
    """Read one episode of the bag at `path`.

    Args:
        path: a rosbag2 folder, MCAP or sqlite3.
        episode: number of the episode, from 0; negative numbers count from the end.

    Raises:
        InvalidInput: this is no bag, it is damaged, it is not the bag of one robot, or there is no
            such episode. The text names the bag, what is wrong and what was expected.
    """
    path = Path(path)
    topics, closed = read_storage(path)
    try:
        robot = robot_of(topics)
        kinds = _stamped_kinds(topics, robot)
        streams = {name: decode(name, topics[name], kind) for name, kind in kinds.items()}
        walked = int(streams[f'/{robot}/odometry'].steps.max(initial=0))
        streams = {name: stream.until(walked) for name, stream in streams.items()}
        reference = streams[f'/{robot}/odometry']
        episode, n_episodes, streams = _one_episode(streams, f'/{robot}/odometry', episode)
        health = read_health(topics, robot)
        needed = {_clock(topics, robot), *_topics_of_voxels(robot, streams, health)}
        for name in needed - set(streams):
            streams[name] = Stream.empty(KINDS[name.rpartition('/')[2]])
        arrays = _arrays(robot, streams)
        poses = None
        if f'/{robot}/markers' in topics:
            poses = read_poses(
                topics[f'/{robot}/markers'], streams[f'/{robot}/odometry'],
                _bounds(reference, episode), len(arrays['voxel_names']),
            )
    except InvalidInput as error:
        raise error.found_in(str(path)) from None
    return Recording(
        path=path, closed=closed, robot=robot, episode=episode, n_episodes=n_episodes,
        rate=_rate(streams[f'/{robot}/odometry']),
        counts=_counts(topics, streams, len(arrays['centers'])), health=health, poses=poses,
        physics=_physics(streams), **arrays,
    )


def _physics(streams: dict[str, Stream]) -> str:
    """Return the physics that most of the voxels' messages name; some messages may be forged."""
    names = [s.names for topic, s in streams.items() if _VOXEL_TOPIC.search(topic)]
    found, counts = np.unique(np.concatenate([np.zeros(0, 'S'), *names]), return_counts=True)
    return physics_of_episode(bytes(found[counts.argmax()])) if len(found) else UNKNOWN_PHYSICS


def _bounds(odometry: Stream, episode: int) -> tuple[float, float]:
    """Return the wall times [ns] between which the messages of an episode were recorded."""
    starts = odometry.starts()[1:]
    edges = (odometry.times[starts - 1] + odometry.times[starts]) / 2
    edges = np.concatenate([[-np.inf], edges, [np.inf]])
    return edges[episode], edges[episode + 1]


def robot_of(topics: dict[str, Topic]) -> str:
    """Return the namespace of the robot of a bag.

    Raises:
        InvalidInput: the bag has the odometry of no robot, or of several.
    """
    kind, end = KINDS['odometry'].type, '/odometry'
    found = [
        name[1 : -len(end)] for name, topic in topics.items()
        if name.endswith(end) and topic.type == kind and topic.messages
    ]
    # Other nodes may publish their own odometry below the robot's namespace.
    found = [name for name in found if not any(name.startswith(f'{other}/') for other in found)]
    if len(found) != 1:
        shown = f'odometry of {", ".join(found) or "no robot"} in {len(topics)} topics'
        raise InvalidInput('robot', shown, f'one topic /<robot>/odometry of type {kind}')
    return found[0]


def _stamped_kinds(topics: dict[str, Topic], robot: str) -> dict[str, str]:
    """Return the robot's topics whose stamps are control steps: kind by name."""
    kinds = {f'/{robot}/odometry': 'odometry'}
    for name in topics:
        match = _VOXEL_TOPIC.fullmatch(name.removeprefix(f'/{robot}'))
        if name == _clock(topics, robot):
            kinds[name] = 'clock'
        elif match and name.startswith(f'/{robot}/'):
            kinds[name] = match[2]
    if len({'spikes', 'values'} & set(kinds.values())) == 2:
        raise InvalidInput('messages of cells', 'spikes and values', 'only one of them')
    return kinds


def _one_episode(
    streams: dict[str, Stream], odometry: str, episode: int
) -> tuple[int, int, dict[str, Stream]]:
    """Return the number of the episode, how many there are, and the episode's streams."""
    reference = streams[odometry]
    starts = reference.starts()
    n_episodes = len(starts)
    if not -n_episodes <= episode < n_episodes:
        raise InvalidInput('episode', episode, f'a number from 0 to {n_episodes - 1}')
    number, resets = episode % n_episodes, reference.times[starts[1:] - 1]
    return number, n_episodes, {k: s.episode(number, resets) for k, s in streams.items()}


def _topics_of_voxels(
    robot: str, streams: dict[str, Stream], health: dict[str, NodeHealth]
) -> set[str]:
    """Return the stamped topics that this robot must have, by its voxels."""
    by_health = {f'/{robot}/{node}/sensors' for node in health}
    voxels = _voxel_names({*streams, *by_health})
    kinds = {name.rpartition('/')[2] for name in streams} & {'spikes', 'values'}
    expected = {
        f'/{robot}/{voxel}/{kind}' for voxel in voxels for kind in ('sensors', 'actuation', *kinds)
    }
    return expected


def _clock(topics: dict[str, Topic], robot: str) -> str:
    """Return the topic of the robot's simulated time, which may have a topic of its own."""
    own = f'/{robot}/clock'
    return own if own in topics else '/clock'


def _arrays(robot: str, streams: dict[str, Stream]) -> dict[str, Any]:
    """Return the arrays of a `Recording`, and the names of its voxels and sensors."""
    n_steps = _n_steps(streams)
    voxels = _voxel_names(streams)
    if not voxels:
        raise InvalidInput('voxels', None, f'topics /{robot}/voxel_<x>_<y>/sensors')

    def streams_of(kind: str) -> dict[int, Stream]:
        found = {i: streams.get(f'/{robot}/{voxel}/{kind}') for i, voxel in enumerate(voxels)}
        return {i: stream for i, stream in found.items() if stream and len(stream.steps)}

    def table(kind: str, shape: tuple[int, ...], missing: float = np.nan) -> np.ndarray:
        out = np.full((n_steps, len(voxels), *shape), missing)
        for i, stream in streams_of(kind).items():
            out[stream.steps, i] = stream.numbers
        return out

    odometry = streams[f'/{robot}/odometry']
    centers = np.full((n_steps, 2), np.nan)
    centers[odometry.steps] = odometry.numbers
    spikes = values = None
    heard = np.zeros((n_steps, len(voxels)), dtype=bool)
    for kind in ('spikes', 'values'):
        found = streams_of(kind)
        for i, stream in found.items():
            heard[stream.steps, i] = True
        shapes = {stream.numbers.shape[1:] for stream in found.values()}
        if len(shapes) > 1:
            raise InvalidInput(kind, f'shapes {sorted(shapes)}', 'the same shape in all voxels')
        if shapes and kind == 'spikes':
            spikes = table(kind, shapes.pop(), 0.0).astype(np.uint8)
        elif shapes:
            values = table(kind, shapes.pop())[..., 0]
    named = {stream.fields for stream in streams_of('sensors').values()} or {DEFAULT_SENSORS}
    if len(named) > 1:
        raise InvalidInput('sensors', sorted(map(list, named)), 'the same names in all voxels')
    sensors = named.pop()
    return {
        'voxel_names': voxels, 'centers': centers, 'sensors': sensors,
        'readings': table('sensors', (len(sensors),)),
        'actuation': table('actuation', (1,))[..., 0], 'spikes': spikes, 'values': values,
        'heard': heard,
    }


def _n_steps(streams: dict[str, Stream]) -> int:
    last = max(int(stream.steps.max(initial=0)) for stream in streams.values())
    longest = max(len(stream.steps) for stream in streams.values())
    if last > 1000 + 100 * longest:
        raise InvalidInput('stamps', f'step {last}', f'most of its steps in the bag, not {longest}')
    return last + 1


def _voxel_names(streams: Iterable[str]) -> tuple[str, ...]:
    """Return the voxels' names, row by row from the bottom."""
    names = {match[1] for name in streams if (match := _VOXEL_TOPIC.search(name))}
    return tuple(sorted(names, key=lambda name: [int(n) for n in name.split('_')[:0:-1]]))


def _rate(odometry: Stream) -> float:
    steps, seconds = np.ptp(odometry.steps), np.ptp(odometry.times) / 1e9
    return float(steps / seconds) if seconds > 0 else float('nan')


def _counts(
    topics: dict[str, Topic], streams: dict[str, Stream], n_steps: int
) -> tuple[TopicCount, ...]:
    """Count the messages of each topic; a message of the last step is not counted as lost."""
    counts = []
    for name in sorted({*topics, *streams}):
        if name in streams:
            steps = streams[name].steps
            missing = np.setdiff1d(np.arange(n_steps - 1), steps)
            counts.append(TopicCount(name, len(steps), missing, streams[name].refused))
        else:
            counts.append(TopicCount(name, len(topics[name].messages)))
    return tuple(counts)
