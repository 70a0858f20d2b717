"""The cell of one voxel on a device: says hello, resets, steps, repeats what gets no answer.

It never waits: `poll` is called when bytes have arrived, or from time to time.
"""

import time
from dataclasses import dataclass

import numpy as np

from snca_ros.cell.architecture import Architecture
from snca_ros.files import reason_of
from snca_ros.firmware.identity import Identity
from snca_ros.firmware.lines import Address, Line, wait_for
from snca_ros.firmware.protocol import (
    HELLO,
    CellCodec,
    FrameReader,
    Hello,
    SessionAnswer,
    StepAnswer,
    check_hello,
    frame,
)

REPEAT_AFTER = 0.05
"""Time after which a request without an answer is repeated, or three times its frames [s]."""

_SILENT_AFTER = 2.0  # time without an answer after which the device is in trouble [s]

_N_SESSIONS = 65535


@dataclass
class DeviceCounts:
    """Counts of what happened on the line to a device.

    Attributes:
        repeats: requests that were repeated.
        damaged: answers that were damaged.
        restarts: times that the device had been restarted, or another host had used it.
        losses: times that the line was gone after it had worked.
    """

    repeats: int = 0
    damaged: int = 0
    restarts: int = 0
    losses: int = 0


class DeviceCell:
    """One cell on a device.

    A device that has been restarted gets the waiting step again, after a reset: its cell begins
    afresh, as that of a voxel process that has been restarted.

    Args:
        address: of the device.
        architecture: of the cell, with the arithmetic of the firmware.
        identity: of the firmware that the device must run.

    Attributes:
        counts: of what happened on the line.
        tick_rate: ticks of the device's clock per second; 0 before its hello.
        trouble: why the device does not answer; '' as long as it does.
    """

    def __init__(self, address: Address, architecture: Architecture, identity: Identity) -> None:
        self._address, self._identity = address, identity
        self._codec = CellCodec(architecture)
        self.counts, self.tick_rate, self.trouble = DeviceCounts(), 0, ''
        self._line: Line | None = None
        self._session = 0  # 0: hello first
        self._fresh = False  # whether the device has begun the session
        self._step: tuple[int, np.ndarray, np.ndarray] | None = None
        self._request, self._sent_at, self._repeat_after = b'', 0.0, REPEAT_AFTER
        self._asked_at = 0.0  # time at which the request was first sent [s]
        self._tried_at = -REPEAT_AFTER  # time of the last attempt to open the line [s]

    @property
    def waiting(self) -> bool:
        """Return whether there is a step that the device has not answered."""
        return self._step is not None

    @property
    def ready(self) -> bool:
        """Return whether the device has said hello since the line was opened."""
        return self._session > 0

    def fileno(self) -> int:
        """Return the file descriptor of the line, -1 if it is gone."""
        return -1 if self._line is None else self._line.fileno()

    def reset(self) -> None:
        """Reset the cell before its next step; a step that waits is given up."""
        self._step, self._request, self._fresh = None, b'', False
        if self._session:
            self._session = self._session % _N_SESSIONS + 1

    def begin_step(self, step: int, readings: np.ndarray, inbox: np.ndarray, now: float) -> None:
        """Ask for a control step; `poll` returns the answer.

        Args:
            step: control step k, above those since the reset.
            readings: (n_sensors,) in [0, 1].
            inbox: (4, n_c, width) spikes or values from above, left, below, right.
            now: the time [s].
        """
        self._step = step, readings.copy(), inbox.copy()
        self._next_request(now)

    def poll(self, now: float) -> StepAnswer | None:
        """Take what has arrived and repeat what is due; return the answer to the step, if any.

        Args:
            now: the time [s].

        Raises:
            InvalidInput: the device runs other firmware.
        """
        try:
            if self._line is None and now - self._tried_at >= REPEAT_AFTER:
                self._connect(now)
            if self._line is None:
                return None
            damaged = self._reader.damaged
            payloads = self._reader.feed(self._line.read())
            self.counts.damaged += self._reader.damaged - damaged
            for payload in payloads:
                if answer := self._take(payload, now):
                    return answer
            if self._request and now - self._sent_at >= self._repeat_after:
                self.counts.repeats += 1
                if now - self._asked_at >= _SILENT_AFTER:
                    self.trouble = self.trouble or f'{self._address}: no answer'
                self._send(self._request, now)
        except OSError as error:
            self._lose_line(error, now)
        return None

    def wait_for_answer(self, patience: float) -> StepAnswer | None:
        """Poll until the device has answered the step; None if it does not within `patience` [s].

        Raises:
            InvalidInput: the device runs other firmware.
        """
        end = time.monotonic() + patience
        while True:
            now = time.monotonic()
            if (answer := self.poll(now)) or now >= end:
                return answer
            if self._line is None:
                time.sleep(min(REPEAT_AFTER, end - now))
            else:
                wait_for(self._line, min(self._sent_at + self._repeat_after, end) - now)

    def close(self) -> None:
        """Close the line."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def _connect(self, now: float) -> None:
        """Open the line and say hello."""
        self._tried_at = now
        self._line, self._reader = self._address.open(), FrameReader()
        self._next_request(now)

    def _lose_line(self, error: OSError, now: float) -> None:
        self.trouble = f'{self._address}: {reason_of(error)}'
        self.counts.losses += self.ready
        self._session, self._tried_at = 0, now
        self.close()

    def _next_request(self, now: float) -> None:
        """Send what has to come next: hello, reset or the step; nothing if no step waits."""
        self._asked_at = now
        if self._session == 0:
            self._send(HELLO, now)
        elif self._step is not None:
            step = (self._session, *self._step)
            self._send(
                self._codec.step(*step) if self._fresh else self._codec.reset(self._session), now
            )
        else:
            self._request = b''

    def _send(self, request: bytes, now: float) -> None:
        self._request, self._sent_at = request, now
        if self._line is None:
            return
        framed = frame(request)
        self._repeat_after = max(REPEAT_AFTER, 3.0 * self._address.duration(2 * len(framed)))
        try:
            self._line.write(framed)
        except OSError as error:
            self._lose_line(error, now)

    def _take(self, payload: bytes, now: float) -> StepAnswer | None:
        """Act on a payload that has arrived; return the answer to the step that waits."""
        answer = self._codec.decode(payload)
        if answer is not None:
            self.trouble = ''
        if isinstance(answer, Hello) and self._session == 0:
            check_hello(answer, self._identity, str(self._address))
            self.tick_rate, self._fresh = answer.tick_rate, False
            self._session = answer.session % _N_SESSIONS + 1
            self._next_request(now)
        elif isinstance(answer, SessionAnswer) and self._session:
            self._take_session(answer, now)
        elif isinstance(answer, StepAnswer) and self._step is not None and self._fresh:
            is_of_step = (answer.session, answer.step) == (self._session, self._step[0])
            if is_of_step:
                self._step, self._request = None, b''
            return answer if is_of_step else None
        return None

    def _take_session(self, answer: SessionAnswer, now: float) -> None:
        if answer.known and answer.session == self._session and not self._fresh:
            self._fresh = True
            self._next_request(now)
        elif not answer.known and self._fresh and answer.session != self._session:
            self.counts.restarts += 1
            self._session = 0  # it may run other firmware now
            self._next_request(now)
