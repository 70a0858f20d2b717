"""Tables of the faults of robots side by side are those of each robot, bit by bit."""

import numpy as np

from sim_node.model.morphology import parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cell_lanes import MAX_WIDTH
from snca_ros.evolution.fault_lanes import CellFaultsInLanes
from snca_ros.faults import NO_FAULTS, CellFaults, Faults

SHAPE = parse_morphology('11-10')
KINDS = [
    NO_FAULTS, Faults(loss=0.5, seed=1), Faults(delay=3), Faults(death='0.7@0.1-0.3', seed=2),
    Faults(loss=0.2, delay=1, death='voxel_0_0', seed=3),
]


def test_masks_are_the_faults_of_each_robot():
    faults = [KINDS[lane % len(KINDS)] for lane in range(MAX_WIDTH - 1)] + [Faults(loss=1.0)]
    tables = CellFaultsInLanes(faults, Architecture.named('U-D', 'mlp'), SHAPE).tables(4, 20)
    assert tables.lost.shape == (20, 3, 4)
    assert tables.dead.shape == (20, 3)
    assert tables.delays.tolist() == [0, 1, 3]
    for lane, own in enumerate(faults):
        expected = CellFaults(own, SHAPE)
        for i in range(SHAPE.n_voxels):
            lost, dead = tables.lost[:, i] >> lane & 1, tables.dead[:, i] >> lane & 1
            np.testing.assert_array_equal(lost, expected.lost(i, 4, 20))
            np.testing.assert_array_equal(dead, expected.dead(i, 4, 20))
        delays = tables.delays[(tables.delayed >> lane & 1).astype(bool)]
        assert delays.tolist() == [own.delay]
    assert tables.lost[0, 0, 0] < 0  # the last robot is the sign


def test_messages_are_kept_as_long_as_the_longest_delay():
    for model, n_slots in (('snn-h', (4, 1)), ('mlp', (1, 4))):
        architecture = Architecture.named('U-D', model)
        tables = CellFaultsInLanes(KINDS, architecture, SHAPE).tables(0, 1)
        n_trains, n_values = n_slots
        assert tables.ring_of_trains.shape == (n_trains, 3, 4, 16)
        assert tables.ring_of_values['lane'].shape == (n_values * 3, 4, len(KINDS))
