"""Pictures on surfaces, sent to the graphics card once."""

import moderngl
import numpy as np

from stage.vertices import TextureArray

GL_SRGB8, GL_SRGB8_ALPHA8 = 0x8C41, 0x8C43


class Textures:
    """Textures by the array they come from; kept while the renderer lives.

    Fast ones hold the display's codes, so that no tap is decoded, and are read from one size.
    """

    def __init__(self, context: moderngl.Context, *, fast: bool) -> None:
        self._context = context
        self._fast = fast
        self._made: dict[int, tuple[TextureArray, moderngl.Texture]] = {}

    def use(self, picture: TextureArray | None, unit: int) -> None:
        """Bind a picture, if there is one, for the coming draw call."""
        if picture is not None:
            self._of(picture).use(unit)

    def _of(self, picture: TextureArray) -> moderngl.Texture:
        found = self._made.get(id(picture))
        if found is None:
            height, width, channels = picture.shape
            decoding = GL_SRGB8 if channels == 3 else GL_SRGB8_ALPHA8
            texture = self._context.texture(
                (width, height),
                channels,
                np.ascontiguousarray(picture).tobytes(),
                alignment=1,
                internal_format=None if self._fast else decoding,
            )
            texture.build_mipmaps()
            smaller = (
                moderngl.LINEAR_MIPMAP_NEAREST if self._fast else moderngl.LINEAR_MIPMAP_LINEAR
            )
            texture.filter = (smaller, moderngl.LINEAR)
            texture.anisotropy = 1.0 if self._fast else 8.0
            found = self._made[id(picture)] = (picture, texture)
        return found[1]

    def release(self) -> None:
        """Free the card's memory."""
        for _, texture in self._made.values():
            texture.release()
        self._made.clear()
