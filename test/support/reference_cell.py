"""The cell of a robot, a second time: plain Python, as literal as possible, slow.

It exists only to be compared with the project's compiled cell and was written without reading it.
'The model description' is the project's table of numbers and their sources; 'paper, Eq. n' counts
the paper's numbered equations: (1) membrane potential, (2) threshold, (3) psi, (4) value to
spikes, (5) spikes to actuation.

Everything is floats, ints, lists and dicts. A channel, what travels in one message component
during one control step, is a list of 16 ints (0 or 1) between SNNs and one float between MLPs.
"""

import math
from itertools import pairwise

F_K = 60  # control steps per second (paper, 'The LIF model inside NCA')
STEPS = 16  # SNN steps in one control step: f_h = 16 f_k (paper, same section)
F_H = STEPS * F_K  # 960 Hz
F_MIN = 5  # Hz (paper, below Eq. 4)
F_MAX = 50  # Hz (paper, below Eq. 4)

V_REST = 0.0  # mV (paper, 'Experiments and results'; also the next three)
THETA_0 = 1.0  # mV
PSI_0 = 0.0  # mV
PSI_INC = 0.2  # mV

DIRECTIONS = ('above', 'left', 'below', 'right')  # the order in x and y of the paper's NCA
OPPOSITE = {'above': 'below', 'left': 'right', 'below': 'above', 'right': 'left'}
OFFSET = {'above': (0, 1), 'left': (-1, 0), 'below': (0, -1), 'right': (1, 0)}


class RateEncoder:
    """Value to spikes: paper, Eq. 4, with the first spike at the very first step."""

    def __init__(self, f_min=F_MIN, f_max=F_MAX, f_h=F_H):
        self.f_min = f_min
        self.f_max = f_max
        self.f_h = f_h
        self.h_last = None

    def encode(self, r, h0):
        """Return the 16 values s of the SNN steps h0 to h0 + 15."""
        f = r * (self.f_max - self.f_min) + self.f_min  # paper, below Eq. 4
        period = math.floor(self.f_h / f)
        train = []
        for h in range(h0, h0 + STEPS):
            if self.h_last is None:
                spike = True  # model description, Coding: 'the first spike is at h = 0'
            else:
                elapsed = h - self.h_last
                spike = elapsed > 0 and elapsed % period == 0  # paper, Eq. 4
            if spike:
                self.h_last = h
            train.append(1 if spike else 0)
        return train


class LifNeuron:
    """One leaky integrate and fire neuron: paper, Eq. 1 to 3; model description, SNN, 1 to 3."""

    def __init__(self, sum_of_weights, homeostasis, as_printed=False):
        self.sum_of_weights = sum_of_weights
        self.homeostasis = homeostasis
        self.as_printed = as_printed
        self.v = V_REST
        self.psi = PSI_0
        self.theta = THETA_0
        if as_printed:
            self.dt = 1 / F_H  # s
            self.lambda_v = 0.01  # per s (paper, 'Experiments and results')
            self.lambda_psi = 0.01  # per s (paper, same place)
        else:
            self.dt = 1000 / F_H  # ms
            self.lambda_v = 0.01  # per ms (model description, SNN, 2)
            self.lambda_psi = 0.01  # per ms (model description, SNN, 3)

    def step(self, drive):
        """Do one SNN step with `drive`, the sum of w_i s_i; return the spike, 0 or 1."""
        if not self.homeostasis:
            self.theta = THETA_0  # model description, SNN, 1
        elif self.as_printed:
            self.theta = min(self.theta, self.sum_of_weights) + self.psi  # paper, Eq. 2
        else:
            self.theta = min(THETA_0, self.sum_of_weights) + self.psi  # model description, SNN, 1

        self.v = self.v - self.lambda_v * self.dt * self.v + drive  # paper, Eq. 1

        # As printed (paper, below Eq. 1) 'exceeds'; model description, SNN, 3: reaches.
        spike = self.v > self.theta if self.as_printed else self.v >= self.theta

        if spike:
            self.v = V_REST  # paper, below Eq. 1
            self.psi = self.psi + PSI_INC  # paper, Eq. 3, for the next step
        else:
            self.psi = self.psi - self.lambda_psi * self.dt * self.psi  # paper, Eq. 3
        return 1 if spike else 0


class SpikingNetwork:
    """Fully connected layers of LIF neurons, the input layer included, without biases.

    Weights are flat, layer after layer; in each the weight from pre to post is at
    pre * n_post + post.
    """

    def __init__(self, sizes, weights, homeostasis, as_printed=False):
        self.sizes = list(sizes)
        self.matrices = []  # matrices[l][pre][post], from layer l to layer l + 1
        start = 0
        for n_pre, n_post in pairwise(self.sizes):
            matrix = [
                [float(weights[start + pre * n_post + post]) for post in range(n_post)]
                for pre in range(n_pre)
            ]
            self.matrices.append(matrix)
            start += n_pre * n_post
        if start != len(weights):
            raise ValueError(f'{len(weights)} weights where {self.sizes} needs {start}')

        # Model description, SNN: input neurons are fed by one train each, with weight 1.
        self.layers = [[LifNeuron(1.0, homeostasis, as_printed) for _ in range(self.sizes[0])]]
        for matrix, n_post in zip(self.matrices, self.sizes[1:], strict=True):
            layer = []
            for post in range(n_post):
                total = 0.0
                for row in matrix:
                    total = total + row[post]
                layer.append(LifNeuron(total, homeostasis, as_printed))
            self.layers.append(layer)

    def step(self, inputs):
        """Do one SNN step through all layers, without delay; return the output spikes."""
        if len(inputs) != self.sizes[0]:
            raise ValueError(f'{len(inputs)} inputs where {self.sizes[0]} are needed')
        spikes = [neuron.step(float(s)) for neuron, s in zip(self.layers[0], inputs, strict=True)]
        for matrix, layer in zip(self.matrices, self.layers[1:], strict=True):
            fired = [pre for pre, s in enumerate(spikes) if s == 1]
            after = []
            for post, neuron in enumerate(layer):
                drive = 0.0  # paper, Eq. 1: the sum of w s, where s is 1
                for pre in fired:
                    drive = drive + matrix[pre][post]
                after.append(neuron.step(drive))
            spikes = after
        return spikes


class ActuationDecoder:
    """Spikes to actuation: paper, Eq. 5, with the unit mended (model description, Coding)."""

    def __init__(self, n_w=5):
        self.n_w = n_w
        self.counts = []

    def decode(self, n_spikes_this_control_step):
        """Return a, in [-1, 1], at the end of a control step with that many spikes."""
        self.counts.append(n_spikes_this_control_step)
        window = self.counts[-self.n_w :]  # at the start fewer than n_w
        duration = len(window) / F_K  # s
        a = 2 * (sum(window) / (F_MAX * duration)) - 1
        return max(-1.0, min(1.0, a))


class Mlp:
    """Fully connected layers with tanh everywhere, on the inputs too (model description, Cell).

    Weights are flat, layer after layer; in each the bias of post is at 0 * n_post + post and the
    weight from pre to post at (1 + pre) * n_post + post.
    """

    def __init__(self, sizes, weights):
        self.sizes = list(sizes)
        self.weights = [float(w) for w in weights]
        needed = sum((1 + n_pre) * n_post for n_pre, n_post in pairwise(self.sizes))
        if needed != len(self.weights):
            raise ValueError(f'{len(self.weights)} weights where {self.sizes} needs {needed}')

    def compute(self, inputs):
        """Return the outputs."""
        if len(inputs) != self.sizes[0]:
            raise ValueError(f'{len(inputs)} inputs where {self.sizes[0]} are needed')
        values = [math.tanh(x) for x in inputs]
        start = 0
        for n_pre, n_post in pairwise(self.sizes):
            after = []
            for post in range(n_post):
                total = self.weights[start + post]
                for pre in range(n_pre):
                    total = total + self.weights[start + (1 + pre) * n_post + post] * values[pre]
                after.append(math.tanh(total))
            values = after
            start += (1 + n_pre) * n_post
        return values


def sizes_of(n_c, directional, hidden):
    """Return the layer sizes (paper, 'VSR controller'): x = [r, 4 i], y = [a, 4 o] or [a, o]."""
    n_inputs = 4 + 4 * n_c
    n_outputs = 1 + (4 * n_c if directional else n_c)
    if hidden is None:
        hidden = [n_inputs]  # paper, 'Experiments and results': as wide as the input layer
    return [n_inputs, *hidden, n_outputs]


def n_weights_of(model, sizes):
    """Return how many weights one cell has."""
    bias = 1 if model == 'mlp' else 0
    return sum((n_pre + bias) * n_post for n_pre, n_post in pairwise(sizes))


def silent_channel(model):
    """Return what is heard where there is no neighbour, or nothing came yet."""
    return 0.0 if model == 'mlp' else [0] * STEPS


class ReferenceCell:
    """One embodied NCA cell (paper, 'VSR controller'); model is 'mlp', 'snn' or 'snn-h'."""

    def __init__(self, model, n_c, directional, hidden, weights, as_printed=False):
        if model not in ('mlp', 'snn', 'snn-h'):
            raise ValueError(model)
        self.model = model
        self.n_c = n_c
        self.directional = directional
        self.sizes = sizes_of(n_c, directional, hidden)
        if model == 'mlp':
            self.network = Mlp(self.sizes, weights)
        else:
            self.network = SpikingNetwork(self.sizes, weights, model == 'snn-h', as_printed)
            self.encoders = [RateEncoder() for _ in range(4)]
            self.decoder = ActuationDecoder()

    def step(self, readings, inbox, k):
        """Do control step k; return (a, outbox).

        Args:
            readings: r, 4 floats.
            inbox: for each of the four directions what comes from there, a list of n_c channels.
            k: the control step, from 0.

        Returns:
            a, and the messages: a list of n_c channels if non-directional, else for each
            direction, the one the message goes to, a list of n_c channels.
        """
        if self.model == 'mlp':
            x = [float(r) for r in readings]
            for direction in DIRECTIONS:
                x = x + [float(value) for value in inbox[direction]]
            y = self.network.compute(x)
            return y[0], self._outbox(y[1:])

        trains = [
            encoder.encode(r, STEPS * k) for encoder, r in zip(self.encoders, readings, strict=True)
        ]
        for direction in DIRECTIONS:
            trains = trains + list(inbox[direction])
        out_trains = [[] for _ in range(self.sizes[-1])]
        for j in range(STEPS):
            spikes = self.network.step([train[j] for train in trains])
            for out_train, s in zip(out_trains, spikes, strict=True):
                out_train.append(s)
        a = self.decoder.decode(sum(out_trains[0]))
        return a, self._outbox(out_trains[1:])

    def _outbox(self, channels):
        if not self.directional:
            return channels
        n_c = self.n_c
        return {d: channels[i * n_c : (i + 1) * n_c] for i, d in enumerate(DIRECTIONS)}


class ReferenceController:
    """All cells of a robot: what is sent at k is heard at k + 1 (paper, 'VSR controller').

    Args:
        cells_xy: (x, y) of each voxel, y upwards.
        weights: a flat list for all cells, or a list with one flat list per cell.

    Attributes:
        outboxes: what each cell sent in the last step (silence before the first).
    """

    def __init__(self, cells_xy, model, n_c, directional, hidden, weights, as_printed=False):
        self.cells_xy = [tuple(xy) for xy in cells_xy]
        self.model = model
        self.n_c = n_c
        self.directional = directional
        per_cell = [weights] * len(self.cells_xy) if _is_flat(weights) else list(weights)
        if len(per_cell) != len(self.cells_xy):
            raise ValueError(f'weights for {len(per_cell)} of {len(self.cells_xy)} cells')
        self.cells = [
            ReferenceCell(model, n_c, directional, hidden, w, as_printed) for w in per_cell
        ]
        self.outboxes = []
        for _ in self.cells:
            nothing = [silent_channel(model) for _ in range(n_c)]
            self.outboxes.append(dict.fromkeys(DIRECTIONS, nothing) if directional else nothing)
        self.k = 0

    def step(self, readings):
        """Do one control step with 4 readings per cell; return a of every cell."""
        inboxes = [self._inbox(xy) for xy in self.cells_xy]
        actuation, outboxes = [], []
        for cell, r, inbox in zip(self.cells, readings, inboxes, strict=True):
            a, outbox = cell.step(r, inbox, self.k)
            actuation.append(a)
            outboxes.append(outbox)
        self.outboxes = outboxes
        self.k += 1
        return actuation

    def _inbox(self, xy):
        inbox = {}
        for direction in DIRECTIONS:
            dx, dy = OFFSET[direction]
            neighbor = (xy[0] + dx, xy[1] + dy)
            if neighbor not in self.cells_xy:
                inbox[direction] = [silent_channel(self.model) for _ in range(self.n_c)]
                continue
            sent = self.outboxes[self.cells_xy.index(neighbor)]
            # What is heard from the left is what the left neighbour sent to its right.
            inbox[direction] = sent[OPPOSITE[direction]] if self.directional else sent
        return inbox


def _is_flat(weights):
    return len(weights) == 0 or not hasattr(weights[0], '__len__')
