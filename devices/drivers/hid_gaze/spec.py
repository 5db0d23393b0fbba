"""HID eye trackers: their options and their description."""

from pydantic import Field

from visavis.devices.drivers.streaming.options import EyeDistanceMm, ScreenOptions
from visavis.devices.libraries import HID
from visavis.devices.spec import Claims, DriverSpec, Product, Wire


class HidGazeOptions(ScreenOptions):
    """Options of `hid_gaze`; an empty serial takes the first eye tracker found."""

    of_wire = frozenset({"serial"})

    serial: str = ""
    time_unit_us: float = Field(default=0.0, ge=0, le=1_000_000)
    """Microseconds per tick of the time stamp; 0 finds the unit from the rate."""
    eye_distance_mm: EyeDistanceMm = 64.0


HID_GAZE = DriverSpec(
    name="hid_gaze",
    kind="eye tracker",
    options=HidGazeOptions,
    product=Product(
        vendor="HID", model="HID eye tracker", capabilities=frozenset({"gaze", "screen_frame"})
    ),
    wire=Wire(medium="USB HID", library=HID),
    remedy="plug the eye tracker in, install its software, and calibrate it there",
    claims=Claims(
        stands_for="USB HID eye tracker, usage page 0x12",
        checked="our reading of the HID usage tables; genuine hidapi over umockdev",
        unproven="real descriptors, unit of stamps",
    ),
)
SPECS = (HID_GAZE,)
