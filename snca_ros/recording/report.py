"""Formats the report of a recorded walk, as lines of text and for JSON."""

import math

import numpy as np

from sim_node.control_time import CONTROL_RATE
from snca_ros.recording.bag import Recording, TopicCount
from snca_ros.recording.diagnostics import OUTCOMES
from snca_ros.recording.gait import Gait
from snca_ros.recording.outcomes import Outcome

_SHOWN_STEPS = 5
_COLUMNS = ('sent', 'in time', 'late', 'lost', 'never sent')


def report_lines(recording: Recording, gait: Gait) -> list[str]:
    """Return the report as lines of text."""
    return [
        *_gait_lines(recording, gait), '', *_count_lines(recording), *_delivery_lines(recording)
    ]


def as_dict(recording: Recording, gait: Gait) -> dict[str, object]:
    """Return the report as a dictionary for JSON; unknown numbers are None."""
    rates = gait.firing_rates
    return {
        'bag': str(recording.path),
        'closed': recording.closed,
        'robot': recording.robot,
        'physics': recording.physics,
        'body': recording.body.grid_string if recording.body else None,
        'missing': list(recording.body.missing_names) if recording.body else [],
        'episode': recording.episode,
        'n_episodes': recording.n_episodes,
        'v_x': _number(gait.velocity),
        'distance': gait.distance,
        'duration': gait.duration,
        'walls_met': dict(zip(('behind', 'ahead'), gait.walls.times, strict=True)),
        'frequency': gait.frequency,
        'steps_per_second': _number(recording.rate),
        'voxels': {
            voxel: {
                'firing_rate': None if rates is None else _number(rates[i]),
                'frequency': float(gait.frequencies[i]),
                'steps': _steps_by_outcome(recording, i),
            }
            for i, voxel in enumerate(recording.voxel_names)
        },
        'topics': {
            count.topic: {
                'sent': None if count.missing is None else count.sent,
                'received': count.received,
                'in_time': None if count.missing is None else count.in_time,
                'late': None if count.missing is None else len(count.late),
                'lost': None if count.missing is None else count.lost,
                'lost_by_kill': None if count.missing is None else len(count.killed),
                'not_recorded': None if count.missing is None else len(count.unrecorded),
                'published_twice': None if count.missing is None else len(count.twice),
                'never_sent': None if count.missing is None else len(count.unsent),
                'refused': count.refused,
            }
            for count in recording.counts
        },
        'nodes': {
            node: {
                'lives': health.n_processes,
                'figures': dict(health.values),
                'links': {
                    topic: dict(zip(OUTCOMES, counts, strict=True))
                    for topic, counts in health.deliveries.items()
                },
            }
            for node, health in recording.health.items()
        },
    }


def _steps_by_outcome(recording: Recording, voxel: int) -> dict[str, int]:
    """Return the number of steps by outcome of the voxel's answer: in time, held, limp, unknown."""
    counts = np.bincount(recording.outcomes[:-1, voxel], minlength=len(Outcome))
    return {
        outcome.name.lower().replace('_', ' '): int(counts[outcome]) for outcome in Outcome
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _gait_lines(recording: Recording, gait: Gait) -> list[str]:
    lines = [
        f'{recording.path}: {recording.robot}, {len(recording.voxel_names)} voxels, '
        f'{recording.n_steps - 1} control steps'
    ]
    if not recording.closed:
        lines.append('the recorder did not close this bag: the report is of what it had written')
    if recording.n_episodes > 1:
        lines.append(f'episode {recording.episode} of 0 to {recording.n_episodes - 1} (resets)')
    lines += [
        f'v_x        {gait.velocity!r} m/s ({gait.scored})',
        f'distance   {gait.distance:.3f} m in {gait.duration:.3f} s',
        *(f'wall       {text}' for text in gait.walls.describe()),
        *([f'body       {recording.body.label}'] if recording.body else []),
        f'physics    {recording.physics}',
        f'rhythm     {gait.frequency:.2f} Hz, the dominant frequency of the actuation',
    ]
    if math.isfinite(recording.rate):
        factor = recording.rate / CONTROL_RATE
        lines.append(
            f'speed      {recording.rate:.1f} steps/s, {factor:.2f} times real time'
        )
    lines += _step_time_lines(recording)
    lines += ['', f'{"voxel":16}{"firing rate [Hz]":>18}{"actuation peak [Hz]":>21}'
              f'{"held [steps]":>14}{"limp [steps]":>14}']
    rates = gait.firing_rates
    for i, voxel in enumerate(recording.voxel_names):
        rate = '-' if rates is None or np.isnan(rates[i]) else f'{rates[i]:.1f}'
        steps = _steps_by_outcome(recording, i)
        lines.append(f'{voxel:16}{rate:>18}{gait.frequencies[i]:>21.2f}'
                     f'{steps["held"]:>14}{steps["limp"]:>14}')
    return lines


def _step_time_lines(recording: Recording) -> list[str]:
    if 'sim_node' not in recording.health:
        return []
    values = recording.health['sim_node'].values
    times = [f'{values.get(f"step time {name} [ms]", math.nan):.2f} ms {name}'
             for name in ('p50', 'p99', 'max')]
    line = f'step time  {", ".join(times)}'
    if 'missed deadlines' in values:
        line += f'; {values["missed deadlines"]:.0f} missed deadlines'
    return [line]


def _delivery_lines(recording: Recording) -> list[str]:
    """Return messages on time, late and lost at the nodes: per kind of topic, and where any were.

    The numbers are from the nodes' diagnostics.
    """
    deliveries = [
        (topic, node, counts) for node, health in sorted(recording.health.items())
        for topic, counts in health.deliveries.items()
    ]
    if not deliveries:
        return []
    lines = ['', f'{"at the nodes":16}' + ''.join(f'{outcome:>10}' for outcome in OUTCOMES)]
    for kind in sorted({topic.rpartition('/')[2] for topic, *_ in deliveries}):
        of_kind = [counts for topic, _, counts in deliveries if topic.endswith(f'/{kind}')]
        lines.append(f'{kind:16}' + ''.join(f'{sum(c):>10}' for c in zip(*of_kind, strict=True)))
    for topic, node, (_, late, lost) in deliveries:
        if late or lost:
            lines.append(f'{topic} at {node}: {late} late, {lost} lost')
    starts = {node: health.n_processes for node, health in sorted(recording.health.items())}
    lines += [f'{node} was started {n} times' for node, n in starts.items() if n > 1]
    return lines


def _count_lines(recording: Recording) -> list[str]:
    """Return message counts per kind of topic and in total, and the topics that lost any."""
    numbered = [c for c in recording.counts if c.missing is not None]
    others = [c for c in recording.counts if c.missing is None]
    lines = [f'{"messages":16}' + ''.join(f'{column:>11}' for column in _COLUMNS)]
    for kind in sorted({c.kind for c in numbered}):
        lines.append(_count_line(kind, [c for c in numbered if c.kind == kind]))
    lines.append(_count_line('total', numbered))
    for count in recording.counts:
        for what, steps in (('late', count.late), ('lost', count.lost_steps),
                            ('of these lost by a kill', count.killed),
                            ('in time, but not recorded', count.unrecorded),
                            ('published twice', count.twice), ('never sent', count.unsent)):
            if steps is not None and len(steps):
                lines.append(f'{what} on {count.topic}: {_steps(steps)}')
        if count.refused:
            lines.append(f'refused on {count.topic}: {count.refused} invalid messages')
    if others:
        shown = ', '.join(f'{c.topic} {c.received}' for c in others)
        lines.append(f'without control steps, so losses are unknown: {shown}')
    return lines


def _count_line(name: str, counts: list[TopicCount]) -> str:
    rows = [(c.sent, c.in_time, len(c.late), c.lost, len(c.unsent)) for c in counts]
    return f'{name:16}' + ''.join(f'{sum(column):>11}' for column in zip(*rows, strict=True))


def _steps(missing: np.ndarray) -> str:
    shown = ', '.join(str(k) for k in missing[:_SHOWN_STEPS])
    return f'{len(missing)} (steps {shown}{", ..." if len(missing) > _SHOWN_STEPS else ""})'
