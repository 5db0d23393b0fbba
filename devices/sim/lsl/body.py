"""An LSL motion stream of a moving body, in the form of our inlet.

The bytes are those of `visavis.devices.drivers.lsl.inlet`: a stamp and the channels, all doubles.
Not modelled: LSL's discovery, its buffers and its clock exchanges (liblsl's own, tested for the
outlets over the loopback).
"""

import struct
from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, tostring

from visavis.devices.contracts import MovingBody, body_schema
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.body.wire import BodyWire
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.geometry import Vector
from visavis.lab.xdf_channels import describe


class LslBodySimulator(BodyWire):
    """Send `objects` (name in the stream -> segment) with the meta-data of our own outlets."""

    def __init__(
        self,
        body: MovingBody,
        clock: Clock,
        *,
        objects: Mapping[str, str],
        seed: int,
        rate_hz: float = 60.0,
        faults: FaultSchedule | None = None,
        drift_ppm: float = 0.0,
        delay_ms: float = 1.0,
        jitter_ms: float = 0.3,
    ) -> None:
        super().__init__(
            body,
            clock,
            seed=seed,
            segments=tuple(objects.values()),
            rate_hz=rate_hz,
            faults=faults,
            drift_ppm=drift_ppm,
            delay_ms=delay_ms,
            jitter_ms=jitter_ms,
            epoch_ns=90_000_000_000,
        )
        root = Element("info")
        describe(SubElement(root, "desc"), body_schema(tuple(objects), rate_hz))
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
