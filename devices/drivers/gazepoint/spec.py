"""Gazepoint: its options and its description."""

from typing import Any

from pydantic import Field

from visavis.devices.drivers.streaming.options import (
    EyeDistanceMm,
    OffsetMm,
    ScreenOptions,
)
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

REMEDY = "start Gazepoint Control, connect the tracker, and check address, port 4242 and firewall"


class GazepointOptions(ScreenOptions):
    """Options of `gazepoint`; the camera's place is given from the screen's centre."""

    of_wire = frozenset({"address", "port"})

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=4242, ge=1, le=65535)
    rate_hz: float = Field(default=60.0, ge=1, le=2000)
    camera_right_mm: OffsetMm = 0.0
    camera_up_mm: OffsetMm = -180.0
    camera_toward_mm: OffsetMm = 0.0
    eye_distance_mm: EyeDistanceMm = 64.0

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift, screen and the camera's place in the head frame, metres."""
        camera_m = (
            (self.screen_center_right_mm + self.camera_right_mm) * 1e-3,
            (self.screen_center_up_mm + self.camera_up_mm) * 1e-3,
            (self.camera_toward_mm - self.screen_distance_mm) * 1e-3,
        )
        return {**super().for_simulator(), "camera_m": camera_m}


GAZEPOINT = DriverSpec(
    name="gazepoint",
    kind="eye tracker",
    options=GazepointOptions,
    product=Product(
        vendor="Gazepoint",
        model="Gazepoint",
        capabilities=(
            frozenset({"gaze", "per_eye", "pupil", "screen_frame", "calibration", "annotation"})
        ),
    ),
    wire=Wire(medium="TCP", dials=True),
    remedy=REMEDY,
    claims=Claims(
        stands_for="Gazepoint GP3",
        checked="every example of the Open Gaze document; TCP",
        unproven="axes of eye positions, missing fields",
    ),
)
SPECS = (GAZEPOINT,)
