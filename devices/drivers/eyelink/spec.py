"""EyeLink: its options, its wire, its simulator."""

from typing import TYPE_CHECKING

from pydantic import Field

from devices.drivers.streaming.options import SCREEN_NAMES, EyeDistanceMm, ScreenOptions
from devices.libraries import PYLINK
from devices.spec import DriverSpec, Site

if TYPE_CHECKING:
    from devices.drivers.eyelink.driver import EyeLink
    from devices.transports import MessageTransport


class EyeLinkOptions(ScreenOptions):
    """Options of `eyelink`."""

    address: str = Field(default="100.1.1.1", min_length=1)
    rate_hz: float = Field(default=1000.0, ge=1, le=2000)
    exchange_interval_s: float = Field(default=1.0, gt=0, le=60)
    screen_width_px: int = Field(default=1920, ge=1, le=100_000)
    screen_height_px: int = Field(default=1080, ge=1, le=100_000)
    pupil_mm_per_unit: float = Field(default=0.0, ge=0, le=1)
    """Millimetres of diameter per unit of the tracker's pupil size; 0 leaves pupils unknown."""
    eye_distance_mm: EyeDistanceMm = 64.0

    def screen_px(self) -> tuple[int, int]:
        """Return the width and height of the screen in pixels."""
        return self.screen_width_px, self.screen_height_px


Here = Site[EyeLinkOptions]


def _host(site: Here) -> "MessageTransport":
    from devices.drivers.eyelink.library import EyeLinkLibrary

    return EyeLinkLibrary(site.options.address, site.clock)


def _simulated_host(site: Here) -> "MessageTransport":
    from devices.sim.eyelink import EyeLinkSimulator

    return site.streamed(
        EyeLinkSimulator,
        site.watched,
        screen=site.options.screen(),
        screen_px=site.options.screen_px(),
    )


def _eyelink(site: Here, wire: "MessageTransport") -> "EyeLink":
    from devices.drivers.eyelink.driver import EyeLink

    given = site.options
    options = given.without("address", "screen_width_px", "screen_height_px", *SCREEN_NAMES)
    screen, screen_px = given.screen(), given.screen_px()
    return EyeLink(site.role, wire, site.clock, screen=screen, screen_px=screen_px, **options)


EYELINK = DriverSpec(
    name="eyelink",
    kind="eye tracker",
    options=EyeLinkOptions,
    make=_eyelink,
    real=_host,
    simulated=_simulated_host,
    vendor="SR Research",
    model="EyeLink",
    wire="vendor library",
    remedy="switch the EyeLink's host computer on, connect its cable, set this computer's address "
    "to 100.1.1.2, and check `address`",
    capabilities=frozenset({"gaze", "per_eye", "screen_frame", "annotation"}),
    library=PYLINK,
    stands_for="EyeLink",
    checked="stand-in for pylink",
    unproven="everything below pylink",
)
SPECS = (EYELINK,)
