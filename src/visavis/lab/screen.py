"""A flat screen in front of the participant: where it stands, and what is visible through it.

The frame is the viewing place's: its origin is the midpoint between the eyes where the lab
measured the distance (the chin rest), its axes are the screen's: x right, y up, −z into it.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.frame import EyeView
from visavis.lab.geometry import Pose, Vector, rotate, unit
from visavis.lab.luminance import LuminanceTable

IDENTITY = (1.0, 0.0, 0.0, 0.0)
MIN_EYE_DISTANCE_M = 0.1
"""An eye nearer to the screen than this is a tracking error, and nothing is drawn for it."""


@dataclass(frozen=True)
class FlatScreen:
    """A screen: its picture in metres and pixels, and where its middle stands as seen from the
    viewing place (right, up, and `distance_m` ahead); its `luminance`, where it was measured.
    """

    width_m: float
    height_m: float
    width_px: int
    height_px: int
    distance_m: float
    center_right_m: float = 0.0
    center_up_m: float = 0.0
    luminance: LuminanceTable | None = None

    def edges_m(self) -> tuple[float, float, float, float]:
        """Return left, right, bottom and top edge in the frame of the viewing place."""
        half_w, half_h = self.width_m / 2, self.height_m / 2
        x, y = self.center_right_m, self.center_up_m
        return x - half_w, x + half_w, y - half_h, y + half_h

    def view_from(self, eye_m: Vector) -> EyeView:
        """Return how an eye at a place (3,) of the frame looks through the screen: off its axis.

        The view is turned as the screen is, never towards its middle, so that the picture's plane
        is the screen's own.
        """
        x, y, z = (float(v) for v in eye_m)
        ahead = max(self.distance_m + z, MIN_EYE_DISTANCE_M)
        left, right, bottom, top = self.edges_m()
        return EyeView(
            (0.0, 0.0, 0.0),
            IDENTITY,
            (left - x) / ahead,
            (right - x) / ahead,
            (bottom - y) / ahead,
            (top - y) / ahead,
        )

    def meets_m(self, at_m: Vector, direction: Vector) -> Vector:
        """Return where lines (n, 3) meet the screen's plane (n, 3); NaN where they do not."""
        z = direction[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(z < -1e-6, (-self.distance_m - at_m[:, 2]) / z, np.nan)
            hit_m: Vector = at_m + reach[:, None] * direction
        hit_m[~((reach > 0) & np.isfinite(hit_m).all(axis=1))] = np.nan
        return hit_m

    def is_on(self, points_m: Vector) -> npt.NDArray[np.bool_]:
        """Tell which points (n, 3) of its plane lie on the screen; NaN does not."""
        left, right, bottom, top = self.edges_m()
        x, y = points_m[:, 0], points_m[:, 1]
        on: npt.NDArray[np.bool_] = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
        return on

    def pixels_of(self, points_m: Vector) -> Vector:
        """Return points (n, 3) of its plane in pixels (n, 2): right and down from the top left."""
        left, right, bottom, top = self.edges_m()
        return np.stack(
            [
                (points_m[:, 0] - left) / (right - left) * self.width_px,
                (top - points_m[:, 1]) / (top - bottom) * self.height_px,
            ],
            axis=-1,
        )

    def directions_of(self, points_px: Vector) -> Vector:
        """Return unit directions (n, 3) from the viewing place to pixels (n, 2), NaN for NaN."""
        left, right, bottom, top = self.edges_m()
        x = left + points_px[:, 0] / self.width_px * (right - left)
        y = top - points_px[:, 1] / self.height_px * (top - bottom)
        return unit(np.stack([x, y, np.full(len(x), -self.distance_m)], axis=-1))

    def seen_through(self, eye_m: Vector, at_m: Vector, direction: Vector) -> Vector:
        """Return the directions (n, 3) in which the picture's eye sees what is looked at.

        Lines (n, 3) of gaze meet the screen in a point; the scene behind that point is the one that
        was drawn there, as seen from `eye_m` (3,), the place the picture was drawn for. Unit
        vectors, NaN where a line meets no screen.
        """
        return unit(self.meets_m(at_m, direction) - eye_m)


@dataclass(frozen=True, eq=False)
class PlacedScreen:
    """A screen in the world; `place` is the viewing place, facing the screen."""

    flat: FlatScreen
    place: Pose

    def pose_at(self, right_m: float, up_m: float) -> Pose:
        """Return the pose of what lies in the screen's plane, its front towards the viewer.

        `right_m` and `up_m` lead there from the point straight ahead of the viewing place.
        """
        own = np.array([right_m, up_m, -self.flat.distance_m])
        turn = self.place.orientation_wxyz
        return Pose(self.place.position_m + rotate(turn, own), turn)
