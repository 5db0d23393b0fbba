"""Read images that a program submits to a simulated headset runtime, from the card by GL name."""

import numpy as np
import numpy.typing as npt

from visavis.devices.current_gl import GlCopies, current_context


class ImageReader:
    """Read textures of the current context, like a runtime in the same process."""

    def __init__(self) -> None:
        self._copies: dict[int, GlCopies] = {}

    @property
    def copies(self) -> GlCopies:
        """The functions of the context that is current now; DeviceError when none is."""
        context = current_context()
        if context.context not in self._copies:
            self._copies = {context.context: GlCopies()}
        return self._copies[context.context]

    def read(self, texture: int) -> npt.NDArray[np.uint8]:
        """Return a texture as (height, width, 4) bytes, top row first.

        Raises:
            DeviceError: no context is current, or it has no such texture.
        """
        return self.copies.read(texture)
