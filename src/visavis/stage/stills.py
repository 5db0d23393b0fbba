"""Pictures off the screen with smooth edges, in seconds on any machine."""

import numpy as np
import numpy.typing as npt
from numba import njit

from visavis.lab.closing import Closing
from visavis.stage.processor.models import LINEAR_OF_CODE
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.picture import Camera, Picture

TIMES = 2
"""Factor, in both directions, by which a picture is drawn larger before it is made small."""
STILL = Quality(samples=0, shrink_factor=TIMES)
"""How a single picture is drawn, at full quality, alike by every driver: so that cloth finer than
pixels fades by a rule of ours. Drivers that draw on the processor take twenty times as long for
four samples of a crowded place as for four times the pixels, which look the same made small.
"""

_STEPS = 1 << 14
_LIGHT_OF_CODE = np.round(LINEAR_OF_CODE * (_STEPS - 1)).astype(np.uint32)
_CODE_OF_LIGHT = np.round(
    np.interp(np.arange(_STEPS) / (_STEPS - 1), LINEAR_OF_CODE, np.arange(256))
).astype(np.uint8)


def shrink(large: npt.NDArray[np.uint8], size_px: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """Return a picture (height, width, 3 or 4) in a size whose width and height divide its own, as
    (height, width, 3): each pixel is the mean of the light of those it stands for.
    """
    small = np.empty((size_px[1], size_px[0], 3), np.uint8)
    _shrink_into(np.ascontiguousarray(large), _LIGHT_OF_CODE, _CODE_OF_LIGHT, small)
    return small


@njit(cache=True)
def _shrink_into(
    large: npt.NDArray[np.uint8],
    light_of_code: npt.NDArray[np.uint32],
    code_of_light: npt.NDArray[np.uint8],
    small: npt.NDArray[np.uint8],
) -> None:
    height, width, colours = small.shape
    down, across = large.shape[0] // height, large.shape[1] // width
    count = down * across
    if down == across == 2:  # as films are drawn: without loops and division it takes a quarter
        for y in range(height):
            above, below = large[2 * y], large[2 * y + 1]
            for x in range(width):
                for c in range(colours):
                    left = light_of_code[above[2 * x, c]] + light_of_code[below[2 * x, c]]
                    right = light_of_code[above[2 * x + 1, c]] + light_of_code[below[2 * x + 1, c]]
                    small[y, x, c] = code_of_light[(left + right) >> 2]
        return
    for y in range(height):
        for x in range(width):
            for c in range(colours):
                total = np.int64(0)
                for i in range(down):
                    for j in range(across):
                        total += np.int64(light_of_code[large[y * down + i, x * across + j, c]])
                small[y, x, c] = code_of_light[total // count]


class Stills(Closing):
    """Draw pictures off-screen, by default at full quality.

    Where the quality says that pictures are made small, they are drawn so much larger.
    """

    def __init__(self, quality: Quality | None = None) -> None:
        self.renderer = Renderer(quality=STILL if quality is None else quality)

    def image(
        self, picture: Picture, camera: Camera, size_px: tuple[int, int]
    ) -> npt.NDArray[np.uint8]:
        """Return the picture as (height, width, 3) sRGB bytes, top row first."""
        (width, height), times = size_px, self.renderer.quality.shrink_factor
        if times == 1:
            return self.renderer.image(picture, camera, size_px)
        # What the card has is turned over once it is small, and copied nowhere before.
        codes = self.renderer.codes(picture, camera, (times * width, times * height))
        return shrink(codes, size_px)[::-1].copy()

    def close(self) -> None:
        """Release the graphics context."""
        self.renderer.close()
