"""Any stream of numbers in the form of our inlet: a sine in each channel, with faults.

It does not depend on a body: the numbers only have to be recognised after a recording. Channel k
(from 1) is `k * sin(2 pi k t)` of the time of the sample, seconds of the session.
"""

import math
import struct
from collections.abc import Sequence
from typing import Unpack
from xml.etree.ElementTree import Element, SubElement, tostring

from visavis.devices.contracts import Body
from visavis.devices.drivers.lsl.inlet import OFFSET
from visavis.devices.sim.gaze.source import GazePeer, Measuring, Shot
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_S

ROUND_TRIP_S = 2e-4


class LslStreamSimulator(GazePeer):
    """Send `channels` with their unit, at a rate."""

    usual_rate_hz = 250.0
    usual_epoch_ns = 90 * NS_PER_S

    def __init__(
        self,
        body: Body,
        *,
        channels: Sequence[str] = ("Fz", "Cz", "Pz"),
        unit: str = "microvolts",
        stream_type: str = "EEG",
        **measuring: Unpack[Measuring],
    ) -> None:
        super().__init__(body, **measuring)
        self.channels = tuple(channels)
        self._unit = unit
        self._type = stream_type

    def to_message(self, shot: Shot) -> Frames:
        """Return one sample: its stamp and its numbers."""
        if shot.garbage is not None:
            return (b"sample", shot.garbage)
        t_s = shot.t_ns / NS_PER_S
        numbers = [k * math.sin(2 * math.pi * k * t_s) for k in range(1, len(self.channels) + 1)]
        return (b"sample", struct.pack(f"<{len(numbers) + 1}d", shot.t_device_ns / 1e9, *numbers))

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Describe the stream, or measure the offset of its clock."""
        if frames[0] == b"info":
            return frames[0], self.xml()
        offset_s = (t_ns - self.source.device_ns(t_ns)) / NS_PER_S
        return frames[0], OFFSET.pack(offset_s, ROUND_TRIP_S)

    def xml(self) -> bytes:
        """Return the stream's description as liblsl writes it."""
        root = Element("info")
        for tag, text in {
            "name": "simulated stream",
            "type": self._type,
            "source_id": "sim-stream",
            "channel_count": str(len(self.channels)),
            "channel_format": "double64",
            "nominal_srate": str(self.source.rate_hz),
        }.items():
            SubElement(root, tag).text = text
        root.append(self.desc())
        return tostring(root)

    def desc(self) -> Element:
        """Return the channels' labels and units."""
        desc = Element("desc")
        channels = SubElement(desc, "channels")
        for label in self.channels:
            channel = SubElement(channels, "channel")
            SubElement(channel, "label").text = label
            SubElement(channel, "unit").text = self._unit
        return desc
