"""Usual steps of a voxel in compiled code are those of its cell; others are given back whole."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
from sensor_msgs.msg import Image, JointState
from support.limits import LIMIT

from sim_node.control_time import stamp_of_step
from sim_node.model.morphology import DIRECTIONS, OPPOSITE
from sim_node.ros import rcl_functions, topics
from sim_node.ros.node_base import take_all
from sim_node.ros.sim_interface import BEST_EFFORT, RELIABLE
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells
from snca_ros.nodes.cell_messages import CellMessages
from snca_ros.nodes.compiled_step import CompiledStep

EPISODE = b'r0123456'
OWN, LEFT, ABOVE = 'voxel_1_0', 'voxel_0_0', 'voxel_1_1'
NEIGHBORS = {DIRECTIONS.index('left'): LEFT, DIRECTIONS.index('above'): ABOVE}
CELLS = [
    ('U-nD', 'snn-h', {}, RELIABLE), ('nU-D', 'snn', {'n_c': 3}, BEST_EFFORT),
    ('U-D', 'mlp', {'n_c': 2}, RELIABLE), ('U-nD', 'mlp', {'hidden': (5, 4)}, BEST_EFFORT),
]


def wait(condition):
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline


@pytest.fixture(params=CELLS, ids=lambda cell: '-'.join(cell[:2]))
def voxel(request, node):
    """Return a voxel with a compiled step, its cell's twin, and what its neighbours publish."""
    name, model, options, reliability = request.param
    architecture = Architecture.named(name, model, **options)
    rng = np.random.default_rng(1)
    weights = rng.uniform(-1.0, 1.0, (1, architecture.parameters_per_cell))
    cells, twin = Cells(architecture, weights), Cells(architecture, weights)
    qos = topics.link_qos(reliability)
    formats = {d: CellMessages(architecture, name) for d, name in NEIGHBORS.items()}
    to_voxel = {d: node.create_publisher(Image, f'{n}/m', qos) for d, n in NEIGHBORS.items()}
    boxes = {d: node.create_subscription(Image, f'{n}/m', print, qos, raw=True)
             for d, n in NEIGHBORS.items()}
    own = CellMessages(architecture, OWN)
    sensors = topics.sensors_format(OWN, architecture.sensors)
    actuation = topics.actuation_format(OWN)
    outputs = [node.create_publisher(Image, f'{OWN}/m', qos),
               node.create_publisher(JointState, f'{OWN}/a', qos)]
    heard = [node.create_subscription(Image, f'{OWN}/m', print, qos, raw=True),
             node.create_subscription(JointState, f'{OWN}/a', print, qos, raw=True)]
    everything = [*to_voxel.values(), *outputs]
    wait(lambda: all(publisher.get_subscription_count() for publisher in everything))
    step = CompiledStep(
        cells.state, architecture.directional, sensors,
        {d: (box, formats[d].format) for d, box in boxes.items()},
        list(zip(outputs, [own.format, actuation], strict=True)),
    )

    def message(d, k, numbers):
        episode = np.frombuffer(EPISODE, np.uint8)
        return formats[d].encode(episode, stamp_of_step(k), numbers)

    def send(d, data):
        to_voxel[d].publish(data)

    def reading(k, readings):
        episode = np.frombuffer(EPISODE, np.uint8)
        return sensors.encode(stamp_of_step(k), position=readings, episode=episode)

    shape = architecture.n_destinations, architecture.n_c, architecture.message_width

    def numbers():
        if architecture.spiking:
            return (rng.random(shape) < 0.3).astype(float)
        return rng.uniform(-1.0, 1.0, shape)

    return SimpleNamespace(
        step=step, cells=cells, twin=twin, message=message, send=send, reading=reading,
        numbers=numbers, heard=heard, own=own, actuation=actuation, rng=rng,
        architecture=architecture, boxes=boxes,
    )


def inbox_of(voxel, messages):
    inbox = voxel.twin.empty_inbox()
    for d, message in messages.items():
        inbox[d] = message[OPPOSITE[d] if voxel.architecture.directional else 0]
    return inbox


def make_step(voxel, k, messages):
    """Attempt step k and compare it with the twin's."""
    readings = voxel.rng.random(4)
    assert voxel.step.attempt(voxel.reading(k, readings))
    a = voxel.twin.step_cell(0, readings, inbox_of(voxel, messages), k)
    [data], [answer] = [take_all(box) for box in voxel.heard]
    episode, step, sent = voxel.own.decode(data)
    assert (episode, step) == (EPISODE, k)
    assert np.array_equal(sent, voxel.twin.outbox[0])
    assert topics.read_joint_state(voxel.actuation, answer, -1.0, 1.0) == (EPISODE, k, [a])


def send_all(voxel, k):
    messages = {d: voxel.numbers() for d in NEIGHBORS}
    for d, numbers in messages.items():
        voxel.send(d, voxel.message(d, k, numbers))
    return messages


def test_usual_steps_are_those_of_the_cell(voxel):
    first = {d: voxel.numbers() for d in NEIGHBORS}
    voxel.step.prepare(EPISODE, 6, first)  # both messages of step 6 have been received before
    make_step(voxel, 7, first)
    early = None
    for k in range(8, 40):
        messages = early or send_all(voxel, k - 1)
        early = send_all(voxel, k) if k % 3 == 0 else None  # neighbours may be a step ahead
        make_step(voxel, k, messages)
    assert voxel.step.give_back() == []


def unusual(voxel, sent, readings, k=7):
    """Return the messages that are given back after an attempt at step k, by direction."""
    voxel.step.prepare(EPISODE, 6, {})
    state = [array.copy() for array in voxel.cells.state.network.state]
    for d, data in sent:
        voxel.send(d, data)
    assert not voxel.step.attempt(voxel.reading(k, np.asarray(readings)))
    after = voxel.cells.state.network.state
    assert all(np.array_equal(a, b) for a, b in zip(state, after, strict=True))
    assert [take_all(box) for box in voxel.heard] == [[], []]
    assert not voxel.step.attempt(voxel.reading(k, np.full(4, 0.5)))  # it takes nothing more
    return voxel.step.give_back()


def test_what_is_not_usual_is_given_back(voxel):
    left, above = (DIRECTIONS.index(side) for side in ('left', 'above'))
    good = {d: voxel.message(d, 6, voxel.numbers()) for d in NEIGHBORS}
    both, fine = list(good.items()), np.full(4, 0.5)
    damaged = bytearray(good[left])
    damaged[voxel.own.format.place('data').start - 4] ^= 1  # the length of the data
    wrong = bytearray(good[left])
    wrong[voxel.own.format.place('data').stop - 1] = 0x7F
    foreign = good[left].replace(EPISODE, b'rfffffff')
    huge = good[left] + bytes(100_000)  # rcl must enlarge the buffer
    old = voxel.message(left, 5, voxel.numbers())
    for strange in (bytes(damaged), bytes(wrong), foreign, huge, old):
        found = dict(unusual(voxel, [(left, strange), (above, good[above])], fine))
        assert found.pop(left)[: len(strange)] == strange
        assert found in ({}, {above: good[above]})
        for box in voxel.boxes.values():
            take_all(box)
    assert unusual(voxel, both, [0.5, 0.5, 0.5, 1.5]) == []  # no message is taken
    assert unusual(voxel, [], [0.5, 0.5, 0.5, np.nan]) == []
    assert unusual(voxel, [], fine, k=9) == []
    for d, data in both:
        assert take_all(voxel.boxes[d]) == [data]
    given_back = unusual(voxel, [(above, good[above])], fine)
    assert given_back in ([], [(above, good[above])])


def test_a_rcl_without_these_functions_is_not_used(monkeypatch):
    assert rcl_functions.AVAILABLE
    found = rcl_functions._library
    for absent in ('rcl', 'rcutils'):
        monkeypatch.setattr(
            rcl_functions, '_library',
            lambda name, absent=absent: None if name == absent else found(name),
        )
        assert not rcl_functions._declare_functions()
    monkeypatch.setattr(rcl_functions, '_library', lambda name: SimpleNamespace())
    assert not rcl_functions._declare_functions()
