"""All models of people on the graphics card, in one set of buffers, so that one call draws many.

A model is one level of one character. Vertices lie in a texture that the skinning program reads by
itself: whoever is to be moved is then told by a short table, not by a call each.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.stage.card.shaders.people import DELTAS_WIDE, SOURCES_WIDE
from visavis.stage.card.textures import Look, Looks
from visavis.stage.card.vertices import PersonVertices, Run, person_vertices
from visavis.stimuli.characters.character import Character

SOURCE_TEXELS, DELTA_TEXELS = 5, 8
Ints = npt.NDArray[np.int64]


class CharacterMeshes:
    """Vertices of characters, built once per character and kept while the renderer lives."""

    def __init__(self) -> None:
        self._vertices_of: dict[tuple[int, int], tuple[Character, PersonVertices]] = {}

    def of(self, character: Character, level: int) -> PersonVertices:
        """Return a level of a character as vertices."""
        key = id(character), level
        entry = self._vertices_of.get(key)
        if entry is None:
            vertices = person_vertices(character, character.levels[level])
            entry = self._vertices_of[key] = (character, vertices)
        return entry[1]


@dataclass(frozen=True, eq=False)
class DrawnAlike:
    """Triangles one call can draw: `run` says how they are shaded, `look` what is on them."""

    run: Run
    look: Look | None


@dataclass(frozen=True, eq=False)
class ModelTable:
    """Where m models lie. `vertices` (m, 2), `corners` (m, 2) and `runs` (m, 2) are first and
    count of each; `run_table` (r, 3) is what is drawn alike, first corner and count of each run;
    `first_delta` (m,) is where displacements begin.
    """

    vertices: Ints
    corners: Ints
    runs: Ints
    run_table: Ints
    first_delta: Ints


class ModelsOnCard:
    """All models requested so far; `table` only grows, entries keep their place."""

    def __init__(self, context: moderngl.Context, meshes: CharacterMeshes, looks: Looks) -> None:
        self._context, self._meshes, self.looks = context, meshes, looks
        self._number: dict[int, tuple[Character, int]] = {}
        self._levels: list[PersonVertices] = []
        self._sources: list[npt.NDArray[np.uint32]] = []
        self._runs: list[tuple[int, int, int]] = []
        self._run_counts: list[int] = []
        self._batch_of_key: dict[tuple[object, ...], int] = {}
        self.batches: list[DrawnAlike] = []
        self.indices = context.buffer(reserve=4)
        self.sources: moderngl.Texture | None = None
        self.deltas: moderngl.Texture | None = None
        self.table = self._make_table()

    def add(self, cast: Iterable[Character]) -> Ints:
        """Return the number of everyone's first level (n,); further levels follow it."""
        people = tuple(cast)
        fresh = list({id(c): c for c in people if id(c) not in self._number}.values())
        fresh_levels = [[self._meshes.of(c, k) for k in range(len(c.levels))] for c in fresh]
        runs = [run for levels in fresh_levels for level in levels for run in level.runs]
        self.looks.add(runs)
        for character, levels in zip(fresh, fresh_levels, strict=True):
            self._number[id(character)] = character, len(self._levels)
            for level in levels:
                self._take(level)
        if fresh:
            self.table = self._make_table()
            self._send()
        return np.array([self._number[id(c)][1] for c in people], np.int64)

    def release(self) -> None:
        """Free the card's memory."""
        for thing in (self.indices, self.sources, self.deltas):
            if thing is not None:
                thing.release()
        self.sources = self.deltas = None

    def _take(self, level: PersonVertices) -> None:
        layer = np.zeros(len(level.vertices), np.float32)
        height_01 = np.ones(len(level.vertices), np.float32)
        is_layered = np.zeros(len(level.vertices), np.bool_)
        for run in level.runs:
            look = self.looks.of(run)
            if look is not None:
                vertices = level.indices[run.first : run.first + run.count]
                layer[vertices], is_layered[vertices] = self.looks.layer(run), True
                height_01[vertices] = self.looks.height_01(run)
            key = (run.kind, run.double_sided, id(look))
            if key not in self._batch_of_key:
                self._batch_of_key[key] = len(self.batches)
                self.batches.append(DrawnAlike(run, look))
            self._runs.append((self._batch_of_key[key], run.first, run.count))
        self._run_counts.append(len(level.runs))
        self._levels.append(level)
        self._sources.append(_source_rows(level, layer, height_01, is_layered))

    def _make_table(self) -> ModelTable:
        corners = _spans([len(level.indices) for level in self._levels])
        runs = _spans(self._run_counts)
        table = np.array(self._runs, np.int64).reshape(-1, 3)
        table[:, 1] += np.repeat(corners[:, 0], runs[:, 1])
        return ModelTable(
            _spans([len(level.vertices) for level in self._levels]),
            corners,
            runs,
            table,
            _spans([len(level.deltas) for level in self._levels])[:, 0],
        )

    def _send(self) -> None:
        context = self._context
        indices = np.concatenate([level.indices for level in self._levels]).astype(np.int32)
        self.indices.orphan(indices.nbytes)
        self.indices.write(indices)
        for texture in (self.sources, self.deltas):
            if texture is not None:
                texture.release()
        sources = _in_rows(np.concatenate(self._sources), SOURCES_WIDE * SOURCE_TEXELS)
        self.sources = _nearest(context, sources, "u4")
        deltas = np.concatenate([level.deltas.reshape(-1, 4) for level in self._levels])
        self.deltas = _nearest(context, _in_rows(deltas, DELTAS_WIDE * DELTA_TEXELS), "f4")


def _source_rows(
    level: PersonVertices,
    layer: npt.NDArray[np.float32],
    height_01: npt.NDArray[np.float32],
    is_layered: npt.NDArray[np.bool_],
) -> npt.NDArray[np.uint32]:
    """Return texels (5 v, 4) as `glsl_people.SKIN_VERTEX` reads them."""
    vertices = level.vertices
    out = np.zeros((len(vertices), SOURCE_TEXELS, 4), np.uint32)
    reals = out.view(np.float32)
    reals[:, 0, :3] = vertices["rest_m"]
    out[:, 0, 3] = vertices["morph"].astype(np.int32).view(np.uint32)
    reals[:, 1, :3] = vertices["normal"][:, :3].astype(np.float32)
    out[:, 1, 3] = np.ascontiguousarray(vertices["surface"]).view("<u4")[:, 0]
    reals[:, 2, :3] = vertices["detail"]
    reals[:, 2, 1] *= height_01
    reals[is_layered, 2, 2] = layer[is_layered]
    out[:, 2, 3] = np.ascontiguousarray(vertices["joints"]).view("<u4")[:, 0]
    reals[:, 3] = vertices["weights"].astype(np.float32)
    reals[:, 4, :3] = vertices["colour"][:, :3].astype(np.float32) / np.float32(255)
    return out.reshape(-1, 4)


def _spans(counts: list[int]) -> Ints:
    """Return first and count (m, 2) of stretches that follow one another."""
    count = np.array(counts, np.int64)
    return np.stack([np.cumsum(count) - count, count], axis=1)


def _in_rows(texels: npt.NDArray[np.generic], width: int) -> npt.NDArray[np.generic]:
    """Return texels (k, 4) in rows (h, width, 4), the rest of the last zero."""
    rows = max(-(-len(texels) // width), 1)
    out = np.zeros((rows * width, 4), texels.dtype)
    out[: len(texels)] = texels
    return out.reshape(rows, width, 4)


def _nearest(
    context: moderngl.Context, texels: npt.NDArray[np.generic], dtype: str
) -> moderngl.Texture:
    height, width, _ = texels.shape
    texture = context.texture((width, height), 4, texels.tobytes(), dtype=dtype)
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture
