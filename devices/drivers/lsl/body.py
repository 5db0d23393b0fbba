"""Receive a moving body from an LSL stream that names its channels by the MoCap meta-data.

Each channel says its `object` (the segment) and its `type` (PositionX/Y/Z, OrientationA/B/C/D in
the order w, x, y, z, and Valid where there is one), as our own outlets do. Stamps stay the
sender's. Frames are not converted: the sender must use metres, y up, −z forward.
"""

import struct
from collections.abc import Iterable, Mapping
from xml.etree import ElementTree

import numpy as np

from visavis.devices.drivers.lsl.spec import LSL_BODY
from visavis.devices.drivers.streaming.body_device import BodyDevice, BodySample
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import ConfigError, ProtocolViolation

POSITION = ("PositionX", "PositionY", "PositionZ")
TURN = ("OrientationA", "OrientationB", "OrientationC", "OrientationD")
VALID = "Valid"


def read_layout(xml: bytes) -> dict[tuple[str, str], int]:
    """Return the channel of every (object, type) a stream's XML names.

    Raises ProtocolViolation when it is no XML or names no objects.
    """
    try:
        root = ElementTree.fromstring(xml)  # noqa: S314 - of a peer in the lab, as LSL gives it
    except ElementTree.ParseError as cause:
        raise ProtocolViolation("the stream describes itself in no XML") from cause
    layout: dict[tuple[str, str], int] = {}
    for number, channel in enumerate(root.iterfind("./desc/channels/channel")):
        name, kind = channel.findtext("object"), channel.findtext("type")
        if name and kind:
            layout[name, kind] = number
    if not layout:
        raise ProtocolViolation(
            "the stream's channels name no objects",
            remedy="let the sender name object and type of each channel (XDF MoCap meta-data)",
        )
    return layout


class LslBody(BodyDevice):
    """Follow the `BodyTracker` contract; `objects` maps the stream's objects to segments."""

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        objects: Mapping[str, str],
        rate_hz: float = 60.0,
        lost_after_s: float = 2.0,
    ) -> None:
        if not objects or len(set(objects.values())) != len(objects):
            raise ConfigError(f"{role}: map each object of the stream to a segment of its own")
        self._objects = dict(objects)
        self._places: list[tuple[list[int], list[int], int | None]] = []
        self._min_channels = 0
        super().__init__(
            role,
            transport,
            clock,
            LSL_BODY,
            segments=tuple(self._objects.values()),
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
        )

    def _connect(self, deadline_ns: int) -> None:
        left_s = max(0.001, (deadline_ns - self._clock.now_ns()) / NS_PER_S)
        layout = read_layout(self._transport.request((b"info",), left_s).frames[-1])
        self._places = []
        for name in self._objects:
            missing = [kind for kind in (*POSITION, *TURN) if (name, kind) not in layout]
            if missing:
                objects = ", ".join(sorted({n for n, _ in layout}))
                raise ProtocolViolation(
                    f"the stream has no {', '.join(missing)} of {name!r}; its objects: {objects}",
                    remedy="name the objects as the stream does",
                )
            self._places.append(
                (
                    [layout[name, kind] for kind in POSITION],
                    [layout[name, kind] for kind in TURN],
                    layout.get((name, VALID)),
                )
            )
        self._min_channels = 1 + max(layout.values())

    def _decode(self, message: Message) -> Iterable[BodySample]:
        raw = message.frames[-1]
        if len(raw) % 8 or len(raw) < 8 * (1 + self._min_channels):
            self._malformed += 1
            return ()
        stamp_s, *numbers = struct.unpack(f"<{len(raw) // 8}d", raw)
        if not abs(stamp_s) < 9e9:
            self._malformed += 1
            return ()
        values = np.array(numbers)
        n = len(self._places)
        position, turn = np.full((n, 3), np.nan), np.full((n, 4), np.nan)
        valid = np.zeros(n, np.bool_)
        for row, (at, facing, flag) in enumerate(self._places):
            p, q = values[at], values[facing]
            with np.errstate(over="ignore", invalid="ignore"):
                length = float(np.sqrt((q * q).sum()))
            is_valid = flag is None or values[flag] > 0.5
            if is_valid and abs(length - 1) < 0.02:
                position[row], turn[row], valid[row] = p, q / length, True
        return (BodySample(None, round(stamp_s * NS_PER_S), position, turn, valid),)
