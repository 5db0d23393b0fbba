"""The cast where a processor draws: skinned, lit and culled in compiled loops, once for all eyes.

One buffer holds everybody and a few calls draw them, nearest first, so that who stands behind is
rejected before it is shaded.
"""

from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from lab.geometry import Vector
from stage.crowd_buffers import CharacterMeshes
from stage.joint_rows import JointRows
from stage.processor_models import (
    PLAIN,
    POSED_LAYOUT,
    STILL_LAYOUT,
    Group,
    Model,
    coarser,
    model,
)
from stage.programs import UNITS
from stage.textures import Layers
from stage.vertex_light import (
    CODES_OF_ROOT,
    FACTORS_OF_ROOT,
    Floats,
    gather_front,
    pose_and_light,
)
from stage.vertices import Run
from stimuli.characters.character import Character

Counts = npt.NDArray[np.int64]
MODEL_ARRAYS = ("rest", "normal", "column", "weight", "morph", "deltas", "albedo",
                "plain_albedo", "wrap", "kind", "textured")  # fmt: skip
POSED_BYTES = 24
MOST_EYES_CULLED = 4
FAR_CELL_M = 0.04
"""Cells of the surface that become one vertex of people drawn without textures."""


@dataclass(frozen=True, eq=False)
class _LaidOut:
    """Everybody at one choice of levels: the models' arrays joined, and who uses which part.

    Each of n people is there twice: i is person i seen from near, n + i from far.
    """

    arrays: dict[str, npt.NDArray[Any]]
    triangles: npt.NDArray[np.int32]
    groups: tuple[Group, ...]
    stretches: Counts
    model_of: Counts
    vertices_of: Counts
    slot_of: Counts
    plain_of: npt.NDArray[np.bool_]
    group_of: Counts
    single_sided: npt.NDArray[np.bool_]
    first: Counts
    posed: Floats
    corners: npt.NDArray[np.int32]
    still: moderngl.Buffer
    moving: moderngl.Buffer
    indices: moderngl.Buffer
    vertex_arrays: dict[int, moderngl.VertexArray]

    def release(self) -> None:
        for array in self.vertex_arrays.values():
            array.release()
        for buffer in (self.still, self.moving, self.indices):
            buffer.release()


class ProcessorCrowd:
    """Everyone of one cast; `choose` says who is drawn how, `skin` poses and lights them."""

    def __init__(
        self, context: moderngl.Context, cast: tuple[Character, ...], meshes: CharacterMeshes
    ) -> None:
        self._context, self._meshes = context, meshes
        self.cast = cast
        self.joints = JointRows(cast)
        self.level_count = np.array([len(c.levels) for c in cast], np.int64)
        pictures = (m.texture_srgb for c in cast for m in c.materials if m.kind != "eye")
        self._layers = Layers(context, (p for p in pictures if p is not None))
        self.level_before = np.full(len(cast), -1, np.int64)
        self._models: dict[tuple[int, int, bool], Model] = {}
        self._laid_out: _LaidOut | None = None
        self._levels: tuple[int, ...] = ()
        self._drawn = np.zeros(0, np.int64)
        self._count = np.zeros(0, np.int64)
        self._second = ThreadPoolExecutor(1, "skin")

    def upload(self) -> None:
        """Matrices stay here."""

    def choose(self, level: npt.NDArray[np.int64], drawn: npt.NDArray[np.bool_]) -> None:
        """Say at which level each person stands and who is drawn at all."""
        levels = tuple(np.minimum(level, self.level_count - 1).tolist())
        if levels != self._levels or self._laid_out is None:
            if self._laid_out is not None:
                self._laid_out.release()
            self._laid_out = self._lay_out(levels)
            self._levels = levels
        self._drawn = np.flatnonzero(drawn)

    def skin(
        self,
        lamps: tuple[Floats, Floats],
        eyes_m: Vector,
        distance_m: Vector,
        textured_to_m: float,
        *,
        encode: bool,
    ) -> None:
        """Pose, light and sort everyone drawn, the nearest first; send it.

        Whoever is farther than `textured_to_m` is drawn coarser and without textures. `encode`
        gives the display's codes, otherwise linear light.
        """
        at = self._laid_out
        if at is None:
            return
        nearest_first = self._drawn[np.argsort(distance_m[self._drawn], kind="stable")]
        is_far = distance_m[nearest_first] > textured_to_m
        people = nearest_first + np.where(is_far, len(self.cast), 0)
        a = at.arrays

        def pose(some: Counts) -> None:
            pose_and_light(
                some, at.vertices_of, at.slot_of, at.plain_of, self.joints.rows,
                a["rest"], a["normal"], a["column"], a["weight"], a["morph"], a["deltas"],
                a["albedo"], a["plain_albedo"], a["wrap"], a["kind"], a["textured"],
                *lamps, CODES_OF_ROOT, FACTORS_OF_ROOT, encode, at.posed,
            )  # fmt: skip

        other_half = self._second.submit(pose, people[1::2])
        pose(people[::2])
        other_half.result()
        eyes = eyes_m if len(eyes_m) <= MOST_EYES_CULLED else eyes_m[:0]
        self._count = np.zeros(len(at.groups), np.int64)
        gather_front(
            people, at.model_of, at.slot_of, at.plain_of, at.group_of, at.stretches, at.triangles,
            at.single_sided, at.posed, np.ascontiguousarray(eyes, np.float32), at.first,
            self._count, at.corners,
        )  # fmt: skip
        size = np.diff(at.vertices_of, axis=1)[:, 0]
        for first, last in _stretches(at.slot_of[people], size[people]):
            at.moving.write(at.posed[first:last], offset=POSED_BYTES * first)
        for first, count in zip(at.first.tolist(), self._count.tolist(), strict=True):
            if count:
                at.indices.write(at.corners[first : first + count], offset=12 * first)

    def draw(self, program_of: Callable[[Run], moderngl.Program], key: Hashable) -> None:
        """Draw everyone skinned."""
        at = self._laid_out
        if at is None:
            return
        context = self._context
        for g, group in enumerate(at.groups):
            if not self._count[g]:
                continue
            textured = group.array >= 0
            channels = self._layers.channels[group.array] if textured else None
            program = program_of(group.run(channels))
            if textured:
                self._layers.arrays[group.array].use(UNITS["picture"])
            (context.disable if group.double_sided else context.enable)(moderngl.CULL_FACE)
            self._array(program, at).render(
                vertices=3 * int(self._count[g]), first=3 * int(at.first[g])
            )

    def release(self) -> None:
        """Free the card's memory."""
        self._second.shutdown()
        if self._laid_out is not None:
            self._laid_out.release()
            self._laid_out = None
        self._layers.release()

    def _model(self, character: Character, level: int, *, far: bool) -> Model:
        key = id(character), level, far
        if key not in self._models:
            self._models[key] = (
                coarser(self._model(character, level, far=False), FAR_CELL_M)
                if far
                else model(self._meshes.of(character, level), self._layers)
            )
        return self._models[key]

    def _lay_out(self, levels: tuple[int, ...]) -> _LaidOut:
        everyone = [
            self._model(c, level, far=far)
            for far in (False, True)
            for c, level in zip(self.cast, levels, strict=True)
        ]
        models = list({id(m): m for m in everyone}.values())
        number = {id(m): k for k, m in enumerate(models)}
        model_of = np.array([number[id(m)] for m in everyone], np.int64)
        sizes = np.array([len(m.rest) for m in models], np.int64)
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        slots = np.concatenate([[0], np.cumsum(sizes[model_of])]).astype(np.int64)
        arrays = {name: np.concatenate([getattr(m, name) for m in models]) for name in MODEL_ARRAYS}
        _shift_morphs(arrays, models)
        groups = tuple(
            sorted({PLAIN, *(g for m in models for g in m.triangles)}, key=_rank(self._layers))
        )
        stretches = np.zeros((len(models), len(groups), 2), np.int64)
        parts, total = [np.zeros((0, 3), np.int32)], 0
        for k, m in enumerate(models):
            for g, group in enumerate(groups):
                own = m.triangles.get(group)
                if own is not None:
                    stretches[k, g] = total, total + len(own)
                    parts.append(own)
                    total += len(own)
        n, plain = len(self.cast), groups.index(PLAIN)
        own_group = np.arange(len(groups))
        opaque = [
            g.array >= 0 and self._layers.channels[g.array] == 3 and not g.double_sided
            for g in groups
        ]
        plain_group = np.where(np.array(opaque), plain, own_group)
        most = np.diff(stretches, axis=2)[..., 0][model_of[:n]].sum(axis=0)
        most[plain] += most[opaque].sum()
        first = np.concatenate([[0], np.cumsum(most)]).astype(np.int64)
        still = np.concatenate([models[k].still for k in model_of])
        still["person"] = np.repeat(np.tile(np.arange(1, n + 1), 2), sizes[model_of])
        context = self._context
        return _LaidOut(
            arrays, np.concatenate(parts), groups, stretches, model_of,
            np.stack([starts[model_of], starts[model_of + 1]], axis=1), slots[:-1],
            np.repeat([False, True], n),
            np.concatenate([np.tile(own_group, (n, 1)), np.tile(plain_group, (n, 1))]),
            np.array([not g.double_sided for g in groups]), first[:-1],
            np.zeros((slots[-1], 6), np.float32), np.zeros((first[-1], 3), np.int32),
            context.buffer(still.tobytes()),
            context.buffer(reserve=int(slots[-1]) * POSED_BYTES, dynamic=True),
            context.buffer(reserve=int(first[-1]) * 12, dynamic=True), {},
        )  # fmt: skip

    def _array(self, program: moderngl.Program, at: _LaidOut) -> moderngl.VertexArray:
        array = at.vertex_arrays.get(id(program))
        if array is None:
            content: list[tuple[Any, ...]] = [(at.moving, *POSED_LAYOUT), (at.still, *STILL_LAYOUT)]
            array = at.vertex_arrays[id(program)] = self._context.vertex_array(
                program, content, at.indices, index_element_size=4, skip_errors=True
            )
        return array


def _stretches(first: Counts, size: Counts) -> list[tuple[int, int]]:
    """Join stretches that lie next to each other; of nobody there are none."""
    if not len(first):
        return []
    order = np.argsort(first)
    starts, ends = first[order], first[order] + size[order]
    fresh = np.flatnonzero(np.concatenate([[True], starts[1:] != ends[:-1]]))
    last = np.concatenate([fresh[1:], [len(starts)]]) - 1
    return list(zip(starts[fresh].tolist(), ends[last].tolist(), strict=True))


def _shift_morphs(arrays: dict[str, npt.NDArray[Any]], models: list[Model]) -> None:
    """Let vertices count their displacements in the joined array."""
    shift = np.cumsum([0, *(len(m.deltas) for m in models)])[:-1]
    shifts = np.repeat(shift, [len(m.rest) for m in models])
    arrays["morph"] = np.where(arrays["morph"] >= 0, arrays["morph"] + shifts, -1).astype(np.int32)


def _rank(layers: Layers) -> Callable[[Group], tuple[object, ...]]:
    """Return the order of drawing: what has holes or a soft edge comes last."""

    def rank(group: Group) -> tuple[object, ...]:
        cut_out = group.array >= 0 and layers.channels[group.array] == 4
        return (cut_out, group.double_sided, group.array, group.eye)

    return rank
