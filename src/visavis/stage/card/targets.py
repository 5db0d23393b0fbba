"""Where one eye's picture is drawn: several samples a pixel, resolved into a plain texture."""

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.lab.frame import EyeView
from visavis.stage.card.context import GL_FRAMEBUFFER_SRGB
from visavis.stage.card.programs import compile_program, set_bytes

GL_SRGB8_ALPHA8 = 0x8C43

# At the near plane nothing drawn later can cover it.
_HIDING_VERTEX = """
in vec2 in_corner;
void main() {
    gl_Position = vec4(in_corner, -1.0, 1.0);
}
"""
_HIDING_FRAGMENT = """
uniform vec3 background;
layout(location = 0) out vec4 pixel;
void main() {
    pixel = vec4(background, 1.0);
}
"""


class EyeTarget:
    """An RGBA8 texture of the display's codes, with `samples` per pixel while it is drawn.

    Samples lie in sRGB: whoever draws light lets the card encode it (GL_FRAMEBUFFER_SRGB), whoever
    draws codes does not. Either way a pixel is the mean of its samples' light, not of their codes.

    What the lens hides of the eye's `view` keeps the background: no pixel there is computed.
    """

    def __init__(
        self,
        context: moderngl.Context,
        size_px: tuple[int, int],
        samples: int,
        view: EyeView | None = None,
    ) -> None:
        self.size_px = size_px
        self.samples = min(samples, context.max_samples)
        self.texture = context.texture(size_px, 4)
        self.texture.repeat_x = self.texture.repeat_y = False
        self._context = context
        self._depth = context.depth_renderbuffer(size_px, samples=self.samples)
        self._many: moderngl.Framebuffer | None = None
        if self.samples:
            self._colour = context.texture(
                size_px, 4, samples=self.samples, internal_format=GL_SRGB8_ALPHA8
            )
            self._mean = context.texture(size_px, 4, internal_format=GL_SRGB8_ALPHA8)
            self._many = context.framebuffer(self._colour, self._depth)
            self._mean_frame = context.framebuffer(self._mean)
            self.frame = context.framebuffer(self.texture)
        else:
            self.frame = context.framebuffer(self.texture, self._depth)
        self.drawn_into = self.frame if self._many is None else self._many
        self._codes: npt.NDArray[np.uint8] | None = None
        self._copy: tuple[moderngl.Texture, moderngl.Framebuffer] | None = None
        self._hiding: moderngl.VertexArray | None = None
        if view is not None and view.hidden:
            self._hider = compile_program(context, _HIDING_VERTEX, _HIDING_FRAGMENT)
            self._corners = context.buffer(hidden_corners(view).astype(np.float32).tobytes())
            self._hiding = context.vertex_array(self._hider, [(self._corners, "2f4", "in_corner")])

    def begin(self, background: tuple[float, float, float]) -> None:
        """Draw here from now on, over a background in sRGB (0 to 1)."""
        self._context.disable_direct(GL_FRAMEBUFFER_SRGB)
        self.drawn_into.use()
        self.drawn_into.clear(*background, 1.0, depth=1.0)
        if self._hiding is not None:
            # The winding of the triangles differs between runtimes and eyes.
            self._context.disable(moderngl.CULL_FACE)
            set_bytes(self._hider, "background", np.array(background, np.float32).tobytes())
            self._hiding.render(moderngl.TRIANGLES)
            self._context.enable(moderngl.CULL_FACE)

    def begin_over(self, other: "EyeTarget") -> None:
        """Draw here from now on, over what another of the same size and samples holds."""
        self._context.disable_direct(GL_FRAMEBUFFER_SRGB)
        self._context.copy_framebuffer(self.drawn_into, other.drawn_into)
        self.drawn_into.use()

    def finish(self) -> None:
        """Make the texture final."""
        if self._many is None:
            return
        self._context.enable_direct(GL_FRAMEBUFFER_SRGB)
        self._context.copy_framebuffer(self._mean_frame, self._many)
        # Headsets and windows take codes.
        self._context.disable_direct(GL_FRAMEBUFFER_SRGB)
        self._context.copy_framebuffer(self.frame, self._mean_frame)

    def copy(self) -> moderngl.Texture:
        """Return what is drawn here so far, in codes, with smaller copies of it; go on drawing.

        The texture is this target's own: the next call draws it again.
        """
        if self._copy is None:
            texture = self._context.texture(self.size_px, 4)
            texture.repeat_x = texture.repeat_y = False
            self._copy = texture, self._context.framebuffer(texture)
        texture, frame = self._copy
        self.finish()
        self._context.copy_framebuffer(frame, self.frame)
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.drawn_into.use()
        return texture

    def read(self) -> npt.NDArray[np.uint8]:
        """Return the texture as (height, width, 3) bytes, top row first."""
        width, height = self.size_px
        raw = self.frame.read(components=3, alignment=1)
        return np.frombuffer(raw, np.uint8).reshape(height, width, 3)[::-1].copy()

    def codes(self) -> npt.NDArray[np.uint8]:
        """Return the texture as it lies on the card, (height, width, 4) bytes, bottom row first.

        The array is this target's own: the next call writes it again.
        """
        if self._codes is None:
            width, height = self.size_px
            self._codes = np.empty((height, width, 4), np.uint8)
        self.frame.read_into(self._codes, components=4, alignment=1)
        return self._codes

    def release(self) -> None:
        """Free the card's memory."""
        # moderngl would bind a freed object again after making the next one.
        self._context.detect_framebuffer(0).use()
        if self._hiding is not None:
            for thing in (self._hiding, self._corners, self._hider):
                thing.release()
        if self._many is not None:
            self._many.release()
            self._mean_frame.release()
            self._colour.release()
            self._mean.release()
        if self._copy is not None:
            texture, frame = self._copy
            frame.release()
            texture.release()
        self.frame.release()
        self._depth.release()
        self.texture.release()


def hidden_corners(view: EyeView) -> npt.NDArray[np.float64]:
    """Return the corners (n, 2) of the triangles the lens hides, −1 to 1 across the picture."""
    low = np.array([view.tangent_left, view.tangent_bottom])
    high = np.array([view.tangent_right, view.tangent_top])
    corners: npt.NDArray[np.float64] = (2 * np.array(view.hidden) - low - high) / (high - low)
    return corners
