"""One display frame, as used by the code that paces, draws and records it."""

from dataclasses import dataclass, field
from typing import NamedTuple


class FrameInfo(NamedTuple):
    """One frame of the display.

    `t_ns` is session time when the frame's work begins; `predicted_display_ns` when its light
    is expected to leave the display; `dropped` counts frames the runtime skipped before it.
    """

    index: int  # type: ignore[assignment]  # of the frame, not that of a tuple
    t_ns: int
    predicted_display_ns: int
    dropped: int = 0


@dataclass(frozen=True, slots=True)
class EyeView:
    """How one eye looks through the display, left eye first where there are two.

    `offset_m` leads from the midpoint between the eyes to this eye and `orientation_wxyz` turns
    its view, both in the head frame. The tangents bound the view at distance one: left and
    bottom are negative, right and top positive. `hidden` are the corners, as tangents to the right
    and up, of triangles that the lens hides from the eye: three a triangle.
    """

    offset_m: tuple[float, float, float]
    orientation_wxyz: tuple[float, float, float, float]
    tangent_left: float
    tangent_right: float
    tangent_bottom: float
    tangent_top: float
    hidden: tuple[tuple[float, float], ...] = field(default=(), kw_only=True)
