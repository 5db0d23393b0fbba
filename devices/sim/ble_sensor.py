"""A sensor on Bluetooth LE in memory: a chest strap on a calm heart, or packets of a lab's own.

Written from the documents that `drivers.ble_sensor.codec` names. The ECG is a spike per beat on
noise. Not modelled: pairing, the radio, an electrode that dries, arrhythmia.
"""

import math
import struct
from collections.abc import Sequence

import numpy as np

from visavis.devices.byte_links import Chunk
from visavis.devices.contracts import Body
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.line_peer import WIRE_NS, LinePeer
from visavis.lab.clock import NS_PER_S, Clock

ECG_HZ, ECG_PER_PACKET = 130, 73
START_ECG = bytes.fromhex("02000001820001010e00")
STARTED = bytes.fromhex("f002000000")
EPOCH_NS = 700_000_000 * NS_PER_S
"""Since 2000, as the strap counts."""
BEATS_HZ = 68 / 60
SPIKE_UV, SPIKE_S, NOISE_UV = 1100.0, 0.012, 8.0


class BleSensorSimulator(LinePeer):
    """Notify as a sensor of a profile; an ECG only once it was started."""

    def __init__(
        self,
        role: str,
        clock: Clock,
        *,
        profile: str = "heart_rate",
        packet_bytes: int = 1,
        packets_hz: float = 1.0,
        seed: int = 0,
        body: Body | None = None,
        faults: FaultSchedule | None = None,
    ) -> None:
        super().__init__(role, clock, seed=seed, body=body, faults=faults)
        self._profile = profile
        self._packet_bytes = packet_bytes
        ecg_packets_hz = ECG_HZ / ECG_PER_PACKET
        rates = {"heart_rate": 1.0, "polar_ecg": ecg_packets_hz}
        self.rate_hz = rates.get(profile, packets_hz)
        self._is_started = profile != "polar_ecg"
        self._answers: list[Chunk] = []

    def accept(self, data: bytes, t_ns: int) -> None:
        """Start the ECG when it is asked for, and answer as the control point does."""
        if self._profile == "polar_ecg":
            self._is_started = self._is_started or data == START_ECG
            refusal = bytes((0xF0, *data[:2], 1))
            answer = STARTED if data == START_ECG else refusal
            self._answers.append(Chunk(t_ns + WIRE_NS, answer))

    def outgoing(self, until_ns: int) -> Sequence[Chunk]:
        """Return the notifications that have arrived."""
        chunks = super().outgoing(until_ns)
        answers = [chunk for chunk in self._answers if chunk.t_host_ns <= until_ns]
        self._answers = [chunk for chunk in self._answers if chunk.t_host_ns > until_ns]
        return sorted([*answers, *(chunks if self._is_started else ())])

    def line(self, t_s: float, t_device_ns: int, rng: np.random.Generator) -> bytes:
        """Return the packet that is sent at this time."""
        if self._profile == "heart_rate":
            rate = 68 + 4 * math.sin(2 * math.pi * t_s / 4.5) + float(rng.normal(0, 1))
            return struct.pack("<BBH", 0b10110, round(rate), round(60 / rate * 1024))
        if self._profile == "polar_ecg":
            return self._ecg(t_s, t_device_ns, rng)
        return bytes(rng.integers(0, 256, self._packet_bytes, np.uint8))

    def _line_chunks(self, t_ns: int) -> list[Chunk]:
        """Return a packet as it is: a notification needs no end of line."""
        return [Chunk(chunk.t_host_ns, chunk.data[:-2]) for chunk in super()._line_chunks(t_ns)]

    def _ecg(self, t_s: float, t_device_ns: int, rng: np.random.Generator) -> bytes:
        packet = struct.pack("<BQB", 0, EPOCH_NS + t_device_ns, 0)
        ago_s = (ECG_PER_PACKET - 1 - np.arange(ECG_PER_PACKET)) / ECG_HZ
        phase_s = (t_s - ago_s) % (1 / BEATS_HZ)
        values_uv = SPIKE_UV * np.exp(-(((phase_s - 0.3) / SPIKE_S) ** 2))
        values_uv += rng.normal(0, NOISE_UV, ECG_PER_PACKET)
        return packet + b"".join(int(v).to_bytes(3, "little", signed=True) for v in values_uv)
