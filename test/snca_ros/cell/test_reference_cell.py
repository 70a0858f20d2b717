"""The reference cell itself, against what can be worked out by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.against_reference import (
    SPIKING,
    cheap,
)
from support.reference_cell import (
    DIRECTIONS,
    ActuationDecoder,
    LifNeuron,
    Mlp,
    RateEncoder,
    ReferenceCell,
    SpikingNetwork,
)

Q = 1 - 0.01 * 1000 / 960  # what is left of v, and of psi, after one SNN step


def spike_times(readings):
    encoder = RateEncoder()
    train = [s for k, r in enumerate(readings) for s in encoder.encode(r, 16 * k)]
    return [h for h, s in enumerate(train) if s]


@pytest.mark.parametrize(('r', 'period'), [(1.0, 19), (0.0, 192), (0.5, 34), (1 / 3, 48)])
def test_reference_encodes_a_constant_as_one_period(r, period):
    assert spike_times([r] * 200) == list(range(0, 3200, period))


@cheap
@given(st.floats(0, 1))
def test_reference_period_gives_at_least_the_rate_asked_for(r):
    period = spike_times([r] * 40)[1]
    f = 5 + 45 * r
    assert period <= 960 / f * (1 + 1e-12)
    assert period + 1 > 960 / f * (1 - 1e-12)


def test_reference_counts_from_the_last_spike_across_control_steps():
    # r = 0 (192) for two control steps, then r = 1: 19 is past, so the next multiple, 38.
    assert spike_times([0, 0, 1, 1, 1])[:3] == [0, 38, 57]
    # r = 1 until its spike at 19, then 192 steps of r = 0 from there.
    assert spike_times([1, 1] + [0] * 20)[:3] == [0, 19, 211]


def test_reference_actuation_has_six_values_and_silence_is_full_expansion():
    decoder = ActuationDecoder()
    assert [decoder.decode(0) for _ in range(7)] == [-1.0] * 7

    seen = set()
    for n in range(81):
        decoder = ActuationDecoder()
        each = [n // 5 + (i < n % 5) for i in range(5)]
        seen.add(round([decoder.decode(m) for m in each][-1], 12))
    # 50 Hz over 5 / 60 s are 25 / 6 spikes: a = 12 n / 25 - 1.
    assert sorted(seen) == [-1, -0.52, -0.04, 0.44, 0.92, 1]


def test_reference_window_is_shorter_at_the_start_and_forgets_after_five():
    decoder = ActuationDecoder()
    found = [decoder.decode(n) for n in (0, 1, 0, 0, 0, 0, 0)]
    # With m control steps so far one spike is 2 / (50 m / 60) = 2.4 / m above -1.
    expected = [-1, -1 + 2.4 / 2, -1 + 2.4 / 3, -1 + 2.4 / 4, -1 + 2.4 / 5, -1 + 2.4 / 5, -1]
    assert found == pytest.approx(expected, abs=1e-12)
    assert ActuationDecoder().decode(1) == 1.0  # 2.4 - 1, clipped


@cheap
@given(st.floats(0.012, 1.5))
def test_reference_neuron_under_constant_drive_has_the_period_of_the_closed_form(drive):
    # v after n steps from rest is w (1 - Q^n) / (1 - Q); the period is the first n with v >= 1.
    exact = max(1.0, math.log(1 - (1 - Q) / drive) / math.log(Q))
    if abs(exact - round(exact)) < 1e-6 and drive != 1:
        return  # too near to a whole number to say by logarithms
    period = math.ceil(exact)
    network = SpikingNetwork([1, 1], [drive], homeostasis=False)
    spikes = [network.step([1])[0] for _ in range(5 * period + 1)]
    assert [n + 1 for n, s in enumerate(spikes) if s] == [period * i for i in range(1, 6)] or (
        period == 1 and all(spikes)
    )


def test_reference_neuron_with_too_little_drive_never_fires():
    # w / (1 - Q) < 1 is the limit of v.
    neuron = LifNeuron(1.0, homeostasis=False)
    assert not any(neuron.step(0.999 * (1 - Q)) for _ in range(5000))


def test_reference_homeostasis_of_a_neuron_with_negative_weights():
    # Nothing comes in, v = 0. The threshold is -0.5, -0.3, -0.1 (three spikes), then 0.1 = -0.5
    # + psi with psi = 0.6 Q^m, and no spike until psi <= 0.5.
    neuron = LifNeuron(-0.5, homeostasis=True)
    pause = math.ceil(math.log(0.5 / 0.6) / math.log(Q))
    spikes = [neuron.step(0.0) for _ in range(3 + pause + 1)]
    assert spikes == [1, 1, 1] + [0] * pause + [1]
    assert pause == 18


def test_reference_homeostasis_slows_a_neuron_down():
    plain, homeostatic = LifNeuron(1.0, homeostasis=False), LifNeuron(1.0, homeostasis=True)
    n_plain = sum(plain.step(1.0) for _ in range(2000))
    n_homeostatic = sum(homeostatic.step(1.0) for _ in range(2000))
    assert n_plain == 2000
    assert 0 < n_homeostatic < 500


def test_reference_as_printed_threshold_compounds():
    # Sum of weights 3, and a drive that always makes a spike: psi = 0, 0.2, 0.4, ... and
    # theta = 1 + 0, 1 + 0.2, 1.2 + 0.4, ... until it passes 3, and from there 3 + psi.
    neuron = LifNeuron(3.0, homeostasis=True, as_printed=True)
    thetas = []
    for _ in range(8):
        assert neuron.step(100.0) == 1
        thetas.append(neuron.theta)
    assert thetas == pytest.approx([1, 1.2, 1.6, 2.2, 3.0, 4.0, 4.2, 4.4])

    default = LifNeuron(3.0, homeostasis=True)
    thetas = []
    for _ in range(8):
        assert default.step(100.0) == 1
        thetas.append(default.theta)
    assert thetas == pytest.approx([1, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.4])


def test_reference_as_printed_neuron_must_exceed_its_threshold_and_hardly_leaks():
    printed, default = LifNeuron(1.0, False, as_printed=True), LifNeuron(1.0, False)
    assert (printed.step(1.0), default.step(1.0)) == (0, 1)
    assert printed.step(0.0) == 0
    assert printed.v == pytest.approx(1 - 0.01 / 960, abs=1e-15)


def test_reference_reads_flat_weights_with_the_presynaptic_index_slow():
    # 2 inputs, 3 outputs: only the weight from input 1 to output 0 is 1, at 1 * 3 + 0.
    network = SpikingNetwork([2, 3], [0, 0, 0, 1, 0, 0], homeostasis=False)
    assert network.step([0, 1]) == [1, 0, 0]
    assert network.step([1, 0]) == [0, 0, 0]
    # Bias row first: output 1 has bias 0.5, and weight 2 from input 0 at (1 + 0) * 2 + 1.
    found = Mlp([1, 2], [0, 0.5, 0, 2]).compute([0.3])
    assert found == pytest.approx([0, math.tanh(0.5 + 2 * math.tanh(0.3))], abs=1e-15)


@pytest.mark.parametrize('as_printed', [False, True])
@pytest.mark.parametrize('model', SPIKING)
def test_reference_silence_is_full_expansion(model, as_printed):
    cell = ReferenceCell(model, 1, True, None, [0.0] * 104, as_printed)
    inbox = {d: [[0] * 16] for d in DIRECTIONS}
    found = [cell.step([0.3, 1, 0, 0.7], inbox, k) for k in range(50)]
    if model == 'snn-h' and not as_printed:
        # A sum of weights of 0 is a threshold of 0: v >= theta until psi has grown, and then
        # never again, as psi stays above 0.
        assert found[0][1]['above'] == [[1] + [0] * 15]
        found = found[5:]
    assert {a for a, _ in found} == {-1.0}
    assert not any(any(channel[0]) for _, o in found for channel in o.values())
