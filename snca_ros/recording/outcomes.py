"""What moved the body in each control step, and which messages came in time to count."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from snca_ros.recording.streams import Stream
from snca_ros.recording.topics import APPLIED, ODOMETRY, Role

HOLD_LIMIT = 0.25
"""Default of the simulation's `hold_limit` [s], for bags that do not say when a voxel was limp."""

_NEVER = np.iinfo(np.int64).max


class Outcome(IntEnum):
    """What became of a voxel's answer to the sensors of a control step."""

    IN_TIME = 0  # it moved the body
    HELD = 1  # it did not come in time: the voxel held an older one
    LIMP = 2  # no answer counted: the actuation was 0
    UNKNOWN = 3  # the bag does not say


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What moved the body, and which messages count; arrays are (n_steps, n_voxels).

    Attributes:
        applied: the actuation that moved the body; NaN where it is unknown.
        outcomes: `Outcome` of each answer, uint8.
        late: by kind of topic, which messages were recorded, but came too late to be used.
        unsent: which voxels sent nothing, for they were dead, had not joined yet, or did not
            receive the sensors.
        unheard: over best-effort links, which answers were recorded, but lost to the simulation.
    """

    applied: np.ndarray
    outcomes: np.ndarray
    late: dict[str, np.ndarray]
    unsent: np.ndarray
    unheard: np.ndarray


def find_outcomes(
    streams: Mapping[Role, Stream], voxels: tuple[str, ...], n_steps: int,
    lock_step: bool | None, rate: float, lost: Mapping[str, int] | None = None,
) -> Outcomes:
    """Return what moved the body, and which messages came in time.

    The simulation says what it applied and how old it was, in `applied_actuation`. In older bags an
    answer counts as late if it was recorded after the odometry of the next step; in real time the
    simulation then holds the newest answer for `HOLD_LIMIT`. A cell's message is sent before its
    answer, so it is in time if that is, and neighbours use it in the next step.

    Args:
        streams: of one episode, by role.
        voxels: their names.
        n_steps: number of control steps.
        lock_step: whether the simulation waited for answers; None if it is unknown.
        rate: control steps per second of wall time.
        lost: how many answers of each voxel the simulation did not receive over best-effort links;
            None for reliable ones. As many that were recorded in time, and not used, were lost.
    """
    shape = n_steps, len(voxels)
    # In lock-step the answer that the simulation waited for may be recorded just after its step.
    deadlines = _deadlines(streams[ODOMETRY], n_steps, 1 if lock_step else 0)
    sent, late = {}, {}
    for kind in ('actuation', 'spikes', 'values'):
        sent[kind], late[kind] = np.zeros(shape, bool), np.zeros(shape, bool)
        for i, voxel in enumerate(voxels):
            if stream := streams.get(Role(kind, voxel)):
                sent[kind][stream.steps, i] = True
                late[kind][stream.steps, i] = stream.order > deadlines[stream.steps]
    silent, unheard = ~np.logical_or.reduce([*sent.values()]), np.zeros(shape, bool)
    if APPLIED in streams and len(streams[APPLIED].steps):
        applied, ages = _applied(streams[APPLIED], voxels, shape)
        known = np.isfinite(ages)
        in_time, evident = ages == 0, _answered(ages)
        for kind in late:
            late[kind] &= ~in_time
        unused = sent['actuation'] & known & ~in_time
        if lost is not None:
            unheard = unused & ~late['actuation'] & ~evident
            absent = (~sent['actuation'] & known & ~in_time).sum(axis=0)
            for i, voxel in enumerate(voxels):  # the first ones count as lost, others as late
                n = max(lost.get(voxel, 0) - absent[i], 0)
                unheard[:, i] &= unheard[:, i].cumsum() <= n
        late['actuation'] = unused & ~unheard
        unsent = silent & known & ~evident
    else:
        in_real_time = any(x.any() for x in late.values()) if lock_step is None else not lock_step
        if in_real_time:
            effect = _Effects(streams, voxels, deadlines, shape)
            applied, ages = effect.applied(max(HOLD_LIMIT * rate, 2.0))
            unsent = silent.copy()
        else:
            answers = _table(streams, voxels, shape)
            applied = np.where(late['actuation'], 0.0, answers)
            ages = np.where(late['actuation'], -1.0, np.where(np.isnan(answers), np.nan, 0.0))
            unsent = np.zeros(shape, bool)
    unsent[-1] = False  # no voxel answers the last step
    return Outcomes(applied, _outcomes(ages), late, unsent, unheard)


def _deadlines(odometry: Stream, n_steps: int, grace: int) -> np.ndarray:
    """Return the place in the bag after which a message of each step is late, (n_steps,).

    It is that of the odometry of the next step, plus `grace`, whose message is in the bag.
    """
    next_ = np.searchsorted(odometry.steps, np.arange(n_steps), side='right') + grace
    orders = np.append(odometry.order, [_NEVER] * (grace + 1))
    return orders[next_]


def _applied(
    stream: Stream, voxels: tuple[str, ...], shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return actuation and ages that the simulation published; NaN where it did not."""
    applied, ages = np.full(shape, np.nan), np.full(shape, np.nan)
    for column, voxel in enumerate(stream.fields):
        i = voxels.index(voxel)
        applied[stream.steps, i], ages[stream.steps, i] = stream.numbers[:, column].T
    return applied, ages


def _answered(ages: np.ndarray) -> np.ndarray:
    """Return which steps the voxels have answered, for the answer counted then or later."""
    answered = np.zeros(ages.shape, bool)
    step, voxel = np.nonzero(ages >= 0)
    of = step - ages[step, voxel].astype(int)
    answered[of[of >= 0], voxel[of >= 0]] = True
    return answered


def _table(
    streams: Mapping[Role, Stream], voxels: tuple[str, ...], shape: tuple[int, int]
) -> np.ndarray:
    """Return the answers in the bag; NaN for others."""
    answers = np.full(shape, np.nan)
    for i, voxel in enumerate(voxels):
        if stream := streams.get(Role('actuation', voxel)):
            answers[stream.steps, i] = stream.numbers[:, 0]
    return answers


class _Effects:
    """Which answer the simulation had in real time, from the order in which they were recorded."""

    def __init__(
        self, streams: Mapping[Role, Stream], voxels: tuple[str, ...], deadlines: np.ndarray,
        shape: tuple[int, int],
    ) -> None:
        self._answers = _table(streams, voxels, shape)
        self._newest, self._since = np.full(shape, -1), np.zeros(shape, int)
        steps = np.arange(shape[0])
        for i, voxel in enumerate(voxels):
            stream = streams.get(Role('actuation', voxel), Stream.empty('actuation'))
            begin = np.maximum(np.searchsorted(deadlines, stream.order), stream.steps)
            inside = begin < shape[0]
            np.maximum.at(self._newest[:, i], begin[inside], stream.steps[inside])
            newest = np.maximum.accumulate(self._newest[:, i])
            changed = np.diff(newest, prepend=-1) != 0
            self._newest[:, i] = newest
            self._since[:, i] = np.maximum.accumulate(np.where(changed, steps, 0))

    def applied(self, hold_limit: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the actuation and the ages; a voxel is limp after `hold_limit` [steps]."""
        steps = np.arange(len(self._newest))[:, None]
        ages = (steps - self._newest).astype(float)
        limp = (self._newest < 0) | (steps - self._since > hold_limit)
        held = np.take_along_axis(self._answers, np.maximum(self._newest, 0), axis=0)
        applied, ages = np.where(limp, 0.0, held), np.where(limp, -1.0, ages)
        applied[-1] = ages[-1] = np.nan  # no step is made after the last odometry
        return applied, ages


def _outcomes(ages: np.ndarray) -> np.ndarray:
    """Return the `Outcome` of each age; NaN is unknown."""
    found = np.full(ages.shape, Outcome.UNKNOWN, dtype=np.uint8)
    found[ages == 0] = Outcome.IN_TIME
    found[ages > 0] = Outcome.HELD
    found[ages < 0] = Outcome.LIMP
    return found
