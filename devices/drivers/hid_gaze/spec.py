"""HID eye trackers: their options, their wire, their simulator."""

from typing import TYPE_CHECKING

from pydantic import Field

from devices.drivers.streaming.options import SCREEN_NAMES, EyeDistanceMm, ScreenOptions
from devices.libraries import HID
from devices.spec import DriverSpec, Site

if TYPE_CHECKING:
    from devices.drivers.hid_gaze.driver import HidGaze
    from devices.transports import MessageTransport


class HidGazeOptions(ScreenOptions):
    """Options of `hid_gaze`; an empty serial takes the first eye tracker found."""

    serial: str = ""
    time_unit_us: float = Field(default=0.0, ge=0, le=1_000_000)
    """Microseconds per tick of the time stamp; 0 finds the unit from the rate."""
    eye_distance_mm: EyeDistanceMm = 64.0


Here = Site[HidGazeOptions]


def _reports(site: Here) -> "MessageTransport":
    from devices.drivers.hid_gaze.reports import HidReports

    return HidReports(site.options.serial, site.clock)


def _simulated_reports(site: Here) -> "MessageTransport":
    from devices.sim.hid_gaze import HidGazeSimulator

    return site.streamed(HidGazeSimulator, site.watched, screen=site.options.screen())


def _hid_gaze(site: Here, wire: "MessageTransport") -> "HidGaze":
    from devices.drivers.hid_gaze.driver import HidGaze

    options = site.options.without("serial", *SCREEN_NAMES)
    return HidGaze(site.role, wire, site.clock, screen=site.options.screen(), **options)


HID_GAZE = DriverSpec(
    name="hid_gaze",
    kind="eye tracker",
    options=HidGazeOptions,
    make=_hid_gaze,
    real=_reports,
    simulated=_simulated_reports,
    vendor="HID",
    model="HID eye tracker",
    wire="USB HID",
    remedy="plug the eye tracker in, install its software, and calibrate it there",
    capabilities=frozenset({"gaze", "screen_frame"}),
    library=HID,
    stands_for="USB HID eye tracker, usage page 0x12",
    checked="genuine hidapi over umockdev",
    unproven="real descriptors, unit of stamps",
)
SPECS = (HID_GAZE,)
