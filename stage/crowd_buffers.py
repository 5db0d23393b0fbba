"""The cast on the graphics card: one mesh per character and level, one row of matrices each."""

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from stage.glsl_people import SKINNED_BYTES, SKINNED_LAYOUT
from stage.joint_rows import JointRows
from stage.programs import UNITS
from stage.textures import Textures
from stage.vertices import (
    PERSON_LAYOUT,
    PersonVertices,
    Run,
    TextureArray,
    person_vertices,
)
from stimuli.characters.character import Character, Maps


@dataclass(eq=False)
class _LevelOnCard:
    """One level of one character: `skinned` holds `copies` of it, `indices` the runs of each,
    `whole` copy after copy.
    """

    built: PersonVertices
    vertices: moderngl.Buffer
    deltas: moderngl.Texture
    members: moderngl.Buffer
    skinned: moderngl.Buffer | None = None
    indices: moderngl.Buffer | None = None
    whole: moderngl.Buffer | None = None
    copies: int = 0
    skinning: dict[int, moderngl.VertexArray] = field(default_factory=dict)
    arrays: dict[int, moderngl.VertexArray] = field(default_factory=dict)
    outlines: dict[int, moderngl.VertexArray] = field(default_factory=dict)
    drawn: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class _Call:
    """One draw call."""

    array: moderngl.VertexArray
    texture: TextureArray | None
    maps: Maps | None
    double_sided: bool
    count: int
    first: int


class CharacterMeshes:
    """Vertices of characters, built once per character and kept while the renderer lives."""

    def __init__(self) -> None:
        self._built: dict[tuple[int, int], tuple[Character, PersonVertices]] = {}

    def of(self, character: Character, level: int) -> PersonVertices:
        """Return a level of a character as vertices."""
        key = id(character), level
        found = self._built.get(key)
        if found is None:
            vertices = person_vertices(character, character.levels[level])
            found = self._built[key] = (character, vertices)
        return found[1]


def triangles_of(cast: tuple[Character, ...]) -> npt.NDArray[np.int64]:
    """Return how many triangles (n, levels) people have; the last level stands for missing ones."""
    counts = [[len(mesh.triangles) for mesh in person.levels] for person in cast]
    most = max(map(len, counts), default=1)
    return np.array([row + row[-1:] * (most - len(row)) for row in counts], np.int64).reshape(
        -1, most
    )


class CrowdBuffers:
    """Everyone of one cast. `pose` writes the frame's matrices, `choose` who is drawn how;
    `level_before` is what was chosen last.

    Levels finer than `finest` are sent to the card when first chosen, the others at once.
    """

    def __init__(
        self,
        context: moderngl.Context,
        cast: tuple[Character, ...],
        meshes: CharacterMeshes,
        textures: Textures,
        finest: int = 0,
    ) -> None:
        self._context = context
        self._meshes = meshes
        self._textures = textures
        self.cast = cast
        self.joints = JointRows(cast)
        self.level_count = np.array([len(c.levels) for c in cast], np.int64)
        self.triangles = triangles_of(cast)
        self.level_before = np.full(len(cast), -1, np.int64)
        n, width = self.joints.rows.shape[:2]
        self._matrices = context.texture((width, max(n, 1)), 4, dtype="f4")
        self._matrices.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._nowhere = context.simple_framebuffer((1, 1))
        self._people_of: list[npt.NDArray[np.int64]] = []
        self._levels: list[list[_LevelOnCard | None]] = []
        self._calls: dict[Hashable, list[_Call]] = {}
        of_character: dict[int, list[int]] = {}
        for i, character in enumerate(cast):
            of_character.setdefault(id(character), []).append(i)
        for members in of_character.values():
            self._people_of.append(np.array(members, np.int64))
            count = len(cast[members[0]].levels)
            first = min(finest, count - 1)
            self._levels.append(
                [
                    self._sent(members[0], k, len(members)) if k >= first else None
                    for k in range(count)
                ]
            )

    def _sent(self, person: int, k: int, capacity: int) -> _LevelOnCard:
        level = self._meshes.of(self.cast[person], k)
        context, rows = self._context, len(level.deltas)
        deltas = context.texture((8, rows), 4, level.deltas.tobytes(), dtype="f4")
        deltas.filter = (moderngl.NEAREST, moderngl.NEAREST)
        vertices = context.buffer(level.vertices.tobytes())
        members = context.buffer(reserve=4 * capacity, dynamic=True)
        return _LevelOnCard(level, vertices, deltas, members)

    def upload(self) -> None:
        """Send the matrices of this frame."""
        if self.cast:
            self._matrices.write(self.joints.rows)

    def choose(self, level: npt.NDArray[np.int64], drawn: npt.NDArray[np.bool_]) -> None:
        """Say at which level each person stands and who is drawn at all."""
        level = np.minimum(level, self.level_count - 1)
        for people, levels in zip(self._people_of, self._levels, strict=True):
            seen = people[drawn[people]]
            at = level[seen]
            for k in range(len(levels)):
                on_card = levels[k]
                members = tuple(seen[at == k].tolist())
                if on_card is None:
                    if not members:
                        continue
                    on_card = levels[k] = self._sent(int(people[0]), k, len(people))
                if members != on_card.drawn:
                    self._calls.clear()
                    on_card.drawn = members
                    if members:
                        on_card.members.write(np.array(members, np.int32))

    def skin(self, program: moderngl.Program) -> None:
        """Move everyone chosen into this frame's pose, on the card, once for all views."""
        self._nowhere.use()  # without a screen the driver wants some target even so
        self._matrices.use(UNITS["joint_rows"])
        for on_card in self._chosen():
            n = len(on_card.drawn)
            if n > on_card.copies:
                self._grow(on_card, 1 << (n - 1).bit_length())
            on_card.deltas.use(UNITS["morph_deltas"])
            count = len(on_card.built.vertices)
            self._skinning_array(program, on_card).transform(
                _made(on_card.skinned), moderngl.POINTS, vertices=count, instances=n
            )

    def draw(self, program_of: Callable[[Run], moderngl.Program], key: Hashable) -> None:
        """Draw everyone skinned; `program_of` answers the same as long as `key` is the same."""
        context, textures, unit = self._context, self._textures, UNITS["picture"]
        calls = self._calls.get(key)
        if calls is None:
            calls = self._calls[key] = self._listed(program_of)
        both: bool | None = None
        for call in calls:
            if both is not call.double_sided:
                both = call.double_sided
                (context.disable if both else context.enable)(moderngl.CULL_FACE)
            textures.use(call.texture, unit)
            textures.use_maps(call.maps)
            call.array.render(vertices=call.count, first=call.first)

    def _listed(self, program_of: Callable[[Run], moderngl.Program]) -> list[_Call]:
        """Return the draw calls, one program after the other: changing it costs most."""
        found: dict[tuple[int, bool], list[_Call]] = {}
        for on_card in self._chosen():
            n = len(on_card.drawn)
            for run in on_card.built.runs:
                program = program_of(run)
                call = _Call(
                    self._array(program, on_card),
                    run.texture,
                    run.maps,
                    run.double_sided,
                    run.count * n,
                    run.first * on_card.copies,
                )
                found.setdefault((id(program), run.double_sided), []).append(call)
        return [call for alike in found.values() for call in alike]

    def draw_outlines(self, program: moderngl.Program) -> None:
        """Draw everyone skinned into a shadow map."""
        for on_card in self._chosen():
            array = on_card.outlines.get(id(program))
            if array is None:
                array = on_card.outlines[id(program)] = self._made_array(
                    program, on_card, on_card.whole
                )
            array.render(vertices=len(on_card.built.indices) * len(on_card.drawn))

    def _chosen(self) -> Iterator[_LevelOnCard]:
        for levels in self._levels:
            for on_card in levels:
                if on_card is not None and on_card.drawn:
                    yield on_card

    def _grow(self, on_card: _LevelOnCard, copies: int) -> None:
        """Make room for so many people of this look."""
        _release_copies(on_card)
        self._calls.clear()
        count = len(on_card.built.vertices)
        step = np.arange(copies, dtype=np.int32)[:, None] * count
        indices = on_card.built.indices
        blocks = [
            (step + indices[run.first : run.first + run.count]).ravel()
            for run in on_card.built.runs
        ]
        on_card.indices = self._context.buffer(np.concatenate(blocks).astype(np.int32).tobytes())
        on_card.whole = self._context.buffer((step + indices).astype(np.int32).tobytes())
        on_card.skinned = self._context.buffer(reserve=count * copies * SKINNED_BYTES)
        on_card.copies = copies

    def _skinning_array(
        self, program: moderngl.Program, on_card: _LevelOnCard
    ) -> moderngl.VertexArray:
        array = on_card.skinning.get(id(program))
        if array is None:
            content: list[tuple[Any, ...]] = [
                (on_card.vertices, *PERSON_LAYOUT),
                (on_card.members, "1i4/i", "in_person"),
            ]
            array = on_card.skinning[id(program)] = self._context.vertex_array(
                program, content, skip_errors=True
            )
        return array

    def _array(self, program: moderngl.Program, on_card: _LevelOnCard) -> moderngl.VertexArray:
        array = on_card.arrays.get(id(program))
        if array is None:
            array = on_card.arrays[id(program)] = self._made_array(
                program, on_card, on_card.indices
            )
        return array

    def _made_array(
        self, program: moderngl.Program, on_card: _LevelOnCard, indices: moderngl.Buffer | None
    ) -> moderngl.VertexArray:
        content: list[tuple[Any, ...]] = [(on_card.skinned, *SKINNED_LAYOUT)]
        return self._context.vertex_array(
            program, content, indices, index_element_size=4, skip_errors=True
        )

    def release(self) -> None:
        """Free the card's memory."""
        self._matrices.release()
        self._nowhere.release()
        for levels in self._levels:
            for on_card in levels:
                if on_card is None:
                    continue
                _release_copies(on_card)
                for array in on_card.skinning.values():
                    array.release()
                for thing in (on_card.vertices, on_card.members, on_card.deltas):
                    thing.release()
        self._levels = []


def _release_copies(on_card: _LevelOnCard) -> None:
    for arrays in (on_card.arrays, on_card.outlines):
        for array in arrays.values():
            array.release()
        arrays.clear()
    for buffer in (on_card.skinned, on_card.indices, on_card.whole):
        if buffer is not None:
            buffer.release()
    on_card.skinned = on_card.indices = on_card.whole = None


def _made(buffer: moderngl.Buffer | None) -> moderngl.Buffer:
    assert buffer is not None  # noqa: S101 - _grow has made it
    return buffer
