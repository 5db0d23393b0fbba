"""The cast when the processor draws: skinned, lit and culled in compiled loops, once for all eyes.

One buffer holds everybody and a few calls draw them, nearest first, so that who stands behind is
rejected before it is shaded.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stage.card.crowd_buffers import triangles_of
from visavis.stage.card.models import CharacterMeshes
from visavis.stage.card.programs import UNITS
from visavis.stage.card.textures import Layers
from visavis.stage.card.vertices import Run
from visavis.stage.geometry.joint_rows import SOLE_TEXELS, JointRows
from visavis.stage.geometry.projection import projection, view
from visavis.stage.processor.layout import FreeRows, JoinedModels
from visavis.stage.processor.models import (
    PLAIN,
    POSED_LAYOUT,
    STILL_LAYOUT,
    STILL_VERTEX,
    Group,
    coarser,
    model,
)
from visavis.stage.processor.vertex_light import (
    CODES_OF_ROOT,
    FACTORS_OF_ROOT,
    Counts,
    Floats,
    GroupedTriangles,
    PeopleRows,
    Views,
    gather_front,
    light_drawn,
    pose,
)
from visavis.stimuli.characters.character import Character
from visavis.stimuli.picture import Camera

POSED_BYTES = 24
MAX_EYES_CULLED = 4
FAR_CELL_M = 0.04
"""Cells of the surface that become one vertex of people drawn without textures."""
SPARE_01 = 0.25
"""Share of rows kept free for people who come nearer."""


@dataclass(frozen=True, eq=False)
class PixelGrid:
    """The pixels of e pictures: `pixels_from_world` (e, 3, 4) gives pixels times depth, and depth;
    `size_px` is (e, 2). What lies between the middles of pixels is seen unless `between`.
    """

    pixels_from_world: Floats
    size_px: Floats
    between: bool

    @staticmethod
    def of(
        cameras: Sequence[Camera], sizes_px: Sequence[tuple[int, int]], *, between: bool
    ) -> "PixelGrid":
        """Return the pixels of cameras whose pictures have these sizes."""
        rows = np.zeros((len(cameras), 3, 4), np.float32)
        for row, camera, size in zip(rows, cameras, sizes_px, strict=True):
            clip = projection(camera) @ view(camera.pose)
            row[:2] = 0.5 * np.array(size)[:, None] * (clip[:2] + clip[3])
            row[2] = clip[3]
        return PixelGrid(rows, np.array(sizes_px, np.float32).reshape(-1, 2), between)


NO_GRID = PixelGrid.of((), (), between=False)


@dataclass(eq=False)
class _Room:
    """Rows for everybody's vertices and triangles, with some to spare, here and on the card."""

    free: FreeRows
    positions: Floats
    is_drawn: npt.NDArray[np.bool_]
    still: moderngl.Buffer
    moving: moderngl.Buffer
    corners: npt.NDArray[np.int32]
    farther_corners: npt.NDArray[np.int32]
    indices: moderngl.Buffer
    vertex_arrays: dict[int, moderngl.VertexArray] = field(default_factory=dict)

    def release(self) -> None:
        self.release_arrays()
        for buffer in (self.still, self.moving, self.indices):
            buffer.release()

    def release_arrays(self) -> None:
        for array in self.vertex_arrays.values():
            array.release()
        self.vertex_arrays.clear()


class ProcessorCrowd:
    """Everyone of one cast; `choose` says who is drawn how, `skin` poses and lights them.

    `layers` hold their pictures, and belong to whoever made them. Each of n people is there twice:
    i is person i seen from near, n + i from far. Whoever changes level moves to other rows; the
    others stay where they are until no rows are left.
    """

    def __init__(
        self,
        context: moderngl.Context,
        cast: tuple[Character, ...],
        meshes: CharacterMeshes,
        layers: Layers,
    ) -> None:
        self._context, self._meshes = context, meshes
        self.cast = cast
        self.joints = JointRows(cast)
        self.level_count = np.array([len(c.levels) for c in cast], np.int64)
        self.triangles = triangles_of(cast)
        self.layers = layers
        self.level_before = np.full(len(cast), -1, np.int64)
        self._soles = context.texture((SOLE_TEXELS, max(len(cast), 1)), 4, dtype="f4")
        self._soles.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._models: dict[tuple[int, int, bool], int] = {}
        self._joined_models = JoinedModels(_rank(self.layers))
        self._room: _Room | None = None
        self._grouped: GroupedTriangles | None = None
        self._levels: tuple[int, ...] = ()
        self._model_of = np.zeros(2 * len(cast), np.int64)
        self._slot_of = np.zeros(2 * len(cast), np.int64)
        self._plain_of = np.repeat([False, True], len(cast))
        self._visible_people = np.zeros(0, np.int64)
        self._count = np.zeros(0, np.int64)
        self._pixel: Floats = np.zeros((0, 0, 2), np.float32)
        self._second = ThreadPoolExecutor(1, "skin")

    def build(self, level: npt.NDArray[np.int64]) -> Iterator[None]:
        """Build people at levels of detail before they are chosen, a step each who is not there."""
        for character, k in zip(self.cast, np.minimum(level, self.level_count - 1), strict=True):
            if (id(character), int(k), True) not in self._models:
                self._model(character, int(k), far=True)  # and from near, of which that is made
                yield

    def upload(self) -> None:
        """Send where soles are; matrices stay here."""
        if self.cast:
            first = self.joints.sole_column
            soles = self.joints.rows[:, first : first + SOLE_TEXELS]
            self._soles.write(np.ascontiguousarray(soles))

    def choose(self, level: npt.NDArray[np.int64], is_drawn: npt.NDArray[np.bool_]) -> None:
        """Set each person's level of detail and who is drawn."""
        levels = tuple(np.minimum(level, self.level_count - 1).tolist())
        if levels != self._levels or self._room is None:
            self._change(levels)
        self._visible_people = np.flatnonzero(is_drawn)

    def skin(
        self,
        lamps: tuple[Floats, Floats],
        eyes_m: Vector,
        distance_m: Vector,
        textured_to_m: float,
        *,
        encode: bool,
        grid: PixelGrid | None = None,
    ) -> None:
        """Pose, sort and light everyone drawn, the nearest first; send it.

        Whoever is farther than `textured_to_m` is drawn coarser and without textures. `encode`
        gives the display's codes, otherwise linear light. What falls on no pixel of a `grid`, one
        picture an eye, is left out.
        """
        room, grouped, models = self._room, self._grouped, self._joined_models
        if room is None or grouped is None:
            return
        # Nearest people first: the depth test then rejects most of what lies behind them.
        nearest_first = self._visible_people[
            np.argsort(distance_m[self._visible_people], kind="stable")
        ]
        is_far = distance_m[nearest_first] > textured_to_m
        people = nearest_first + np.where(is_far, len(self.cast), 0)
        shapes, looks = models.shapes, models.looks
        vertices_of = models.vertices_of[self._model_of]
        own_rows = PeopleRows(self._model_of, vertices_of, self._slot_of, self._plain_of)
        # With many eyes nearly every triangle faces one, so that culling is not worth its time.
        few = len(eyes_m) <= MAX_EYES_CULLED
        eyes = np.ascontiguousarray(eyes_m if few else eyes_m[:0], np.float32)
        grid = NO_GRID if grid is None or not len(eyes) else grid
        views = Views(eyes, grid.size_px, grid.between)
        pixel = self._pixels(len(room.positions), len(grid.size_px))

        def pose_and_gather(some: Counts, corners: npt.NDArray[np.int32]) -> Counts:
            pose(
                some,
                own_rows,
                self.joints.rows,
                shapes,
                grid.pixels_from_world,
                room.positions,
                pixel,
            )
            count = np.zeros(len(models.groups), np.int64)
            gather_front(
                some,
                own_rows,
                grouped,
                room.positions,
                pixel,
                views,
                room.is_drawn,
                count,
                corners,
            )
            light_drawn(
                some,
                own_rows,
                looks,
                *lamps,
                CODES_OF_ROOT,
                FACTORS_OF_ROOT,
                encode,
                room.is_drawn,
                room.positions,
            )
            return count

        # The first half of the vertices belongs to the nearer people.
        size = np.diff(vertices_of, axis=1)[:, 0]
        half = int(np.searchsorted(np.cumsum(size[people]), size[people].sum() / 2))
        others = self._second.submit(pose_and_gather, people[half:], room.farther_corners)
        nearer = pose_and_gather(people[:half], room.corners)
        farther = others.result()
        self._count = nearer + farther
        for first, last in _stretches(self._slot_of[people], size[people]):
            room.moving.write(room.positions[first:last], offset=POSED_BYTES * first)
        starts = grouped.first[:-1].tolist()
        for first, n, more in zip(starts, nearer.tolist(), farther.tolist(), strict=True):
            if n:
                room.indices.write(room.corners[first : first + n], offset=12 * first)
            if more:
                behind = room.farther_corners[first : first + more]
                room.indices.write(behind, offset=12 * (first + n))

    def _pixels(self, rows: int, pictures: int) -> Floats:
        """Return where the pixels of so many rows are kept."""
        if self._pixel.shape != (rows, pictures, 2):
            self._pixel = np.zeros((rows, pictures, 2), np.float32)
        return self._pixel

    def draw(self, program_of: Callable[[Run], moderngl.Program]) -> None:
        """Draw everyone skinned."""
        room, grouped = self._room, self._grouped
        if room is None or grouped is None:
            return
        context = self._context
        for g, group in enumerate(self._joined_models.groups):
            if not self._count[g]:
                continue
            has_picture = group.array >= 0
            channels = self.layers.channels[group.array] if has_picture else None
            program = program_of(group.run(channels))
            if has_picture:
                self.layers.arrays[group.array].use(UNITS["picture"])
            (context.disable if group.double_sided else context.enable)(moderngl.CULL_FACE)
            self._array(program, room).render(
                vertices=3 * int(self._count[g]), first=3 * int(grouped.first[g])
            )

    def use_soles(self) -> int:
        """Bind where everyone's soles are, a row a person; return the first of their texels."""
        self._soles.use(UNITS["joint_rows"])
        return 0

    def release(self) -> None:
        """Free the card's memory."""
        self._second.shutdown()
        self._soles.release()
        if self._room is not None:
            self._room.release()
            self._room = None

    def _model(self, character: Character, level: int, *, far: bool) -> int:
        """Return the number of a character's level among the joined models."""
        key = id(character), level, far
        if key not in self._models:
            self._models[key] = self._joined_models.add(
                coarser(
                    self._joined_models.models[self._model(character, level, far=False)], FAR_CELL_M
                )
                if far
                else model(self._meshes.of(character, level), self.layers, is_finest=level == 0)
            )
        return self._models[key]

    def _change(self, levels: tuple[int, ...]) -> None:
        """Move people whose level changed to rows of the new level."""
        n, room = len(self.cast), self._room
        before = self._levels if room is not None else (None,) * n
        people = [i for i in range(n) if levels[i] != before[i]]
        entries = np.array([*people, *(n + i for i in people)], np.int64)
        numbers = [
            self._model(self.cast[i], levels[i], far=far) for far in (False, True) for i in people
        ]
        if room is not None:
            for slot, size in zip(self._slot_of[entries], self._sizes(entries), strict=True):
                room.free.give(int(slot), int(size))
        self._model_of[entries] = numbers
        self._grouped = self._group_triangles()
        self._levels = levels
        if room is None or not self._move(room, entries):
            self._lay_out_afresh()
        elif self._triangles() > len(room.corners):
            room.release_arrays()
            room.indices.release()
            room.corners, room.farther_corners, room.indices = self._room_for_triangles()

    def _sizes(self, entries: Counts) -> Counts:
        """Return how many vertices people have."""
        start, end = self._joined_models.vertices_of[self._model_of[entries]].T
        sizes: Counts = end - start
        return sizes

    def _move(self, room: _Room, entries: Counts) -> bool:
        """Find rows for some people and write what never moves; False: too few rows are free."""
        for i, size in zip(entries.tolist(), self._sizes(entries).tolist(), strict=True):
            slot = room.free.take(size)
            if slot is None:
                return False
            self._slot_of[i] = slot
            room.still.write(
                self._constant_part(i).view(np.uint8), offset=STILL_VERTEX.itemsize * slot
            )
        return True

    def _constant_part(self, i: int) -> npt.NDArray[np.void]:
        """Return what never moves of one person."""
        still: npt.NDArray[np.void] = self._joined_models.models[self._model_of[i]].still.copy()
        still["person"] = 1 + i % len(self.cast)
        return still

    def _lay_out_afresh(self) -> None:
        """Give everybody rows, one after the other, in a room with a share to spare."""
        if self._room is not None:
            self._room.release()
            self._room = None
        everyone = np.arange(2 * len(self.cast))
        sizes = self._sizes(everyone)
        total = int(sizes.sum())
        rows = int(total * (1 + SPARE_01))
        free = FreeRows(rows)
        free.take(total)
        self._slot_of = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
        still = np.zeros(rows, STILL_VERTEX)
        for i, slot, size in zip(everyone.tolist(), self._slot_of, sizes, strict=True):
            still[slot : slot + size] = self._constant_part(i)
        self._room = _Room(
            free,
            np.zeros((rows, 6), np.float32),
            np.zeros(rows, np.bool_),
            self._context.buffer(still.view(np.uint8)),
            self._context.buffer(reserve=rows * POSED_BYTES, dynamic=True),
            *self._room_for_triangles(),
        )

    def _room_for_triangles(
        self,
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], moderngl.Buffer]:
        rows = int(self._triangles() * (1 + SPARE_01))
        indices = self._context.buffer(reserve=12 * rows, dynamic=True)
        return np.zeros((rows, 3), np.int32), np.zeros((rows, 3), np.int32), indices

    def _triangles(self) -> int:
        """Return how many triangles there are at most, were none turned away."""
        return 0 if self._grouped is None else int(self._grouped.first[-1])

    def _group_triangles(self) -> GroupedTriangles:
        """Assign triangles to groups; opaque triangles of far people are drawn without textures."""
        models, n = self._joined_models, len(self.cast)
        groups, plain = models.groups, models.groups.index(PLAIN)
        own_group = np.arange(len(groups))
        opaque = [
            g.array >= 0 and self.layers.channels[g.array] == 3 and not g.double_sided
            for g in groups
        ]
        plain_group = np.where(np.array(opaque), plain, own_group)
        most = np.diff(models.stretches, axis=2)[..., 0][self._model_of[:n]].sum(axis=0)
        most[plain] += most[opaque].sum()
        return GroupedTriangles(
            triangles=models.arrays["triangles"],
            stretches=models.stretches,
            single_sided=np.array([not g.double_sided for g in groups]),
            group_of=np.concatenate([np.tile(own_group, (n, 1)), np.tile(plain_group, (n, 1))]),
            first=np.concatenate([[0], np.cumsum(most)]).astype(np.int64),
        )

    def _array(self, program: moderngl.Program, room: _Room) -> moderngl.VertexArray:
        array = room.vertex_arrays.get(id(program))
        if array is None:
            content: list[tuple[Any, ...]] = [
                (room.moving, *POSED_LAYOUT),
                (room.still, *STILL_LAYOUT),
            ]
            array = room.vertex_arrays[id(program)] = self._context.vertex_array(
                program, content, room.indices, index_element_size=4, skip_errors=True
            )
        return array


def _stretches(first: Counts, size: Counts) -> list[tuple[int, int]]:
    """Join adjacent stretches; the result is empty when nobody is drawn."""
    if not len(first):
        return []
    order = np.argsort(first)
    starts, ends = first[order], first[order] + size[order]
    fresh = np.flatnonzero(np.concatenate([[True], starts[1:] != ends[:-1]]))
    last = np.concatenate([fresh[1:], [len(starts)]]) - 1
    return list(zip(starts[fresh].tolist(), ends[last].tolist(), strict=True))


def _rank(layers: Layers) -> Callable[[Group], tuple[object, ...]]:
    """Return the order of drawing: surfaces with holes or soft edges come last."""

    def rank(group: Group) -> tuple[object, ...]:
        cut_out = group.array >= 0 and layers.channels[group.array] == 4
        return (cut_out, group.double_sided, group.array, group.eye)

    return rank
