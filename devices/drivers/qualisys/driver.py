"""Receive a moving body from Qualisys Track Manager over its real-time protocol (TCP 22223).

Codec: `visavis.devices.drivers.qualisys.codec`. Device time is QTM's time of the frame, from the
beginning of the measurement. QTM's world has z up (or y, as its project says) and is turned about
ours by `yaw_deg`.
"""

import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from visavis.devices.drivers.qualisys import codec
from visavis.devices.drivers.qualisys.spec import QUALISYS
from visavis.devices.drivers.streaming.body_device import (
    UPRIGHT,
    BodyDevice,
    BodySample,
    turn_world,
    upright,
)
from visavis.devices.plausible import SAMPLES_PER_S
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import ConfigError, DataError, DeviceTimeout, ProtocolViolation

VERSION = "1.24"
STREAM = "streamframes allframes 6dres"


class Qualisys(BodyDevice):
    """Follow the `BodyTracker` contract; `bodies` maps QTM's 6DOF bodies to segments.

    `check` reports a body that QTM does not know, and its segment is not valid.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        bodies: Mapping[str, str],
        rate_hz: float = 100.0,
        yaw_deg: float = 0.0,
        lost_after_s: float = 2.0,
    ) -> None:
        if not bodies or len(set(bodies.values())) != len(bodies):
            raise ConfigError(f"{role}: map each 6DOF body of QTM to a segment of its own")
        self._names = dict(bodies)
        self._yaw_deg = yaw_deg
        self._reader = codec.PacketReader()
        self._settings: codec.Settings | None = None
        self._answers: list[str] = []
        self._has_frame = False
        super().__init__(
            role,
            transport,
            clock,
            QUALISYS,
            segments=tuple(self._names.values()),
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
        )

    def _connect(self, deadline_ns: int) -> None:
        self._reader = codec.PacketReader()
        self._settings, self._answers, self._has_frame = None, [], False
        for text in (f"version {VERSION}", "getparameters general 3d 6d"):
            self._transport.post((codec.command(text),))
        self._wait(lambda: self._settings is not None, deadline_ns, "does not tell its parameters")
        self._take_settings()
        self._transport.post((codec.command(STREAM),))
        self._wait(lambda: self._has_frame, deadline_ns, "measures nothing")

    def _resume(self) -> None:
        self._reader = codec.PacketReader()
        for text in (f"version {VERSION}", STREAM):
            self._transport.post((codec.command(text),))

    def _wait(self, is_there: Callable[[], bool], deadline_ns: int, what: str) -> None:
        while not is_there():
            left_ns = deadline_ns - self._clock.now_ns()
            if left_ns <= 0:
                words = f" (it says: {self._answers[-1]})" if self._answers else ""
                raise DeviceTimeout(f"QTM {what}{words}", remedy=QUALISYS.remedy)
            for message in self._transport.receive(min(0.05, left_ns / NS_PER_S)):
                tuple(self._decode(message))

    def _take_settings(self) -> None:
        settings = self._settings
        assert settings is not None  # noqa: S101 - awaited before
        if settings.up not in UPRIGHT:
            raise ProtocolViolation(
                f"QTM's project has the axis {settings.up or 'unknown'} upwards",
                remedy="let +Z or +Y point upwards in the project's transformation",
            )
        missing = [name for name in self._names if name not in settings.names]
        fault = self._warning(
            f"QTM knows no 6DOF body {', '.join(missing)}; it has {', '.join(settings.names)}",
            "define it in QTM, or name the bodies as they are there",
        )
        self._note("names", fault if missing else None)
        given_hz, told_hz = self._schema.nominal_rate_hz, settings.rate_hz
        fault = self._warning(
            f"QTM measures {told_hz:g} times a second, lab_config.yaml says {given_hz:g}",
            f"write rate_hz: {told_hz:g}",
        )
        differs = SAMPLES_PER_S.admit(told_hz) and abs(told_hz - given_hz) > 0.1 * given_hz
        self._note("rate", fault if differs else None)

    def _decode(self, message: Message) -> Iterable[BodySample]:
        before = self._reader.malformed
        packets = self._reader.feed(b"".join(message.frames))
        self._malformed += self._reader.malformed - before
        for kind, payload in packets:
            try:
                if kind == codec.DATA:
                    self._has_frame = True
                    if self._settings is not None:
                        yield self._sample(codec.decode_frame(payload), self._settings)
                elif kind == codec.XML:
                    self._settings = codec.decode_settings(codec.text_of(payload))
                elif kind == codec.EVENT and payload[:1]:
                    self._take_event(payload[0])
                elif kind in (codec.ERROR, codec.COMMAND):
                    self._answers.append(codec.text_of(payload))
                elif kind == codec.NO_MORE_DATA:
                    self._answers.append("no measurement is running")
            except DataError:
                self._malformed += 1

    def _take_event(self, event: int) -> None:
        text = codec.EVENT_TEXTS.get(event)
        fault = None if text is None else self._blocking(text, QUALISYS.remedy)
        self._note("event", fault)

    def _sample(self, frame: codec.Frame, settings: codec.Settings) -> BodySample:
        if len(frame.bodies) != len(settings.names):
            raise DataError(f"{len(frame.bodies)} bodies for {len(settings.names)} names")
        n = len(self.segments)
        position, turn = np.full((n, 3), np.nan), np.full((n, 4), np.nan)
        valid = np.zeros(n, np.bool_)
        by_name = dict(zip(settings.names, frame.bodies, strict=True))
        for row, name in enumerate(self._names):
            body = by_name.get(name)
            facing = None if body is None else codec.quaternion(body[1])
            if body is not None and facing is not None and all(map(math.isfinite, body[0])):
                position[row], turn[row], valid[row] = body[0], facing, True
        turn_world(upright(settings.up, self._yaw_deg), position, turn, valid)
        return BodySample(frame.number, frame.t_us * 1000, position, turn, valid)
