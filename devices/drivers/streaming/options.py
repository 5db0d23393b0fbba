"""Options of the eye trackers that stand before a screen."""

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from devices.options import StreamOptions

if TYPE_CHECKING:
    from devices.drivers.streaming.gaze_rays import Screen

PositiveMm = Annotated[float, Field(gt=0, le=10_000)]
OffsetMm = Annotated[float, Field(ge=-5000, le=5000)]
EyeDistanceMm = Annotated[float, Field(ge=40, le=90)]


class ScreenOptions(StreamOptions):
    """Where the screen stands as seen from the viewing place."""

    screen_width_mm: PositiveMm = 531.0
    screen_height_mm: PositiveMm = 299.0
    screen_distance_mm: PositiveMm = 650.0
    screen_center_right_mm: OffsetMm = 0.0
    screen_center_up_mm: OffsetMm = 0.0

    def screen(self) -> "Screen":
        """Return the screen, for driver and simulator."""
        from devices.drivers.streaming.gaze_rays import Screen

        return Screen(
            **{name.removeprefix("screen_"): getattr(self, name) for name in SCREEN_NAMES}
        )


SCREEN_NAMES = tuple(ScreenOptions.__annotations__)
"""The options that `screen()` takes together."""
