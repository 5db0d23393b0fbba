"""Tobii Pro: its options and its description."""

from typing import ClassVar

from pydantic import Field

from visavis.devices.drivers.streaming.options import EyeDistanceMm, ScreenOptions
from visavis.devices.libraries import TITTA
from visavis.devices.spec import Claims, DriverSpec, Product, Wire


class TobiiProOptions(ScreenOptions):
    """Options of `tobii_pro`; `serial` chooses where there are several."""

    of_wire: ClassVar[frozenset[str]] = frozenset({"serial"})

    serial: str = ""
    exchange_interval_s: float = Field(default=5.0, gt=0, le=600)
    eye_distance_mm: EyeDistanceMm = 64.0


TOBII_PRO = DriverSpec(
    name="tobii_pro",
    kind="eye tracker",
    options=TobiiProOptions,
    product=Product(
        vendor="Tobii", model="Tobii Pro", capabilities=frozenset({"gaze", "pupil", "per_eye"})
    ),
    wire=Wire(medium="Tobii Pro SDK", library=TITTA),
    remedy=(
        "connect the tracker, look whether Tobii Pro Eye Tracker Manager finds it, and set the "
        "screen up and calibrate there"
    ),
    claims=Claims(
        stands_for="Tobii Pro Spectrum, Fusion, Nano, Spark and X3 on a screen",
        checked=(
            "names and functions against TittaPy 2.1 with the maker's SDK 2.1 inside; a stand-in "
            "for it, by our reading of its source"
        ),
        unproven="any tracker; the SDK's own time exchanges",
    ),
)
SPECS = (TOBII_PRO,)
