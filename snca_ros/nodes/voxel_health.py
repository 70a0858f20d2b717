"""Describes the state of a voxel for its diagnostics."""

from collections.abc import Mapping

from snca_ros.nodes.voxel_core import VoxelCore


def describe_voxel(core: VoxelCore, neighbors: Mapping[int, str], now: float) -> tuple[bool, str]:
    """Return whether something is wrong, and the control step with what the voxel waits for.

    Args:
        core: of the voxel.
        neighbors: names of the neighbours, by direction.
        now: the time [s].
    """
    def names(directions: list[int]) -> str:
        return ', '.join(neighbors[d] for d in directions)

    if core.held_back:
        return True, 'held back: another node publishes for this voxel'
    if core.step < 0:
        return False, 'no sensors received yet'
    if overdue := core.overdue:
        return True, f'step {core.step}, silent: {names(overdue)}'
    if not core.unanswered:
        return False, f'step {core.step}, sensors received {now - core.since:.1f} s ago'
    if core.cell.busy:
        trouble = core.cell.trouble()
        reason = f', which does not answer: {trouble}' if trouble else ''
        return bool(trouble), f'step {core.step} waits for its device{reason}'
    if not core.awaited:
        return False, f'step {core.step}'
    return False, f'step {core.step} waits for {names(core.awaited)}'
