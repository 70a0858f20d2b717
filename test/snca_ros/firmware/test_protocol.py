"""Frames, requests and answers: both ends of the link, and a line that damages them."""

import binascii
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.firmware import (
    SESSION,
    answers,
    build,
    needs_gcc,
    random_inputs,
    requests,
    source_of,
    untrained,
    write,
)

from sim_node.errors import InvalidInput
from snca_ros.firmware.protocol import (
    HELLO,
    CellCodec,
    FrameReader,
    SessionAnswer,
    check_hello,
    frame,
    payload_of,
)

some_bytes = st.binary(min_size=1, max_size=700) | st.builds(
    lambda n, tail: b'\x01' * n + tail, st.integers(252, 256), st.binary(max_size=3)
)


def plain_crc(content: bytes) -> int:
    """Return CRC-16/CCITT, bit by bit as its definition has it."""
    crc = 0xFFFF
    for byte in content:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def plain_cobs(content: bytes) -> bytes:
    """Return COBS as its inventors describe it: a group ends at a 0 or after 254 bytes."""
    groups, group = [], bytearray()
    for byte in content:
        if byte:
            group.append(byte)
        if not byte or len(group) == 254:
            groups.append(group)
            group = bytearray()
    return b''.join(bytes([len(group) + 1]) + group for group in [*groups, group])


@given(some_bytes)
def test_frames_are_those_of_the_definitions(payload):
    check = plain_crc(payload)
    assert check == binascii.crc_hqx(payload, 0xFFFF)
    assert frame(payload) == plain_cobs(payload + struct.pack('<H', check)) + b'\0'
    assert payload_of(frame(payload)[:-1]) == payload


@given(some_bytes, st.integers(0), st.integers(1, 255))
def test_a_flipped_byte_is_noticed(payload, at, flip):
    damaged = bytearray(frame(payload))
    damaged[at % len(damaged)] ^= flip
    assert payload not in FrameReader().feed(bytes(damaged) + b'\0')


@given(st.lists(some_bytes, max_size=5), st.lists(st.integers(0, 4000), max_size=8))
def test_frames_are_found_however_the_line_cuts_them(payloads, cuts):
    line, reader, found = b''.join(map(frame, payloads)), FrameReader(), []
    ends = sorted({min(cut, len(line)) for cut in cuts} | {0, len(line)})
    for start, end in zip(ends, ends[1:], strict=False):
        found += reader.feed(line[start:end])
    assert found == payloads
    assert reader.damaged == 0


@given(st.binary(max_size=400))
def test_noise_is_no_answer(noise):
    reader = FrameReader()
    for payload in (noise, *reader.feed(noise), *reader.feed(frame(noise or b'x'))):
        CellCodec(untrained('U-nD', 'snn-h').architecture).decode(payload)


@pytest.fixture(scope='module')
def device(tmp_path_factory):
    """Return a controller, its image, and requests to it with the answers of a clean line."""
    trained = untrained('U-nD', 'snn-h', arithmetic='int16')
    image = build(write(trained, tmp_path_factory.mktemp('link') / 'firmware'), 'cell')
    asked = requests(CellCodec(trained.architecture), random_inputs(trained.architecture, 60))
    found = answers(image, b''.join(map(frame, asked)), len(asked))
    return trained, image, asked, found


def without_ticks(payload):
    return payload[:-4] if payload[:1] == b's' else payload


@needs_gcc
def test_a_noisy_line_changes_no_answer(device):
    """Damaged, cut and overlong frames get no answer; a repeated step is not executed again."""
    _, image, asked, clean = device
    rng, line, kept = np.random.default_rng(3), b'', []
    for i, payload in enumerate(asked):
        framed = bytearray(frame(payload))
        damaged = framed.copy()
        at = rng.integers(len(framed) - 1)
        damaged[at] = damaged[at] % 255 + 1
        noise = [
            damaged, framed[:at] + b'\0', framed[:at] + framed[at + 1 :],
            framed[:at] + b'\x55' + framed[at:], rng.bytes(300) * 10 + b'\0', b'\0\0',
        ]
        line += bytes(noise[rng.integers(len(noise))]) + framed
        line += frame(asked[max(2, i - 3)]) * (i > 5)  # an old step, late
        repeats = int(rng.integers(3)) if i else 0
        line += bytes(framed) * repeats
        kept += [clean[i]] * (1 + repeats)
    found = answers(image, line, len(kept))
    assert list(map(without_ticks, found)) == list(map(without_ticks, kept))
    answered = {}  # a repeated step has the ticks of the first time
    for payload in found[2:]:
        assert answered.setdefault(without_ticks(payload), payload) == payload


@needs_gcc
def test_sessions_tell_a_device_that_has_been_restarted(device):
    trained, image, asked, clean = device
    codec = CellCodec(trained.architecture)
    first_step = asked[2]
    other = first_step[:1] + struct.pack('<H', SESSION + 1) + first_step[3:]
    line = [
        first_step, asked[1], first_step, asked[3], other, asked[1], HELLO,
        codec.reset(SESSION + 1), other, asked[3],
    ]
    found = answers(image, b''.join(map(frame, line)), len(line))
    answer = [codec.decode(payload) for payload in found]
    assert answer[0] == SessionAnswer(False, 0)  # it has just started
    assert answer[1] == SessionAnswer(True, SESSION)
    assert without_ticks(found[2]) == without_ticks(clean[2])
    assert without_ticks(found[3]) == without_ticks(clean[3])
    assert answer[4] == SessionAnswer(False, SESSION)
    assert answer[5] == SessionAnswer(True, SESSION)  # a repeated reset resets nothing
    assert answer[6].session == SESSION
    assert answer[7] == SessionAnswer(True, SESSION + 1)
    assert without_ticks(found[8])[3:] == without_ticks(clean[2])[3:]  # the cell was reset
    assert answer[9] == SessionAnswer(False, SESSION + 1)


@needs_gcc
def test_readings_out_of_range_get_no_answer(tmp_path):
    """A NaN as a period would hang the device."""
    trained = untrained('U-D', 'snn-h')
    codec = CellCodec(trained.architecture)
    inputs = random_inputs(trained.architecture, 4)
    inputs.readings[:3, 0] = np.nan, -0.01, 1.01
    line = b''.join(map(frame, [*requests(codec, inputs), HELLO]))
    image = build(write(trained, tmp_path / 'firmware'), 'cell')
    found = answers(image, line, 4)
    assert [payload[:1] for payload in found] == [b'h', b'r', b's', b'h']


@pytest.mark.parametrize(('change', 'message'), [
    ({'version': 2}, 'device: protocol version: got 2, expected 1'),
    ({'arithmetic': 'int8'}, "device: arithmetic: got 'int8', expected int16"),
    ({'n_c': 3}, 'got (4, 3, 1), expected (4, 4, 1)'),
    ({'hash': b'12345678'}, "device: firmware: got 'biped, 3132333435363738', expected that of"),
])
def test_wrong_firmware_is_refused_in_one_line(change, message):
    identity = source_of(untrained('U-nD', 'snn-h', arithmetic='int16'), 0).identity
    packed = struct.pack(
        '<5B8sHI', identity.version, 2, identity.n_sensors, identity.n_c, identity.n_destinations,
        identity.hash, 0, 1000,
    )
    codec = CellCodec(untrained('U-nD', 'snn-h').architecture)
    hello = codec.decode(b'h' + packed + b'biped')
    check_hello(hello, identity, 'device')
    wrong = hello._replace(identity=replace(identity, **change))
    with pytest.raises(InvalidInput) as caught:
        check_hello(wrong, identity, 'device')
    assert message in str(caught.value)
    assert '\n' not in str(caught.value)


def test_hash_is_of_all_that_a_cell_computes():
    one = untrained('U-nD', 'snn-h')
    other_weights = untrained('U-nD', 'snn-h', seed=1)
    hashes = [source_of(trained, 0).identity.hash for trained in (
        one, other_weights, one.in_arithmetic('int16'), one.in_arithmetic('int8'),
        replace(one, architecture=replace(one.architecture, neuron_model='snn')),
        replace(one, architecture=replace(one.architecture, as_printed=True)),
    )]
    assert len(set(hashes)) == len(hashes)
    assert hashes[0] == source_of(untrained('U-nD', 'snn-h', '1111'), 0).identity.hash
