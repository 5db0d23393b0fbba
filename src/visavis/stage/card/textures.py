"""Pictures on surfaces, sent to the graphics card once, as layers of a few arrays."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import moderngl
import numpy as np
from PIL import Image

from visavis.stage.card.gl_calls import GlCalls
from visavis.stage.card.programs import UNITS
from visavis.stage.card.vertices import Run, TextureArray
from visavis.stimuli.characters.character import Character

PLAIN_NORMAL: TextureArray = np.array([[[128, 128, 255]]], np.uint8)
BLACK: TextureArray = np.zeros((1, 1, 3), np.uint8)
MAX_LAYER_PX = 512
MAX_SHARED = 8
ANISOTROPY = 8.0


@dataclass(frozen=True, eq=False)
class Look:
    """Arrays whose layers lie on surfaces together; `maps` are by the names of their samplers."""

    picture: moderngl.TextureArray
    maps: tuple[tuple[str, moderngl.TextureArray], ...] = ()

    def use(self) -> None:
        """Bind them for the coming draw calls."""
        self.picture.use(UNITS["picture"])
        for name, array in self.maps:
            array.use(UNITS[name])


class Looks:
    """Pictures of runs with their maps, decoded from sRGB where they are colours. Those that come
    together and have the same shapes share arrays, so that one call draws them. Pictures of hair do
    so as well when their heights differ: lower ones stand in their layer several times.
    """

    def __init__(self, context: moderngl.Context, calls: GlCalls) -> None:
        self._context, self._calls = context, calls
        self._place: dict[tuple[int, ...], tuple[Look, int]] = {}
        self._height_01: dict[tuple[int, ...], float] = {}
        self._runs: list[Run] = []
        self._textures: list[moderngl.TextureArray] = []
        self._normal = self._array([PLAIN_NORMAL], is_colour=False)
        self._black = self._array([BLACK], is_colour=True)

    def add(self, runs: Iterable[Run]) -> None:
        """Send the pictures of runs that are not on the card yet."""
        fresh = {_pictures(r): r for r in runs if r.texture is not None}
        runs_of_shape: dict[tuple[object, ...], list[Run]] = {}
        for ids, run in fresh.items():
            if ids not in self._place:
                runs_of_shape.setdefault(_shapes(run), []).append(run)
        for together in runs_of_shape.values():
            look = self._look(together)
            highest = max(_height(run) for run in together)
            for layer, run in enumerate(together):
                self._place[_pictures(run)] = look, layer
                self._height_01[_pictures(run)] = _height(run) / highest
                self._runs.append(run)

    def of(self, run: Run) -> Look | None:
        """Return the picture of a run; None when it has none."""
        return None if run.texture is None else self._place[_pictures(run)][0]

    def layer(self, run: Run) -> int:
        """Return the layer of a run's pictures in their arrays."""
        return self._place[_pictures(run)][1]

    def height_01(self, run: Run) -> float:
        """Return the share of its layer's height that a run's picture has."""
        return self._height_01[_pictures(run)]

    def release(self) -> None:
        """Free the card's memory."""
        for array in self._textures:
            array.release()
        self._textures.clear()

    def _look(self, together: list[Run]) -> Look:
        pictures = [run.texture for run in together if run.texture is not None]
        highest = max(len(picture) for picture in pictures)
        whole = [np.tile(picture, (highest // len(picture), 1, 1)) for picture in pictures]
        picture = self._array(whole, is_colour=True)
        if together[0].maps is None:
            return Look(picture)

        def stack_maps(
            name: str, otherwise: moderngl.TextureArray | None, *, is_colour: bool
        ) -> moderngl.TextureArray | None:
            pictures = [getattr(run.maps, name) for run in together]
            if pictures[0] is None:
                return otherwise
            return self._array(pictures, is_colour=is_colour)

        maps = (
            ("normal_map", stack_maps("normal", self._normal, is_colour=False)),
            ("surface_map", stack_maps("surface", None, is_colour=False)),
            ("glow_map", stack_maps("glow_srgb", self._black, is_colour=True)),
            ("sheen_map", stack_maps("sheen_srgb", self._black, is_colour=True)),
        )
        return Look(picture, tuple((name, array) for name, array in maps if array is not None))

    def _array(self, stack: list[TextureArray], *, is_colour: bool) -> moderngl.TextureArray:
        texture = srgb_layers(self._context, self._calls, stack, is_colour=is_colour)
        self._textures.append(texture)
        return texture


def srgb_layers(
    context: moderngl.Context, calls: GlCalls, stack: list[TextureArray], *, is_colour: bool = True
) -> moderngl.TextureArray:
    """Return pictures of one shape as layers for a card; colours are decoded when read."""
    height, width, channels = stack[0].shape
    pixels, size = _join_layers(stack), (width, height, len(stack))
    if is_colour:
        array = context.texture_array(size, channels)
        calls.fill_srgb(array, pixels)
    else:
        array = context.texture_array(size, channels, pixels, alignment=1)
    array.build_mipmaps()
    array.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    array.anisotropy = ANISOTROPY
    return array


def _pictures(run: Run) -> tuple[int, ...]:
    """Return which pictures a run shows."""
    maps = run.maps
    if maps is None:
        return (id(run.texture),)
    return tuple(map(id, (run.texture, maps.normal, maps.surface, maps.glow_srgb, maps.sheen_srgb)))


def _height(run: Run) -> int:
    return 1 if run.texture is None else len(run.texture)


def _shapes(run: Run) -> tuple[object, ...]:
    """Return what runs have in common whose pictures share arrays."""
    maps = run.maps
    high = _height(run)
    if run.kind == "hair" and maps is None and run.texture is not None and not high & (high - 1):
        return ("hair", *run.texture.shape[1:])  # of heights that are powers of two
    pictures = [run.texture]
    if maps is not None:
        pictures += [maps.normal, maps.surface, maps.glow_srgb, maps.sheen_srgb]
    return (maps is None, *(None if picture is None else picture.shape for picture in pictures))


class Layers:
    """Pictures as layers of a few arrays, one per shape, so that many surfaces are drawn by one
    call; `layered` makes an array. Sides beyond `max_px` pixels are halved until they fit.
    """

    def __init__(
        self,
        pictures: Iterable[TextureArray],
        make_array: Callable[[list[TextureArray]], moderngl.TextureArray],
        max_px: int | None = None,
    ) -> None:
        self._place: dict[int, tuple[int, int]] = {}
        self._pictures: list[TextureArray] = []
        shapes: list[tuple[int, ...]] = []
        stacks: list[list[TextureArray]] = []
        for picture in pictures:
            if id(picture) in self._place:
                continue
            small = picture if max_px is None else _at_most(picture, max_px)
            if small.shape not in shapes:
                shapes.append(small.shape)
                stacks.append([])
            at = shapes.index(small.shape)
            self._place[id(picture)] = at, len(stacks[at])
            stacks[at].append(small)
            self._pictures.append(picture)
        self.arrays = [make_array(stack) for stack in stacks]
        self.channels = [shape[2] for shape in shapes]

    def place(self, picture: TextureArray) -> tuple[int, int]:
        """Return the array that holds a picture, and its layer."""
        return self._place[id(picture)]

    def release(self) -> None:
        """Free the card's memory."""
        for array in self.arrays:
            array.release()


class SharedLayers:
    """Layers by whose pictures they hold, so that the same people in other places need no others.

    A cast within a larger one that is there takes its layers; of those nobody uses the latest stay.
    """

    def __init__(self, make_array: Callable[[list[TextureArray]], moderngl.TextureArray]) -> None:
        self._make_array = make_array
        self._layers_of: dict[frozenset[int], Layers] = {}

    def of(self, cast: Iterable[Character], in_use: Iterable[Layers]) -> Layers:
        """Return the layers of a cast's pictures; `in_use` are kept whatever comes."""
        materials = [m for c in cast for m in c.materials if m.kind != "eye"]
        pictures = [m.texture_srgb for m in materials if m.texture_srgb is not None]
        key = frozenset(map(id, pictures))
        for there, layers in self._layers_of.items():
            if key <= there:
                return layers
        ids_in_use = {id(layers) for layers in in_use}
        spare = [there for there, layers in self._layers_of.items() if id(layers) not in ids_in_use]
        for there in spare[: max(0, len(self._layers_of) + 1 - MAX_SHARED)]:
            self._layers_of.pop(there).release()
        new = Layers(pictures, self._make_array, MAX_LAYER_PX)
        return self._layers_of.setdefault(key, new)

    def release(self) -> None:
        """Free the card's memory."""
        for layers in self._layers_of.values():
            layers.release()
        self._layers_of.clear()


def _at_most(picture: TextureArray, side_px: int) -> TextureArray:
    factor = 1
    while max(picture.shape[:2]) > side_px * factor:
        factor *= 2
    if factor == 1:
        return picture
    return np.asarray(Image.fromarray(picture).reduce(factor))


def code_layers(
    context: moderngl.Context, calls: GlCalls, stack: list[TextureArray]
) -> moderngl.TextureArray:
    """Return pictures of one shape as layers for a processor: codes that no tap decodes, read from
    one size.
    """
    height, width, channels = stack[0].shape
    array = context.texture_array(
        (width, height, len(stack)), channels, _join_layers(stack), alignment=1
    )
    smaller = _mipmaps(stack)
    for level, layers in enumerate(smaller, start=1):
        calls.fill_smaller(array, level, _join_layers(layers))
    if not smaller:
        array.build_mipmaps()
    array.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
    return array


def _mipmaps(stack: list[TextureArray]) -> list[list[TextureArray]]:
    """Return the pictures halved time and again until one pixel is left; none at all where a side
    is not a power of 2. Mesa compiles its own way of doing this anew in every process.
    """
    height, width, channels = stack[0].shape
    if height & height - 1 or width & width - 1:
        return []
    # Of RGBA, Pillow would weigh colours by how opaque they are.
    mode = "RGB" if channels == 3 else "CMYK"
    images = [Image.frombytes(mode, (width, height), layer.tobytes()) for layer in stack]
    out: list[list[TextureArray]] = []
    while images[0].size != (1, 1):
        wide, high = (min(side, 2) for side in images[0].size)
        images = [image.reduce((wide, high)) for image in images]
        out.append([np.asarray(image) for image in images])
    return out


def _join_layers(stack: list[TextureArray]) -> bytes:
    return b"".join(np.ascontiguousarray(layer).tobytes() for layer in stack)
