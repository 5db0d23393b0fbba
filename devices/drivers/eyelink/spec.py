"""EyeLink: its options and its description."""

import math
from dataclasses import dataclass
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from visavis.devices.drivers.streaming.options import EyeDistanceMm, ScreenOptions
from visavis.devices.libraries import PYLINK
from visavis.devices.spec import Claims, DriverSpec, Product, Wire


@dataclass(frozen=True)
class PupilScale:
    """An artificial pupil of so many millimetres, and the size that the tracker gave it.

    The tracker gives a pupil's diameter or, with `is_area`, its area, which grows by the square of
    the diameter. Without a measurement (0 units) sizes stay unknown.
    """

    artificial_mm: float = 0.0
    artificial_units: float = 0.0
    is_area: bool = False

    def diameter_mm(self, units: float) -> float:
        """Return the diameter of a pupil of this size; NaN when it is not known."""
        if not (self.artificial_units > 0 and 0 < units < math.inf):
            return math.nan
        share = units / self.artificial_units
        return self.artificial_mm * (math.sqrt(share) if self.is_area else share)


class EyeLinkOptions(ScreenOptions):
    """Options of `eyelink`."""

    of_wire = frozenset(
        {
            "address",
            "screen_width_px",
            "screen_height_px",
            "pupil_size",
            "artificial_pupil_mm",
            "artificial_pupil_units",
            "pupil_mm_per_unit",
        }
    )

    address: str = Field(default="100.1.1.1", min_length=1)
    rate_hz: float = Field(default=1000.0, ge=1, le=2000)
    exchange_interval_s: float = Field(default=1.0, gt=0, le=60)
    screen_width_px: int = Field(default=1920, ge=1, le=100_000)
    screen_height_px: int = Field(default=1080, ge=1, le=100_000)
    pupil_size: Literal["diameter", "area"] = "diameter"
    """What the tracker is told to give for a pupil's size."""
    artificial_pupil_mm: float = Field(default=0.0, ge=0, le=20)
    """Diameter of an artificial pupil measured in the lab; 0 leaves pupils unknown."""
    artificial_pupil_units: float = Field(default=0.0, ge=0, le=1e6)
    """The size that the tracker gave it, with the same `pupil_size`."""
    drift_correction: bool = False
    """Whether a drift check of a session also lets the tracker shift its gaze."""
    pupil_mm_per_unit: float = Field(default=0.0, ge=0, le=1)
    """As recordings of version 0.3 and earlier state it; a tracker is not opened with it."""
    eye_distance_mm: EyeDistanceMm = 64.0

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if bool(self.artificial_pupil_mm) != bool(self.artificial_pupil_units):
            raise ValueError("give artificial_pupil_mm and artificial_pupil_units together")
        return self

    @property
    def pupil_scale(self) -> PupilScale:
        """What makes millimetres of the tracker's sizes."""
        if self.pupil_mm_per_unit:
            return PupilScale(self.pupil_mm_per_unit, 1.0)
        return PupilScale(
            self.artificial_pupil_mm, self.artificial_pupil_units, self.pupil_size == "area"
        )

    def for_driver(self) -> dict[str, Any]:
        """Return the driver's options, with the pixels of the screen and the scale of pupils."""
        pixels = (self.screen_width_px, self.screen_height_px)
        return {**super().for_driver(), "screen_px": pixels, "pupil_scale": self.pupil_scale}

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift, screen, its pixels and what is given for a pupil's size."""
        pixels = (self.screen_width_px, self.screen_height_px)
        is_area = self.pupil_size == "area"
        return {**super().for_simulator(), "screen_px": pixels, "gives_area": is_area}


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
