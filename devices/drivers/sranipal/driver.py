"""Drive the eye tracker of a Vive Pro Eye through SRanipal: per-eye rays, pupils, openness.

Codec: `devices.drivers.sranipal.codec`. Transport: `devices.drivers.sranipal.library`. A frame that
was missed leaves a hole in `seq`. Calibration is
the vendor's own, in SteamVR. How open the eyes are is a second stream, `openness`.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from devices.contracts import Health
from devices.drivers.sranipal import codec
from devices.drivers.sranipal.spec import VIVE_PRO_EYE
from devices.drivers.streaming.gaze_device import GazeDevice
from devices.drivers.streaming.gaze_rays import Sample
from devices.transports import Message, MessageTransport
from lab.clock import Clock
from lab.errors import DeviceNotFound
from lab.schema import Field, SampleBatch, StreamSchema

OPENNESS = StreamSchema(
    "openness",
    (
        Field("left_openness_01", "f4", "1", description="0 closed, 1 wide open; NaN if unknown"),
        Field("right_openness_01", "f4", "1", description="0 closed, 1 wide open; NaN if unknown"),
    ),
    120.0,
)


class ViveProEye(GazeDevice):
    """Follow the `EyeTracker` contract over SRanipal; `seq` follows its frame numbers."""

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 120.0,
        lost_after_s: float = 2.0,
    ) -> None:
        self._openness_schema = replace(OPENNESS, nominal_rate_hz=rate_hz)
        self._open: list[tuple[float, float]] = []
        super().__init__(
            role, transport, clock, VIVE_PRO_EYE, rate_hz=rate_hz, lost_after_s=lost_after_s
        )

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return gaze, and how open the eyes are."""
        return (*super().describe(), self._openness_schema)

    def health(self) -> Health:
        """Report the rows of both streams; rate and gaps are those of gaze."""
        health = super().health()
        return replace(health, received=2 * health.received)

    def _connect(self, deadline_ns: int) -> None:
        answer = self._ask((b"start",), deadline_ns).frames
        if answer[-1] != b"\x01":
            raise DeviceNotFound(
                "SRanipal runs, but the headset is no Vive Pro Eye", remedy=VIVE_PRO_EYE.remedy
            )
        self._open = []

    def _decode(self, message: Message) -> Iterable[Sample]:
        found = codec.decode_eye_data(message.frames[0])
        if found is None:
            self._malformed += 1
            return ()
        fault = self._warning("nobody wears the headset", "put it on")
        self._note("worn", None if found.is_worn else fault)
        self._open.append(found.openness_01)
        return (found.sample,)

    def _deliver(self, seqs: Any, stamps: Any, arrivals: Any, values: npt.NDArray[np.void]) -> int:
        delivered = super()._deliver(seqs, stamps, arrivals, values)
        opened, self._open = self._open, []
        if not delivered or self._sink is None or len(opened) != delivered:
            return delivered
        rows = np.array(opened, self._openness_schema.dtype)
        seq, device, host = (np.asarray(column, np.int64) for column in (seqs, stamps, arrivals))
        self._sink(SampleBatch(self._openness_schema, seq, device, host, rows))
        return 2 * delivered
