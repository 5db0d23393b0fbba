"""The flat screen that a screen-based eye tracker measures on; loads neither numpy nor a driver."""

import math
from dataclasses import dataclass

Triple = tuple[float, float, float]

NAN = math.nan


@dataclass(frozen=True)
class Screen:
    """A flat screen before the eyes, all mm; turns a point on it into a ray.

    The head frame of a screen-based tracker is that of a head which faces the screen upright
    from the viewing place: its axes are the screen's (x right, y up, −z into the screen) and its
    origin lies `distance_mm` before the screen; `center_right_mm` and `center_up_mm` are the place
    of the screen's centre as seen from there. Turns of the head do not move this frame.
    """

    width_mm: float = 531.0
    height_mm: float = 299.0
    distance_mm: float = 650.0
    center_right_mm: float = 0.0
    center_up_mm: float = 0.0

    def point_m(self, x_01: float, y_01: float) -> Triple:
        """Return a point given in shares of the screen, origin at its top left."""
        return (
            (self.center_right_mm + (x_01 - 0.5) * self.width_mm) * 1e-3,
            (self.center_up_mm + (0.5 - y_01) * self.height_mm) * 1e-3,
            -self.distance_mm * 1e-3,
        )

    def from_top_left_m(self, right_m: float, down_m: float, toward_m: float = 0.0) -> Triple:
        """Return a place given from the screen's top left: right, down, toward the viewer."""
        x, y, z = self.point_m(0.0, 0.0)
        return x + right_m, y - down_m, z + toward_m

    def shares_of(self, at: Triple, ray: Triple) -> tuple[float, float]:
        """Return the point where a ray meets the screen, in shares from its top left, or NaN."""
        if not ray[2] < -1e-6:
            return NAN, NAN
        reach = (-self.distance_mm * 1e-3 - at[2]) / ray[2]
        x, y = at[0] + reach * ray[0], at[1] + reach * ray[1]
        return (
            0.5 + (x * 1e3 - self.center_right_mm) / self.width_mm,
            0.5 - (y * 1e3 - self.center_up_mm) / self.height_mm,
        )
