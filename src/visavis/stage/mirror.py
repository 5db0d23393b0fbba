"""A window on the operator's screen that shows what the participant sees, and where they look."""

from typing import TYPE_CHECKING

import moderngl
import numpy as np

from visavis.lab.frame import EyeView
from visavis.lab.geometry import Vector, quat_conjugate, rotate
from visavis.stage.card.shaders.room import BOARD_FRAGMENT
from visavis.stage.square import Square

if TYPE_CHECKING:  # a session without a window loads no library of windows
    from visavis.stage.window import Window

_GAZE_FRAGMENT = """
in vec2 uv;
layout(location = 0) out vec4 pixel;
void main() {
    float radius = length(uv - 0.5) * 2.0, soft = fwidth(radius);
    float outer = 1.0 - smoothstep(1.0 - soft, 1.0, radius);
    float ring = outer * smoothstep(0.62 - soft, 0.62, radius);
    float edge = outer * smoothstep(0.86 - soft, 0.86, radius);
    pixel = vec4(mix(vec3(1.0, 0.75, 0.1), vec3(0.1), edge), ring);
}
"""
GAZE_RING_01 = 0.035


class Mirror:
    """Shows one eye's texture in a window, with the gaze; nothing of it reaches the headset.

    `gaze_01` is where the participant looks in the picture: right and up from its middle, −1 to
    1; None while unknown.
    """

    def __init__(self, window: "Window") -> None:
        self.window = window
        self.gaze_01: tuple[float, float] | None = None
        self._square: Square | None = None
        self._context: moderngl.Context | None = None

    def show(self, context: moderngl.Context, texture: moderngl.Texture) -> None:
        """Fill the window with the texture, whole, and draw the gaze over it."""
        if self._square is None or context is not self._context:
            self._square, self._context = Square(context), context
        screen = context.screen
        width, height = self.window.size_px
        screen.use()
        screen.viewport = (0, 0, width, height)
        screen.clear()
        context.enable_only(moderngl.NOTHING)
        aspect = texture.width / texture.height
        wide = min(1.0, aspect * height / max(width, 1))
        high = min(1.0, width / max(height, 1) / aspect)
        texture.use(2)
        self._square.draw("picture", BOARD_FRAGMENT, (0.0, 0.0, wide, high))
        if self.gaze_01 is not None:
            context.enable(moderngl.BLEND)
            context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
            x, y = self.gaze_01
            size = GAZE_RING_01
            ring = (x * wide, y * high, size * height / max(width, 1), size)
            self._square.draw("gaze", _GAZE_FRAGMENT, ring)
        self.window.present()

    def close(self) -> None:
        """Close the window."""
        self.window.close()


def gaze_in_picture(
    direction_head: Vector, tangents: tuple[float, float, float, float]
) -> tuple[float, float] | None:
    """Return the point in a picture (bounded by the tangents left, right, bottom, top) at which a
    gaze direction (3,) in the head points; None when it is behind or lost.
    """
    x, y, z = (float(v) for v in direction_head)
    if not z < -1e-6:
        return None
    left, right, bottom, top = tangents
    across, up = x / -z, y / -z
    return (
        (2 * across - left - right) / (right - left),
        (2 * up - bottom - top) / (top - bottom),
    )


def gaze_on_eye(sample: np.void, eye: EyeView) -> tuple[float, float] | None:
    """Return where a row of `GAZE` falls in the picture of an eye; None when it is lost.

    The left eye's own ray is taken where there is one, else the combined.
    """
    name = "left_direction_head" if sample["left_valid"] else "direction_head"
    if not (sample["left_valid"] or sample["valid"]):
        return None
    turn = quat_conjugate(np.asarray(eye.orientation_wxyz, np.float64))
    direction = rotate(turn, sample[name].astype(np.float64))
    bounds = (eye.tangent_left, eye.tangent_right, eye.tangent_bottom, eye.tangent_top)
    return gaze_in_picture(direction, bounds)
