"""Vicon Tracker as seen from its UDP object stream: objects of a moving body.

Written from the structures that public clients carry (see `drivers.vicon.codec`), with a coder of
its own that turns rotations by scipy. Not modelled: markers, the choice of smaller packets, other
kinds of items. An object that is not seen is sent with zeros, or with `leaves_out` not at all.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import Unpack

import numpy as np
from scipy.spatial.transform import Rotation

from visavis.devices.contracts import MovingBody
from visavis.devices.sim.body.wire import NamedBodiesWire, Streaming
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.geometry import Vector

SIZES = (256, 512, 1024)
OBJECT_BYTES = 75
HEAD_BYTES = 5
TO_Z_UP = Rotation.from_euler("x", 90, degrees=True)
"""Our axes in a world with z up: its y is our −z."""


class ViconSimulator(NamedBodiesWire):
    """Stream frames in packets of `packet_bytes`; an object takes 75 of them.

    A frame's number counts from the start of Tracker, at the rate of the frames.
    """

    usual_delay_ms = 3.0
    leaves_out = False

    def __init__(
        self,
        body: MovingBody,
        clock: Clock,
        *,
        bodies: Mapping[str, str],
        up: str = "+Z",
        packet_bytes: int = 512,
        **streaming: Unpack[Streaming],
    ) -> None:
        super().__init__(body, clock, bodies=bodies, **streaming)
        if packet_bytes not in SIZES:
            raise ValueError(f"packets have {SIZES} bytes")
        self._world = TO_Z_UP if up == "+Z" else Rotation.identity()
        self._bytes = packet_bytes

    def encode(
        self, number: int, device_ns: int, position_m: Vector, turn: Vector, *, tracked: bool
    ) -> Sequence[bytes]:
        """Return the packets of one frame, numbered by the clock of Tracker."""
        items = []
        for name, place, facing in zip(self.names, position_m, turn, strict=True):
            numbers = self._numbers(place, facing)
            is_seen = tracked and bool(np.isfinite(numbers).all())
            if is_seen or not self.leaves_out:
                values = numbers if is_seen else np.zeros(6)
                items.append(
                    b"\0\x48\0" + name.encode()[:24].ljust(24, b"\0") + struct.pack("<6d", *values)
                )
        room = (self._bytes - HEAD_BYTES) // OBJECT_BYTES
        frame = round(device_ns * self._rate_hz / NS_PER_S)
        return [
            (struct.pack("<IB", frame, len(part)) + b"".join(part)).ljust(self._bytes, b"\0")
            for part in (items[i : i + room] for i in range(0, max(len(items), 1), room))
        ]

    def _numbers(self, place_m: Vector, facing_wxyz: Vector) -> Vector:
        """Return position (mm) and rotation (rad) in Tracker's world."""
        if not np.isfinite(facing_wxyz).all():
            return np.full(6, np.nan)
        w, x, y, z = facing_wxyz
        turn = self._world * Rotation.from_quat((x, y, z, w)) * self._world.inv()
        return np.concatenate((self._world.apply(place_m) * 1000, turn.as_euler("XYZ")))
