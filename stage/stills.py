"""Single pictures with smooth edges, for sheets and figures, in seconds on any machine."""

from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt
from PIL import Image

from stage.context import draws_on_processor, offscreen_context
from stage.renderer import Quality, Renderer
from stimuli.picture import Camera, Picture

TIMES = 2
"""How much larger, in both directions, a processor draws what is then made small."""


class Stills:
    """Draw single pictures off-screen at full quality.

    A graphics card smooths edges by samples. Drivers that draw on the processor take twenty times
    as long for four samples of a crowded place as for a picture of four times the pixels, which
    looks the same when made small.
    """

    def __init__(self) -> None:
        self._context = offscreen_context()
        self._times = TIMES if draws_on_processor(self._context) else 1
        try:
            quality = Quality(samples=0) if self._times > 1 else Quality()
            self._renderer = Renderer(self._context, quality=quality)
        except BaseException:
            self._context.release()
            raise

    def image(
        self, picture: Picture, camera: Camera, size_px: tuple[int, int]
    ) -> npt.NDArray[np.uint8]:
        """Return the picture as (height, width, 3) sRGB bytes, top row first."""
        width, height = size_px
        large = self._renderer.image(picture, camera, (self._times * width, self._times * height))
        return np.asarray(Image.fromarray(large).resize(size_px, Image.Resampling.BOX))

    def close(self) -> None:
        """Give the graphics context back."""
        self._renderer.close()
        self._context.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
