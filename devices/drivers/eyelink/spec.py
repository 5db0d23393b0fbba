"""EyeLink: its options and its description."""

from typing import Any

from pydantic import Field

from visavis.devices.drivers.streaming.options import EyeDistanceMm, ScreenOptions
from visavis.devices.libraries import PYLINK
from visavis.devices.spec import Claims, DriverSpec, Product, Wire


class EyeLinkOptions(ScreenOptions):
    """Options of `eyelink`."""

    of_wire = frozenset({"address", "screen_width_px", "screen_height_px"})

    address: str = Field(default="100.1.1.1", min_length=1)
    rate_hz: float = Field(default=1000.0, ge=1, le=2000)
    exchange_interval_s: float = Field(default=1.0, gt=0, le=60)
    screen_width_px: int = Field(default=1920, ge=1, le=100_000)
    screen_height_px: int = Field(default=1080, ge=1, le=100_000)
    pupil_mm_per_unit: float = Field(default=0.0, ge=0, le=1)
    """Millimetres of diameter per unit of the tracker's pupil size; 0 leaves pupils unknown."""
    eye_distance_mm: EyeDistanceMm = 64.0

    def for_driver(self) -> dict[str, Any]:
        """Return the driver's options, with the pixels of the screen."""
        pixels = (self.screen_width_px, self.screen_height_px)
        return {**super().for_driver(), "screen_px": pixels}

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift, screen and its pixels."""
        pixels = (self.screen_width_px, self.screen_height_px)
        return {**super().for_simulator(), "screen_px": pixels}


EYELINK = DriverSpec(
    name="eyelink",
    kind="eye tracker",
    options=EyeLinkOptions,
    product=Product(
        vendor="SR Research",
        model="EyeLink",
        capabilities=frozenset({"gaze", "per_eye", "screen_frame", "annotation"}),
    ),
    wire=Wire(medium="vendor library", library=PYLINK),
    remedy=(
        "switch the EyeLink's host computer on, connect its cable, set this computer's address "
        "to 100.1.1.2, and check `address`"
    ),
    claims=Claims(
        stands_for="EyeLink",
        checked="pylink's own dummy tracker; a strict stand-in for pylink",
        unproven="everything below pylink",
    ),
)
SPECS = (EYELINK,)
