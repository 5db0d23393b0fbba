"""An LSL motion stream of a moving body, in the form of our inlet.

The bytes are those of `visavis.devices.drivers.lsl.inlet`: a stamp and the channels, all doubles.
Not modelled: LSL's discovery, its buffers and its clock exchanges (liblsl's own, tested for the
outlets over the loopback).
"""

import struct
from collections.abc import Mapping, Sequence
from typing import Unpack
from xml.etree.ElementTree import Element, SubElement, tostring

from visavis.devices.contracts import MovingBody, body_schema
from visavis.devices.sim.body.wire import NamedBodiesWire, Streaming
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.geometry import Vector
from visavis.lab.xdf_channels import describe


class LslBodySimulator(NamedBodiesWire):
    """Send `bodies` (object of the stream -> segment) with the meta-data of our own outlets."""

    usual_rate_hz = 60.0
    usual_delay_ms = 1.0
    usual_jitter_ms = 0.3
    epoch_ns = 90_000_000_000

    def __init__(
        self,
        body: MovingBody,
        clock: Clock,
        *,
        bodies: Mapping[str, str],
        **streaming: Unpack[Streaming],
    ) -> None:
        super().__init__(body, clock, bodies=bodies, **streaming)
        root = Element("info")
        describe(SubElement(root, "desc"), body_schema(self.names, self._rate_hz))
        self._xml = tostring(root)

    def answer(self, request: bytes, t_ns: int) -> bytes | None:
        """Describe the stream."""
        return self._xml if request == b"info" else None

    def encode(
        self, number: int, device_ns: int, position_m: Vector, turn: Vector, *, tracked: bool
    ) -> Sequence[bytes]:
        """Return one sample."""
        n = len(self.segments)
        numbers = [*position_m.ravel(), *turn.ravel()] if tracked else [float("nan")] * 7 * n
        return (
            struct.pack(f"<{1 + 8 * n}d", device_ns / NS_PER_S, *numbers, *[float(tracked)] * n),
        )
