"""Reads one episode of a bag as a `Recording`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sim_node.episode import UNKNOWN_PHYSICS, physics_of_episode
from sim_node.errors import InvalidInput
from sim_node.model.sensors import DEFAULT_SENSORS
from snca_ros.recording.body import read_body
from snca_ros.recording.diagnostics import TOPIC as DIAGNOSTICS
from snca_ros.recording.diagnostics import NodeHealth, read_health
from snca_ros.recording.episodes import number_episodes, one_episode
from snca_ros.recording.kills import count_kills, lost_by_kills, published_twice
from snca_ros.recording.outcomes import Outcome, Outcomes, find_outcomes
from snca_ros.recording.poses import read_poses
from snca_ros.recording.recording import Recording, TopicCount
from snca_ros.recording.storage import Topic, read_storage
from snca_ros.recording.streams import KINDS, Stream, decode
from snca_ros.recording.topics import (
    APPLIED,
    CLOCK,
    MARKERS,
    ODOMETRY,
    Role,
    declared_name,
    find_topics,
    voxel_names,
)

_CELL_MESSAGES = ('spikes', 'values')


def read_bag(path: Path | str, episode: int = -1) -> Recording:
    """Read one episode of the bag at `path`.

    A message that is invalid is counted and left out; it never makes a bag unreadable.

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
        robot, names = find_topics(topics)
        found = _decoded(topics, names)
        odometry = found[ODOMETRY]
        n_episodes, numbers = number_episodes(found)
        if not -n_episodes <= episode < n_episodes:
            raise InvalidInput('episode', episode, f'a number from 0 to {n_episodes - 1}')
        episode %= n_episodes
        streams = _one_episode(found, numbers, episode)
        refused = {names[role]: stream.refused for role, stream in streams.items()}
        health, refused[DIAGNOSTICS] = read_health(topics, robot)
        voxels = _voxels(streams, health, robot)
        names |= _absent_topics(robot, streams, voxels)
        streams |= {role: Stream.empty(role.kind) for role in names.keys() - streams
                    if role.kind in KINDS}
        arrays = _arrays(streams, voxels)
        outcomes = find_outcomes(
            streams, voxels, len(arrays['centers']), _lock_step(health),
            rate := _rate(streams[ODOMETRY]), lost := _lost_answers(health, voxels),
        )
        kills = _kills(health, streams, voxels, len(arrays['centers']))
        twice = {role: published_twice(stream, numbers[role] == episode)
                 for role, stream in found.items() if role.kind in outcomes.late}
        poses = None
        if MARKERS in names:
            poses, refused[names[MARKERS]] = read_poses(
                topics[names[MARKERS]], odometry, numbers[ODOMETRY] == episode, len(voxels)
            )
    except InvalidInput as error:
        raise error.found_in(str(path)) from None
    cells_late = outcomes.late['spikes'] | outcomes.late['values']
    return Recording(
        path=path, closed=closed, robot=robot, episode=episode, n_episodes=n_episodes, rate=rate,
        counts=_counts(
            topics, names, streams, outcomes, voxels, refused, kills, twice, lost is not None
        ),
        health=health, body=read_body(topics[names[ODOMETRY]], voxels),
        poses=poses, physics=_physics(streams), applied=outcomes.applied,
        outcomes=outcomes.outcomes, late=cells_late,
        **{**arrays, 'heard': arrays['heard'] & ~cells_late},
    )


def _decoded(topics: Mapping[str, Topic], names: Mapping[Role, str]) -> dict[Role, Stream]:
    """Return the stamped topics of a robot, decoded.

    Raises:
        InvalidInput: no odometry is valid.
    """
    streams = {
        role: decode(topics[name], role.kind, role.voxel)
        for role, name in names.items() if role.kind in KINDS
    }
    odometry = streams[ODOMETRY]
    if not len(odometry.steps):
        raise InvalidInput(names[ODOMETRY], odometry.reason, KINDS['odometry'].type)
    return streams


def _one_episode(
    found: Mapping[Role, Stream], numbers: Mapping[Role, np.ndarray], episode: int
) -> dict[Role, Stream]:
    """Return the streams of one episode; messages of no episode, or after its end, are refused."""
    mine = {role: numbers[role] == episode for role in found}
    odometry = one_episode(found[ODOMETRY], mine[ODOMETRY])
    last = int(odometry.steps[-1])
    streams = {}
    for role, stream in found.items():
        kept = one_episode(stream, mine[role], odometry)
        strays = int((numbers[role] < 0).sum())
        streams[role] = kept.select(np.arange(len(kept.steps)), strays).until(last)
    return _one_kind_of_message(streams)


def _one_kind_of_message(streams: dict[Role, Stream]) -> dict[Role, Stream]:
    """Refuse the spikes if there are more values, and the other way round: a robot sends one."""
    sizes = {
        kind: sum(len(stream.steps) for role, stream in streams.items() if role.kind == kind)
        for kind in _CELL_MESSAGES
    }
    if not all(sizes.values()):
        return streams
    foreign = min(sizes, key=lambda kind: sizes[kind])
    return {
        role: stream if role.kind != foreign else stream.until(-1)
        for role, stream in streams.items()
    }


def _voxels(
    streams: Mapping[Role, Stream], health: Mapping[str, NodeHealth], robot: str
) -> tuple[str, ...]:
    """Return the voxels that a topic or the diagnostics name, in the morphology's order."""
    fields = streams[APPLIED].fields if APPLIED in streams else ()
    readable = {
        role: stream for role, stream in streams.items()
        if len(stream.steps) or not stream.reason.startswith('type ')
    }
    if voxels := voxel_names(readable, (*health, *fields)):
        return voxels
    reason = next((stream.reason for stream in streams.values() if stream.reason), None)
    raise InvalidInput('voxels', reason, f'topics /{robot}/voxel_<x>_<y>/sensors')


def _absent_topics(
    robot: str, streams: Mapping[Role, Stream], voxels: tuple[str, ...]
) -> dict[Role, str]:
    """Return the stamped topics that this robot has, by its voxels, and the bag does not."""
    sent = {role.kind for role, stream in streams.items()} & {*_CELL_MESSAGES}
    kinds = ('sensors', 'actuation', *sent)
    expected = [CLOCK, *(Role(kind, voxel) for voxel in voxels for kind in kinds)]
    return {role: declared_name(robot, role) for role in expected if role not in streams}


def _lock_step(health: Mapping[str, NodeHealth]) -> bool | None:
    """Return whether the simulation waited for the voxels; None if it does not say."""
    simulation = health.get('sim_node')
    return None if simulation is None else 'missed deadlines' not in simulation.values


def _lost_answers(
    health: Mapping[str, NodeHealth], voxels: tuple[str, ...]
) -> dict[str, int] | None:
    """Return how many answers of each voxel the simulation says that best-effort links have lost.

    Returns None if the links were reliable.
    """
    simulation = health.get('sim_node')
    if simulation is None or 'best-effort links' not in simulation.values:
        return None
    return {v: int(simulation.values.get(f'{v}/actuation lost', 0)) for v in voxels}


def _physics(streams: Mapping[Role, Stream]) -> str:
    """Return the physics that most of the voxels' messages name; some messages may be forged."""
    names = [stream.names for role, stream in streams.items() if role.voxel]
    found, counts = np.unique(np.concatenate([np.zeros(0, 'S'), *names]), return_counts=True)
    return physics_of_episode(bytes(found[counts.argmax()])) if len(found) else UNKNOWN_PHYSICS


def _arrays(streams: Mapping[Role, Stream], voxels: tuple[str, ...]) -> dict[str, Any]:
    """Return the arrays of a `Recording`, and the names of its voxels and sensors."""
    n_steps = _n_steps(streams)

    def streams_of(kind: str) -> dict[int, Stream]:
        found = {i: streams.get(Role(kind, voxel)) for i, voxel in enumerate(voxels)}
        return {i: stream for i, stream in found.items() if stream and len(stream.steps)}

    def table(kind: str, shape: tuple[int, ...], missing: float = np.nan) -> np.ndarray:
        out = np.full((n_steps, len(voxels), *shape), missing)
        for i, stream in streams_of(kind).items():
            out[stream.steps, i] = stream.numbers
        return out

    odometry = streams[ODOMETRY]
    centers = np.full((n_steps, 2), np.nan)
    centers[odometry.steps] = odometry.numbers
    spikes = values = None
    heard = np.zeros((n_steps, len(voxels)), dtype=bool)
    for kind in _CELL_MESSAGES:
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


def _n_steps(streams: Mapping[Role, Stream]) -> int:
    last = int(streams[ODOMETRY].steps[-1])
    longest = max(len(stream.steps) for stream in streams.values())
    if last > 1000 + 100 * longest:
        raise InvalidInput('stamps', f'step {last}', f'most of its steps in the bag, not {longest}')
    return last + 1


def _rate(odometry: Stream) -> float:
    """Return control steps per second of wall time, without times at which a clock was set back."""
    nanoseconds, steps = np.diff(odometry.times), np.diff(odometry.steps)
    forward = nanoseconds > 0
    seconds = nanoseconds[forward].sum() / 1e9
    return float(steps[forward].sum() / seconds) if seconds > 0 else float('nan')


def _kills(
    health: Mapping[str, NodeHealth], streams: Mapping[Role, Stream], voxels: tuple[str, ...],
    n_steps: int,
) -> dict[str, int]:
    """Return how often each voxel was killed at most, by its name."""
    kills = {}
    for voxel in voxels:
        sent = np.zeros(n_steps, dtype=bool)
        for role, stream in streams.items():
            if role.voxel == voxel and role.kind != 'sensors':
                sent[stream.steps] = True
        kills[voxel] = count_kills(health[voxel].n_processes if voxel in health else 1, sent)
    return kills


def _counts(
    topics: Mapping[str, Topic], names: Mapping[Role, str], streams: Mapping[Role, Stream],
    outcomes: Outcomes, voxels: tuple[str, ...], refused: Mapping[str, int],
    kills: Mapping[str, int], twice: Mapping[Role, np.ndarray], best_effort: bool,
) -> tuple[TopicCount, ...]:
    """Count the messages of each topic; a message of the last step is not counted as lost."""
    roles, counts = {name: role for role, name in names.items()}, []
    n_steps = len(outcomes.applied)
    for name in sorted({*topics, *roles}):
        role = roles.get(name)
        strange = refused.get(name, topics[name].foreign if name in topics else 0)
        if role is None or role not in streams:
            counts.append(TopicCount(name, len(topics[name].messages), refused=strange))
            continue
        steps = streams[role].steps
        missing = np.setdiff1d(np.arange(n_steps - 1), steps)
        late = unsent = killed = unheard = unrecorded = missing[:0]
        if role.kind in outcomes.late:
            i = voxels.index(role.voxel)
            late = np.flatnonzero(outcomes.late[role.kind][:, i])
            unsent = np.intersect1d(missing, np.flatnonzero(outcomes.unsent[:, i]))
        missing = np.setdiff1d(missing, unsent)
        if role.kind == 'actuation' and best_effort:
            unheard = np.flatnonzero(outcomes.unheard[:, i])
            unrecorded = missing[outcomes.outcomes[missing, i] == Outcome.IN_TIME]
        elif role.kind == 'actuation':
            killed = lost_by_kills(missing, outcomes.outcomes[:, i], kills[role.voxel])
        counts.append(TopicCount(
            name, len(steps), missing, strange, late, unsent, killed,
            twice.get(role, missing[:0]), unheard, unrecorded, role.kind,
        ))
    return tuple(counts)
