"""Pictures on surfaces, sent to the graphics card once."""

import moderngl
import numpy as np

from stage.programs import set_value
from stage.vertices import TextureArray

SHARPEST = 8.0


class Textures:
    """Textures by the array they come from; kept while the renderer lives."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._made: dict[int, tuple[TextureArray, moderngl.Texture]] = {}
        self._plain = context.texture((1, 1), 4, b"\xff\xff\xff\xff")

    def use(self, picture: TextureArray | None, unit: int, program: moderngl.Program) -> None:
        """Bind a picture, or none, for the coming draw call of `program`."""
        set_value(program, "textured", picture is not None)
        (self._plain if picture is None else self._of(picture)).use(unit)

    def _of(self, picture: TextureArray) -> moderngl.Texture:
        found = self._made.get(id(picture))
        if found is None:
            height, width, channels = picture.shape
            texture = self._context.texture(
                (width, height), channels, np.ascontiguousarray(picture).tobytes(), alignment=1
            )
            texture.build_mipmaps()
            texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            texture.anisotropy = SHARPEST
            found = self._made[id(picture)] = (picture, texture)
        return found[1]

    def release(self) -> None:
        """Free the card's memory."""
        for _, texture in self._made.values():
            texture.release()
        self._made.clear()
        self._plain.release()
