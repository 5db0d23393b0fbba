"""Qualisys Track Manager as seen from its real-time port: 6DOF bodies of a moving body.

Written from Qualisys' client and settings (see `drivers.qualisys.codec`), with a coder of its own.
Not modelled: cameras, markers, skeletons, control by clients. A stream cannot lose bytes, so losses
and garbage apply to whole packets.
"""

import struct
from collections.abc import Sequence

import numpy as np

from visavis.devices.sim.body.wire import NamedBodiesWire
from visavis.lab.geometry import Vector, rotate


class QualisysSimulator(NamedBodiesWire):
    """Answer version and parameters, and stream frames once it was asked to.

    With `is_measuring` false nothing is measured; `up` is the axis that points upwards.
    """

    usual_delay_ms = 3.0
    epoch_ns = 40_000_000_000
    is_measuring = True
    up = "+Z"
    _is_asked = False

    def is_streaming(self, t_ns: int) -> bool:
        """Tell whether somebody asked for frames."""
        return self._is_asked and self.is_measuring

    def answer(self, request: bytes, t_ns: int) -> bytes | None:
        """Answer the commands in these bytes."""
        answers = b""
        while len(request) >= 8:
            size, kind = struct.unpack_from("<II", request)
            if not 8 <= size <= len(request):
                break
            if kind == 1:
                answers += self._obey(request[8:size].rstrip(b"\0").decode("utf-8", "replace"))
            request = request[size:]
        return answers or None

    def encode(
        self, number: int, device_ns: int, position_m: Vector, turn: Vector, *, tracked: bool
    ) -> Sequence[bytes]:
        """Return one data packet."""
        content = struct.pack("<IHH", len(self.names), 0, 0)
        for place, facing in zip(position_m, turn, strict=True):
            x, y, z = (float(v) * 1e3 for v in place)
            numbers = [x, -z, y]  # our y is QTM's z
            for axis in np.eye(3):  # a column is where the body's axis points
                ours = rotate(facing, np.array((axis[0], axis[2], -axis[1])))
                numbers += [float(ours[0]), -float(ours[2]), float(ours[1])]
            if not tracked or not np.isfinite(numbers).all():
                numbers = [float("nan")] * 12
            content += struct.pack("<3f9ff", *numbers, 0.4)
        component = struct.pack("<II", 8 + len(content), 11) + content
        header = struct.pack("<qII", device_ns // 1000, number & 0xFFFFFFFF, 1)
        return (_packet(3, header + component),)

    def _obey(self, text: str) -> bytes:
        verb, _, rest = text.lower().partition(" ")
        if verb == "version":
            return _packet(1, f"Version set to {rest}".encode() + b"\0")
        if verb == "getparameters":
            return _packet(2, self._xml().encode() + b"\0")
        if verb == "streamframes":
            self._is_asked = rest != "stop"
            return b"" if self.is_measuring else _packet(4, b"")
        return _packet(0, b"Parse error\0")

    def _xml(self) -> str:
        bodies = "".join(
            f"<Body><Name>{name}</Name><Enabled>true</Enabled></Body>" for name in self.names
        )
        return (
            "<QTM_Parameters_Ver_1.24>"
            f"<General><Frequency>{self._rate_hz:g}</Frequency></General>"
            f"<The_3D><AxisUpwards>{self.up}</AxisUpwards></The_3D>"
            f"<The_6D>{bodies}</The_6D></QTM_Parameters_Ver_1.24>"
        )


def _packet(kind: int, payload: bytes) -> bytes:
    return struct.pack("<II", 8 + len(payload), kind) + payload
