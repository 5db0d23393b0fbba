"""Where one eye's picture is drawn: several samples a pixel, resolved into a plain texture."""

import moderngl
import numpy as np
import numpy.typing as npt

from stage.context import GL_FRAMEBUFFER_SRGB

GL_SRGB8_ALPHA8 = 0x8C43


class EyeTarget:
    """An RGBA8 texture of the display's codes, with `samples` per pixel while it is drawn.

    Samples lie in sRGB: whoever draws light lets the card encode it (GL_FRAMEBUFFER_SRGB), whoever
    draws codes does not. Either way a pixel is the mean of its samples' light, not of their codes.
    """

    def __init__(self, context: moderngl.Context, size_px: tuple[int, int], samples: int) -> None:
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
            self._resolved = context.framebuffer(self._mean)
            self.frame = context.framebuffer(self.texture)
        else:
            self.frame = context.framebuffer(self.texture, self._depth)

    def begin(self, background: tuple[float, float, float]) -> None:
        """Draw here from now on, over a background in sRGB (0 to 1)."""
        frame = self.frame if self._many is None else self._many
        self._context.disable_direct(GL_FRAMEBUFFER_SRGB)
        frame.use()
        frame.clear(*background, 1.0, depth=1.0)

    def finish(self) -> None:
        """Make the texture final."""
        if self._many is None:
            return
        self._context.enable_direct(GL_FRAMEBUFFER_SRGB)
        self._context.copy_framebuffer(self._resolved, self._many)
        # Headsets and windows take codes.
        self._context.disable_direct(GL_FRAMEBUFFER_SRGB)
        self._context.copy_framebuffer(self.frame, self._resolved)

    def read(self) -> npt.NDArray[np.uint8]:
        """Return the texture as (height, width, 3) bytes, top row first."""
        width, height = self.size_px
        raw = self.frame.read(components=3, alignment=1)
        return np.frombuffer(raw, np.uint8).reshape(height, width, 3)[::-1].copy()

    def release(self) -> None:
        """Free the card's memory."""
        # What is bound when it is freed would be bound again after the next thing is made.
        self._context.detect_framebuffer(0).use()
        if self._many is not None:
            self._many.release()
            self._resolved.release()
            self._colour.release()
            self._mean.release()
        self.frame.release()
        self._depth.release()
        self.texture.release()
