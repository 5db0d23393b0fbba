"""Pictures on surfaces, sent to the graphics card once."""

from collections.abc import Iterable

import moderngl
import numpy as np
from PIL import Image

from stage.programs import UNITS
from stage.vertices import TextureArray
from stimuli.characters.character import Character, Maps

PLAIN_NORMAL: TextureArray = np.array([[[128, 128, 255]]], np.uint8)
BLACK: TextureArray = np.zeros((1, 1, 3), np.uint8)
GL_SRGB8, GL_SRGB8_ALPHA8 = 0x8C41, 0x8C43
MAX_LAYER_PX = 512
MAX_SHARED = 8


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

    def use_maps(self, maps: Maps | None) -> None:
        """Bind the maps of a surface, where it has any; those it lacks change nothing."""
        if maps is None:
            return
        self._of(PLAIN_NORMAL if maps.normal is None else maps.normal, codes=False).use(
            UNITS["normal_map"]
        )
        if maps.surface is not None:
            self._of(maps.surface, codes=False).use(UNITS["surface_map"])
        self._of(BLACK if maps.glow_srgb is None else maps.glow_srgb).use(UNITS["glow_map"])
        self._of(BLACK if maps.sheen_srgb is None else maps.sheen_srgb).use(UNITS["sheen_map"])

    def _of(self, picture: TextureArray, *, codes: bool = True) -> moderngl.Texture:
        found = self._made.get(id(picture))
        if found is None:
            height, width, channels = picture.shape
            decoding = GL_SRGB8 if channels == 3 else GL_SRGB8_ALPHA8
            texture = self._context.texture(
                (width, height),
                channels,
                np.ascontiguousarray(picture).tobytes(),
                alignment=1,
                internal_format=None if self._fast or not codes else decoding,
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


class Layers:
    """Pictures in the display's codes as layers of a few arrays, one per shape, so that many
    surfaces are drawn by one call. Sides beyond 512 pixels are halved until they fit.
    """

    def __init__(self, context: moderngl.Context, pictures: Iterable[TextureArray]) -> None:
        self._place: dict[int, tuple[int, int]] = {}
        self._kept: list[TextureArray] = []
        shapes: list[tuple[int, ...]] = []
        stacks: list[list[TextureArray]] = []
        for picture in pictures:
            if id(picture) in self._place:
                continue
            small = _at_most(picture, MAX_LAYER_PX)
            if small.shape not in shapes:
                shapes.append(small.shape)
                stacks.append([])
            at = shapes.index(small.shape)
            self._place[id(picture)] = at, len(stacks[at])
            stacks[at].append(small)
            self._kept.append(picture)
        self.arrays = [_layered(context, stack) for stack in stacks]
        self.channels = [shape[2] for shape in shapes]

    def place(self, picture: TextureArray) -> tuple[int, int]:
        """Return the array a picture is in, and its layer."""
        return self._place[id(picture)]

    def release(self) -> None:
        """Free the card's memory."""
        for array in self.arrays:
            array.release()


class SharedLayers:
    """Layers by whose pictures they hold, so that the same people in other places need no others.

    A cast within a larger one that is there takes its layers; of those nobody uses the latest stay.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._made: dict[frozenset[int], Layers] = {}

    def of(self, cast: Iterable[Character], in_use: Iterable[Layers]) -> Layers:
        """Return the layers of a cast's pictures; `in_use` are kept whatever comes."""
        materials = [m for c in cast for m in c.materials if m.kind != "eye"]
        pictures = [m.texture_srgb for m in materials if m.texture_srgb is not None]
        key = frozenset(map(id, pictures))
        for there, layers in self._made.items():
            if key <= there:
                return layers
        used = {id(layers) for layers in in_use}
        spare = [there for there, layers in self._made.items() if id(layers) not in used]
        for there in spare[: max(0, len(self._made) + 1 - MAX_SHARED)]:
            self._made.pop(there).release()
        return self._made.setdefault(key, Layers(self._context, pictures))

    def release(self) -> None:
        """Free the card's memory."""
        for layers in self._made.values():
            layers.release()
        self._made.clear()


def _at_most(picture: TextureArray, side_px: int) -> TextureArray:
    factor = 1
    while max(picture.shape[:2]) > side_px * factor:
        factor *= 2
    if factor == 1:
        return picture
    return np.asarray(Image.fromarray(picture).reduce(factor))


def _layered(context: moderngl.Context, stack: list[TextureArray]) -> moderngl.TextureArray:
    height, width, channels = stack[0].shape
    pixels = b"".join(np.ascontiguousarray(layer).tobytes() for layer in stack)
    array = context.texture_array((width, height, len(stack)), channels, pixels, alignment=1)
    array.build_mipmaps()
    array.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
    return array
