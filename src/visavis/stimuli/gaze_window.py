"""A round window that follows gaze: what it is like, and where it is in a frame."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector

GAZE_WINDOW: Final = "gaze_window"
"""The stream that says where the window was."""


@dataclass(frozen=True)
class GazeWindow:
    """A window `window_deg` wide around the place that is looked at; what is outside is covered or,
    with `is_around`, what is inside.

    Over `edge_deg`, half of it inside, the one becomes the other; 0: a sharp edge. What is covered
    is blurred by `blur_deg`; 0: nothing of it is seen but the background.
    """

    window_deg: float
    edge_deg: float = 0.0
    blur_deg: float = 0.0
    is_around: bool = False


@dataclass(frozen=True, eq=False)
class WindowPlace:
    """Where a window is: around the `direction` (3,) from `eye_m` (3,), both in world, of the
    sample of gaze at `t_sample_ns`; None and NaN while gaze is lost, when everything is covered.

    Places are as exact as they are recorded.
    """

    t_sample_ns: int | None
    eye_m: Vector
    direction: Vector

    @classmethod
    def of(cls, t_sample_ns: int, eye_m: npt.ArrayLike, direction: npt.ArrayLike) -> "WindowPlace":
        """Return the place of a sample."""
        eye, towards = (np.asarray(v, np.float32).astype(np.float64) for v in (eye_m, direction))
        return cls(t_sample_ns, eye, towards)


NO_WINDOW: Final = WindowPlace(None, np.full(3, np.nan), np.full(3, np.nan))
"""No place: gaze is lost."""


@dataclass(frozen=True, eq=False)
class Veil:
    """What covers a picture of which a window is seen: the window in its place, at the distance of
    what is shown; where nothing is blurred, `colour_srgb` covers it.
    """

    window: GazeWindow
    place: WindowPlace
    distance_m: float
    colour_srgb: tuple[int, int, int]
