"""OptiTrack Motive as seen from the network: rigid bodies or one skeleton of a moving body.

Written from OptiTrack's description of NatNet and a public client. Not modelled: cameras and
markers (a few are sent so that their sections have to be stepped over), force plates, devices
other than one, playback commands. As Motive does for unicast clients, it stops streaming to one
that was silent for longer than a few seconds.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import Unpack

from visavis.devices.contracts import MovingBody
from visavis.devices.sim.body.wire import NamedBodiesWire, Streaming
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.geometry import Vector

CLOCK_HZ = 10_000_000
FORGOTTEN_AFTER_NS = 5 * NS_PER_S
SKELETON_NUMBER = 3


class NatNetSimulator(NamedBodiesWire):
    """Answer connect and model requests and stream frames in protocol `version`.

    `bodies` maps rigid body names to segments; with `skeleton` they are its bones instead.
    """

    usual_rate_hz = 120.0
    usual_delay_ms = 4.0
    epoch_ns = 5_000_000_000_000

    def __init__(
        self,
        body: MovingBody,
        clock: Clock,
        *,
        bodies: Mapping[str, str],
        skeleton: str = "",
        version: tuple[int, int] = (4, 1),
        **streaming: Unpack[Streaming],
    ) -> None:
        super().__init__(body, clock, bodies=bodies, **streaming)
        self._skeleton = skeleton
        version_fault = self._faults.active("version", 0)
        parts = version_fault.text.split(".") if version_fault is not None else version
        self._version = (int(parts[0]), int(parts[1]))
        self._heard_ns: int | None = None

    def is_streaming(self, t_ns: int) -> bool:
        """Tell whether a client has sent anything lately."""
        return self._heard_ns is not None and t_ns - self._heard_ns < FORGOTTEN_AFTER_NS

    def answer(self, request: bytes, t_ns: int) -> bytes | None:
        """Answer connect and model requests; anything counts as a sign of life."""
        if len(request) < 4:
            return None
        message = struct.unpack_from("<H", request)[0]
        self._heard_ns = t_ns
        if message == 0:
            return self._message(1, self._server_info())
        if message == 4:
            return self._message(5, self._models())
        return None if message == 10 else self._message(100, b"")

    def encode(
        self, number: int, device_ns: int, position_m: Vector, turn: Vector, *, tracked: bool
    ) -> Sequence[bytes]:
        """Return one frame; Motive's T-pose faces +z."""
        rigid = b"".join(
            self._rigid_body(i + 1, position_m[i], turn[i], tracked=tracked)
            for i in range(len(self.names))
        )
        n = len(self.names)
        marker = struct.pack("<i3ffhf", 65537, 0.1, 0.2, 0.3, 0.014, 1, 0.0004)
        bones = struct.pack("<ii", SKELETON_NUMBER, n) + rigid
        plate = struct.pack("<iiif", 1, 1, 1, 9.81)
        ticks = device_ns * CLOCK_HZ // NS_PER_S
        payload = struct.pack("<i", number)
        payload += self._section(1, b"all\0" + struct.pack("<i3f", 1, 0.1, 0.2, 0.3))
        payload += self._section(2, struct.pack("<6f", *[0.5] * 6))
        payload += self._section(0, b"") if self._skeleton else self._section(n, rigid)
        payload += self._section(1, bones) if self._skeleton else self._section(0, b"")
        if self._version >= (4, 1):
            asset = struct.pack("<iii7ffhi", 9, 1, 1, *[0.0] * 6, 1.0, 0.0, 1, 0)
            payload += self._section(1, asset)
        payload += self._section(1, marker)
        payload += self._section(1, plate)
        payload += self._section(1, plate)
        payload += struct.pack("<IId", 0, 0, device_ns / NS_PER_S)
        payload += struct.pack("<QQQ", ticks, ticks + CLOCK_HZ // 500, ticks + CLOCK_HZ // 400)
        if self._version >= (4, 1):
            payload += struct.pack("<II", 0, 0)
        payload += struct.pack("<Hi", 0, 0)
        return (self._message(7, payload),)

    def _rigid_body(self, number: int, at: Vector, turn: Vector, *, tracked: bool) -> bytes:
        """Return one body, turned by 180° about y into Motive's world."""
        x, y, z = at
        w, i, j, k = turn
        first = SKELETON_NUMBER << 16 if self._skeleton else 0
        return struct.pack("<i3f4ffh", first | number, -x, y, -z, -i, j, -k, w, 0.0003, tracked)

    def _section(self, count: int, content: bytes) -> bytes:
        if self._version >= (4, 1):
            return struct.pack("<ii", count, len(content)) + content
        return struct.pack("<i", count) + content

    def _server_info(self) -> bytes:
        major, minor = self._version
        info = struct.pack("<256s4B4B", b"Motive", 3, 1, 0, 0, major, minor, 0, 0)
        return info + struct.pack("<QHB4B", CLOCK_HZ, 1511, 0, 239, 255, 42, 99)

    def _models(self) -> bytes:
        if self._skeleton:
            head = self._skeleton.encode() + b"\0"
            head += struct.pack("<ii", SKELETON_NUMBER, len(self.names))
            bones = b"".join(self._description(i + 1, n) for i, n in enumerate(self.names))
            descriptions = [(2, head + bones)]
        else:
            descriptions = [(1, self._description(i + 1, n)) for i, n in enumerate(self.names)]
        descriptions.insert(0, (0, b"all\0" + struct.pack("<i", 1) + b"marker\0"))
        payload = struct.pack("<i", len(descriptions))
        for kind, content in descriptions:
            payload += struct.pack("<i", kind)
            if self._version >= (4, 1):
                payload += struct.pack("<i", len(content))
            payload += content
        return payload

    def _description(self, number: int, name: str) -> bytes:
        out = name.encode() + b"\0" + struct.pack("<ii3f", number, -1, 0.0, 0.0, 0.0)
        if self._version >= (4, 2):
            out += struct.pack("<4f", 0.0, 0.0, 0.0, 1.0)
        out += struct.pack("<i", 1) + struct.pack("<3fi", 0.0, 0.1, 0.0, 1)
        return out + b"m1\0" if self._version >= (4, 0) else out

    def _message(self, number: int, payload: bytes) -> bytes:
        return struct.pack("<HH", number, len(payload)) + payload
