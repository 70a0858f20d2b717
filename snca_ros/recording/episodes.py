"""Assigns the messages of a bag to the episodes of its simulation, without a clock."""

from collections.abc import Mapping, Sequence

import numpy as np

from snca_ros.recording.streams import KINDS, Stream
from snca_ros.recording.topics import APPLIED, CLOCK, ODOMETRY, Role

_NONE = -1
_REACH = 1000  # control steps by which odometry may lie beyond what is assigned already


def number_episodes(streams: Mapping[Role, Stream]) -> tuple[int, dict[Role, np.ndarray]]:
    """Return how many episodes there are, and each message's episode, from 0; -1 for none.

    The simulation names its episode in what it publishes for the voxels, and voxels repeat it. A
    message without a name belongs to the episode whose message of the same step is nearest. In bags
    that are older than these names an episode begins where the step of the odometry goes back.

    Args:
        streams: of one robot, by role; its odometry is not empty.
    """
    found = _named_episodes(streams)
    if found is None:
        return _numbered_by_resets(streams)
    names, of_odometry = found
    odometry, numbers = streams[ODOMETRY], {ODOMETRY: of_odometry}
    known = {name: number for number, name in enumerate(names)}
    for role, stream in streams.items():
        if role == ODOMETRY:
            continue
        near = _nearest(odometry, stream)
        same_step = near >= 0
        near[~same_step] = nearest_of_any_step(odometry, stream.order)[~same_step]
        number = of_odometry[near]
        if KINDS[role.kind].of_episode:
            own = np.array([known.get(name, _NONE) for name in stream.names.tolist()], dtype=int)
            number = np.where(stream.names == b'', number, own)
        numbers[role] = number
    return len(names), numbers


def _named_episodes(streams: Mapping[Role, Stream]) -> tuple[list[bytes], np.ndarray] | None:
    """Return the names of the episodes in their order, and the episode of each odometry message.

    Each topic of sensors has a vote on an odometry message: the name of its nearest message of the
    same step. So one stranger cannot forge an episode. At the last step there are no sensors: the
    actuation that led there decides, or the sensors before.

    Returns:
        None if the messages have no names, or if one name stands for several episodes.
    """
    odometry = streams[ODOMETRY]
    sensors = [stream for role, stream in streams.items() if role.kind == 'sensors']
    applied = [stream for role, stream in streams.items() if role == APPLIED]
    voters = [*sensors, *applied]
    said = np.concatenate([np.zeros(0, 'S'), *(voter.names for voter in voters)])
    names, counts = np.unique(said[said != b''], return_counts=True)
    if not len(names):
        return None
    number = np.full(len(odometry.steps), _NONE)
    for asked, back in ((sensors, 0), (applied, 1), (sensors, 1)):
        number = np.where(number >= 0, number, _elected(asked, odometry, names, counts, back))
    number = _extended(odometry, number)
    if any(_has_resets(odometry.steps[number == i]) for i in range(len(names))):
        # One message that is repeated later is no reset, which other topics show, too.
        others = [s.steps for s in voters] + [s.steps for r, s in streams.items() if r == CLOCK]
        if any(_has_resets(steps) for steps in others):
            return None
    first = {i: int(np.argmax(number == i)) for i in range(len(names)) if (number == i).any()}
    in_order = sorted(first, key=lambda i: first[i])
    new = np.full(len(names) + 1, _NONE)  # the last item is that of -1
    new[in_order] = np.arange(len(in_order))
    return ([bytes(names[i]) for i in in_order], new[number]) if in_order else None


def _elected(
    voters: Sequence[Stream], odometry: Stream, names: np.ndarray, counts: np.ndarray, back: int
) -> np.ndarray:
    """Return the index of the name that most voters give each odometry message; -1 for none.

    Of several such names the one with the largest of `counts` is taken.
    """
    votes = np.zeros((len(odometry.steps), len(names)))
    for voter in voters:
        near = _nearest(voter, odometry, back)
        voted = np.flatnonzero(near >= 0)
        voted = voted[voter.names[near[voted]] != b'']
        votes[voted, np.searchsorted(names, voter.names[near[voted]])] += 1
    preferred = votes + counts / (1.0 + counts.sum())  # less than a vote
    return np.where(votes.any(axis=1), preferred.argmax(axis=1), _NONE)


def _extended(odometry: Stream, number: np.ndarray) -> np.ndarray:
    """Return the numbers with those of odometry near an assigned message, by order and step."""
    assigned = np.flatnonzero(number >= 0)
    if not len(assigned):
        return number
    known = odometry.select(assigned)
    near = nearest_of_any_step(known, odometry.order)
    close = np.abs(known.steps[near] - odometry.steps) <= _REACH
    return np.where(number >= 0, number, np.where(close, number[assigned][near], _NONE))


def _has_resets(steps: np.ndarray) -> bool:
    """Return whether steps go back and some of them are repeated."""
    return bool((np.diff(steps) < 0).any()) and len(np.unique(steps)) < len(steps)


def _numbered_by_resets(streams: Mapping[Role, Stream]) -> tuple[int, dict[Role, np.ndarray]]:
    """Return what `number_episodes` does, from the resets of the odometry.

    A reset takes effect at a different time on every topic: a late answer may be recorded after
    the odometry of step 0. So messages are assigned in runs of increasing steps: a run belongs
    to the episode in which its first message was recorded.
    """
    odometry = streams[ODOMETRY]
    starts = _starts(odometry.steps)
    resets = odometry.order[starts[1:] - 1]  # the last odometry before each reset
    numbers = {}
    for role, stream in streams.items():
        begin = _starts(stream.steps)
        lengths = np.diff(begin, append=len(stream.steps))
        numbers[role] = np.repeat(np.searchsorted(resets, stream.order[begin]), lengths)
    return len(starts), numbers


def _starts(steps: np.ndarray) -> np.ndarray:
    """Return the index of the first message and of each message whose step goes back."""
    return np.flatnonzero(np.diff(steps, prepend=np.iinfo(np.int64).max) < 0)


def one_episode(
    stream: Stream, mine: np.ndarray, odometry: Stream | None = None
) -> Stream:
    """Return the messages of one episode, one per control step, in the order of steps.

    Of several messages of a step the first is kept; of those without a name, such as those of two
    robots on /clock, the one that is nearest to the odometry of the step.

    Args:
        stream: messages of any episodes.
        mine: (n,) bool, which of them are of this episode.
        odometry: of the episode, if it is known.
    """
    kept = np.flatnonzero(mine)
    if odometry is None or stream.names.any():
        rank = np.arange(len(kept))
    else:
        near = _nearest(odometry, stream.select(kept))
        rank = np.abs(stream.order[kept] - odometry.order[near])
    kept = kept[np.lexsort((rank, stream.steps[kept]))]
    _, first = np.unique(stream.steps[kept], return_index=True)
    return stream.select(kept[first])


def _nearest(among: Stream, of: Stream, back: int = 0) -> np.ndarray:
    """Return, for each message of a stream, the nearest of `among` whose step is the same.

    Args:
        among: the messages to choose from.
        of: (n,) messages.
        back: 1 for the last message of one step before that was recorded earlier.

    Returns:
        (n,) indices; -1 where there is none.
    """
    if not len(among.steps):
        return np.full(len(of.steps), -1)
    by_step = np.lexsort((among.order, among.steps))
    steps, order = among.steps[by_step], among.order[by_step]
    span = 1 + max(int(among.order.max()), int(of.order.max(initial=0)))
    keys = _ranks(steps) * span + order
    wanted = of.steps - back
    rank = np.searchsorted(np.unique(steps), wanted)
    after = np.searchsorted(keys, rank * span + of.order)
    best = np.full(len(wanted), -1)
    distance = np.full(len(wanted), np.iinfo(np.int64).max)
    for i in (after - 1,) if back else (after - 1, after):
        inside = np.clip(i, 0, len(keys) - 1)
        far = np.abs(order[inside] - of.order)
        better = (i == inside) & (steps[inside] == wanted) & (far < distance)
        best[better], distance[better] = by_step[inside[better]], far[better]
    return best


def _ranks(steps: np.ndarray) -> np.ndarray:
    """Return the rank of each step among the different steps, which keeps numbers small."""
    return np.unique(steps, return_inverse=True)[1]


def nearest_of_any_step(among: Stream, order: np.ndarray) -> np.ndarray:
    """Return, for each of (n,) places in a bag, the index of the nearest of `among`, not empty."""
    after = np.searchsorted(among.order, order)
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, len(among.order) - 1)
    return np.where(order - among.order[before] <= among.order[after] - order, before, after)
