"""Options of the eye trackers that stand before a screen."""

from typing import Annotated, Any

from pydantic import Field

from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.options import GazeTiming, StreamOptions

PositiveMm = Annotated[float, Field(gt=0, le=10_000)]
OffsetMm = Annotated[float, Field(ge=-5000, le=5000)]
EyeDistanceMm = Annotated[float, Field(ge=40, le=90)]


class ScreenOptions(GazeTiming, StreamOptions):
    """Where the screen stands as seen from the viewing place."""

    screen_width_mm: PositiveMm = 531.0
    screen_height_mm: PositiveMm = 299.0
    screen_distance_mm: PositiveMm = 650.0
    screen_center_right_mm: OffsetMm = 0.0
    screen_center_up_mm: OffsetMm = 0.0

    def screen(self) -> Screen:
        """Return the screen, for driver and simulator."""
        return Screen(
            **{
                name.removeprefix("screen_"): getattr(self, name)
                for name in ScreenOptions.__annotations__
            }
        )

    def for_driver(self) -> dict[str, Any]:
        """Return the driver's options, the screen as one."""
        option_items = super().for_driver().items()
        own = {
            name: value for name, value in option_items if name not in ScreenOptions.__annotations__
        }
        return {**own, "screen": self.screen()}

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift and the screen."""
        return {**super().for_simulator(), "screen": self.screen()}
