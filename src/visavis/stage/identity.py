"""Which person and body part every pixel shows, how bright and how far: many views at once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.lab.closing import Closing
from visavis.stage.errors import StageError
from visavis.stage.levels import DetailRule
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.characters.character import Character
from visavis.stimuli.picture import Camera, Picture

NOBODY = 0
FAITHFUL = Quality(samples=0, shadows="none", detail=DetailRule(faces_px=(), budget_triangles=None))
"""The copies for measuring, 6 thousand triangles a person, no shadow maps: measures parts to within
a few per cent."""
MAX_ATLAS_PX = 8192


@dataclass(frozen=True, eq=False)
class IdentityImages:
    """m views of h rows (top first) and w columns.

    `person` (m, h, w) uint16 is 1 + the index in the cast, 0 where nobody is seen (whatever hides
    people is nobody); `part` (m, h, w) uint16 indexes `body_parts.PARTS`; `luminance_01`
    (m, h, w) float32 is the displayed luminance, 1 the display's white; `distance_m` (m, h, w)
    float32 from the eye to the surface along the pixel's ray, NaN where there is none.
    """

    person: npt.NDArray[np.uint16]
    part: npt.NDArray[np.uint16]
    luminance_01: npt.NDArray[np.float32]
    distance_m: npt.NDArray[np.float32]


class IdentityBuffer(Closing):
    """Draw identity images; without a renderer it opens its own off-screen context."""

    def __init__(self, renderer: Renderer | None = None, *, quality: Quality = FAITHFUL) -> None:
        self._owns = renderer is None
        self._renderer = Renderer(quality=quality) if renderer is None else renderer
        self._frame: moderngl.Framebuffer | None = None
        self._parts: list[moderngl.Texture | moderngl.Renderbuffer] = []
        self._size = (0, 0)

    def views(
        self,
        picture: Picture,
        cameras: Sequence[Camera],
        size_px: tuple[int, int],
        *,
        level: int = 0,
    ) -> IdentityImages:
        """Return what each camera sees, (width, height) pixels each, in one read-back.

        Everybody is drawn as the copy for measuring number `level`, 0 the finest.

        Raises:
            StageError: so many views of this size do not fit one atlas.
        """
        width, height = size_px
        m = len(cameras)
        if m == 0:
            empty = np.zeros((0, height, width))
            whole = empty.astype(np.uint16)
            real = empty.astype(np.float32)
            return IdentityImages(whole, whole, real, real)
        columns = min(m, max(1, int(np.ceil(np.sqrt(m * height / width)))))
        rows = -(-m // columns)
        self._fit(columns * width, rows * height)
        frame, renderer = self._frame, self._renderer
        assert frame is not None  # noqa: S101 - made by _fit
        context = renderer.context
        context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        picture = replace(picture, cast=_measuring_cast(picture.cast))
        crowd = renderer.crowd_of(picture)
        levels = np.full(len(picture.cast), level, np.int64)
        choice = renderer.pose(picture, crowd, cameras, levels)
        renderer.light(picture, crowd, choice, cameras, None)
        frame.use()
        frame.viewport = (0, 0, *self._size)
        frame.clear(depth=1.0)
        for i, camera in enumerate(cameras):
            frame.viewport = (i % columns * width, i // columns * height, width, height)
            renderer.look_from(camera, max(picture.brightness_01, 0.0), 0.5)
            renderer.paint(picture, crowd, identity=True)
        return self._read(m, columns, rows, width, height)

    def close(self) -> None:
        """Free the atlas, and the renderer if it is our own."""
        self._release()
        if self._owns:
            self._renderer.close()

    def _fit(self, width: int, height: int) -> None:
        if max(width, height) > MAX_ATLAS_PX:
            raise StageError(
                f"an atlas of {width} by {height} pixels is larger than {MAX_ATLAS_PX}",
                remedy="ask for fewer views at a time, or smaller ones",
            )
        if self._size == (width, height):
            return
        self._release()
        context = self._renderer.context
        tags = context.texture((width, height), 2, dtype="u2")
        tags.filter = (moderngl.NEAREST, moderngl.NEAREST)
        distances = context.texture((width, height), 2, dtype="f4")
        distances.filter = (moderngl.NEAREST, moderngl.NEAREST)
        depth = context.depth_renderbuffer((width, height))
        self._parts = [tags, distances, depth]
        self._frame = context.framebuffer([tags, distances], depth)
        self._size = (width, height)

    def _read(self, m: int, columns: int, rows: int, width: int, height: int) -> IdentityImages:
        frame = self._frame
        assert frame is not None  # noqa: S101 - made by _fit
        size = (0, 0, *self._size)
        raw = frame.read(size, components=2, attachment=0, alignment=1, dtype="u2")
        tags = np.frombuffer(raw, np.uint16).reshape(rows, height, columns, width, 2)
        raw = frame.read(size, components=2, attachment=1, alignment=1, dtype="f4")
        pixels = np.frombuffer(raw, np.float32).reshape(rows, height, columns, width, 2)
        order, tiles = (0, 2, 1, 3, 4), (rows * columns, height, width, 2)
        tags = tags[:, ::-1].transpose(order).reshape(tiles)[:m]
        pixels = pixels[:, ::-1].transpose(order).reshape(tiles)[:m]
        distance_m = pixels[..., 1].copy()
        distance_m[distance_m == 0.0] = np.nan
        return IdentityImages(
            tags[..., 0].copy(), tags[..., 1].copy(), pixels[..., 0].copy(), distance_m
        )

    def _release(self) -> None:
        if self._frame is not None:
            self._frame.release()
            self._frame = None
        for part in self._parts:
            part.release()
        self._parts = []
        self._size = (0, 0)


@lru_cache(maxsize=64)
def _measuring_cast(cast: tuple[Character, ...]) -> tuple[Character, ...]:
    """Return the copies of people for measuring, the same objects for the same cast."""
    return tuple(_measuring(person) for person in cast)


@cache
def _measuring(person: Character) -> Character:
    return replace(person, levels=person.measuring)
