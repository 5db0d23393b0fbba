"""Where one eye's picture is drawn: several samples a pixel, resolved into a plain texture."""

import moderngl
import numpy as np
import numpy.typing as npt


class EyeTarget:
    """An RGBA8 texture in sRGB, with `samples` per pixel while it is drawn."""

    def __init__(self, context: moderngl.Context, size_px: tuple[int, int], samples: int) -> None:
        self.size_px = size_px
        self.samples = min(samples, context.max_samples)
        self.texture = context.texture(size_px, 4)
        self.texture.repeat_x = self.texture.repeat_y = False
        self._context = context
        self._depth = context.depth_renderbuffer(size_px, samples=self.samples)
        self._many: moderngl.Framebuffer | None = None
        if self.samples:
            self._colour = context.renderbuffer(size_px, 4, samples=self.samples)
            self._many = context.framebuffer(self._colour, self._depth)
            self.frame = context.framebuffer(self.texture)
        else:
            self.frame = context.framebuffer(self.texture, self._depth)
        self.drawn_into = self.frame if self._many is None else self._many

    def begin(self, background: tuple[float, float, float]) -> None:
        """Draw here from now on, over a background in sRGB (0 to 1)."""
        self.drawn_into.use()
        self.drawn_into.clear(*background, 1.0, depth=1.0)

    def begin_over(self, other: "EyeTarget") -> None:
        """Draw here from now on, over what another of the same size and samples holds."""
        self._context.copy_framebuffer(self.drawn_into, other.drawn_into)
        self.drawn_into.use()

    def finish(self) -> None:
        """Make the texture final."""
        if self._many is not None:
            self._context.copy_framebuffer(self.frame, self._many)

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
            self._colour.release()
        self.frame.release()
        self._depth.release()
        self.texture.release()
