"""A small copy of an eye's picture for the operator, read from the card without waiting."""

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.stage.card.context import draws_on_processor
from visavis.stage.square import Square

WIDTH_PX = 256
PROCESSOR_WIDTH_PX = 128
"""Where the processor draws, which makes the copy within the frame: 0.3 ms; at 256 it takes 1.4."""
_SMALL_FRAGMENT = """
uniform sampler2D picture;
in vec2 uv;
layout(location = 0) out vec4 pixel;
void main() {
    // Four taps between texels take in sixteen of them.
    vec2 apart = vec2(dFdx(uv.x), dFdy(uv.y)) * 0.25;
    pixel = 0.25 * (
        texture(picture, uv + apart) + texture(picture, uv - apart)
        + texture(picture, uv + vec2(apart.x, -apart.y))
        + texture(picture, uv + vec2(-apart.x, apart.y))
    );
}
"""


class SmallPicture:
    """Own the small copy of textures of one size; used in the thread that draws.

    Its program is compiled on construction, not at the first use.
    """

    def __init__(self, context: moderngl.Context, large_px: tuple[int, int]) -> None:
        width, height = large_px
        small_px = PROCESSOR_WIDTH_PX if draws_on_processor(context) else WIDTH_PX
        self.size_px = (small_px, max(1, round(small_px * height / width)))
        self._context = context
        self._texture = context.texture(self.size_px, 4)
        self._frame = context.framebuffer(self._texture)
        self._pixel_buffer = context.buffer(reserve=4 * self.size_px[0] * self.size_px[1])
        self._square = Square(context)
        nothing = context.texture((1, 1), 4)
        self.ask(nothing)
        nothing.release()

    def ask(self, texture: moderngl.Texture) -> None:
        """Let the card copy a texture; the copy is there some frames later."""
        self._frame.use()
        self._frame.viewport = (0, 0, *self.size_px)
        self._context.enable_only(moderngl.NOTHING)
        texture.use(2)
        self._square.draw("small", _SMALL_FRAGMENT, (0.0, 0.0, 1.0, 1.0))
        self._frame.read_into(self._pixel_buffer, components=4)

    def take(self) -> npt.NDArray[np.uint8]:
        """Return the copied picture, (height, width, 3) in sRGB, top row first."""
        width, height = self.size_px
        raw = np.frombuffer(self._pixel_buffer.read(), np.uint8).reshape(height, width, 4)
        return raw[::-1, :, :3]

    def release(self) -> None:
        """Free the card's memory."""
        self._context.detect_framebuffer(0).use()
        for resource in (self._frame, self._texture, self._pixel_buffer):
            resource.release()
