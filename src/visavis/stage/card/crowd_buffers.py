"""The cast on the graphics card: one call moves everybody, and one call per shader draws them."""

from collections.abc import Callable

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.stage.card.gl_calls import GlCalls, Stretches
from visavis.stage.card.models import DrawnAlike, Ints, ModelsOnCard
from visavis.stage.card.programs import UNITS
from visavis.stage.card.shaders.people import (
    CHUNK_VERTICES,
    CHUNKS_WIDE,
    SKINNED_BYTES,
    SKINNED_LAYOUT,
)
from visavis.stage.card.vertices import Run
from visavis.stage.geometry.joint_rows import JointRows
from visavis.stimuli.characters.character import Character

CASTING_LEVEL = 1
"""The finest level that throws shadows: texels of a map are larger than full detail is."""
SPARE_01 = 0.25
"""Share of rows kept free for people who come nearer."""


def triangles_of(cast: tuple[Character, ...]) -> npt.NDArray[np.int64]:
    """Return how many triangles (n, levels) people have; the last level stands for missing ones."""
    counts = [[len(mesh.triangles) for mesh in person.levels] for person in cast]
    most = max(map(len, counts), default=1)
    return np.array([row + row[-1:] * (most - len(row)) for row in counts], np.int64).reshape(
        -1, most
    )


Flags = npt.NDArray[np.bool_]


class CrowdBuffers:
    """Everyone of one cast. `upload` sends the frame's matrices, `choose` says who is drawn how;
    `level_before` is what was chosen last.

    `skin` writes vertices in chunks of one person each, in the order of `_chunks`; draw calls find
    them by the base that is added to a model's own indices.
    """

    def __init__(
        self,
        context: moderngl.Context,
        cast: tuple[Character, ...],
        models: ModelsOnCard,
        calls: GlCalls,
    ) -> None:
        self._context, self._models, self._calls = context, models, calls
        self.cast = cast
        self.joints = JointRows(cast)
        self.level_count = np.array([len(c.levels) for c in cast], np.int64)
        self.triangles = triangles_of(cast)
        self.level_before = np.full(len(cast), -1, np.int64)
        self._first_model = models.add(cast)
        n, width = self.joints.rows.shape[:2]
        self._matrices = context.texture((width, max(n, 1)), 4, dtype="f4")
        self._matrices.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._nowhere = context.simple_framebuffer((1, 1))
        self._last_choice = b""
        self._chunk_count = 0
        self._chunks: moderngl.Texture | None = None
        self._skin_buffer = context.buffer(reserve=SKINNED_BYTES)
        self._stretches: list[tuple[DrawnAlike, Stretches]] = []
        self._casting: Stretches | None = None
        self._solid: list[tuple[bool, Stretches]] = []
        self._skinning: tuple[moderngl.Program, moderngl.VertexArray] | None = None
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def upload(self) -> None:
        """Send the matrices of this frame."""
        if self.cast:
            self._matrices.write(self.joints.rows)

    def choose(
        self,
        level: npt.NDArray[np.int64],
        is_drawn: npt.NDArray[np.bool_],
        *,
        casts: bool = False,
    ) -> None:
        """Set each person's level of detail, who is drawn, and whether all throw shadows."""
        choice = level.tobytes() + is_drawn.tobytes() + bytes([casts])
        if choice == self._last_choice:
            return
        self._last_choice = choice
        finest, everyone = self.level_count - 1, np.arange(len(level))
        drawn_level = np.minimum(level, finest)
        casting_level = np.minimum(np.maximum(level, CASTING_LEVEL), finest)
        # Who is drawn as coarsely as they cast is moved once for both.
        is_extra = casts & ~(is_drawn & (drawn_level == casting_level))
        person = np.concatenate([everyone[is_drawn], everyone[is_extra]])
        model = self._first_model[person]
        model += np.concatenate([drawn_level[is_drawn], casting_level[is_extra]])
        is_seen = np.arange(len(person)) < is_drawn.sum()
        is_casting = casts & ~(is_seen & is_extra[person])
        order = np.argsort(model, kind="stable")
        self._lay_out(person[order], model[order], is_seen[order], is_casting[order])

    def skin(self, program: moderngl.Program) -> None:
        """Move everyone chosen into this frame's pose, on the card, once for all views."""
        models = self._models
        if not self._chunk_count or self._chunks is None:
            return
        assert models.sources is not None  # noqa: S101 - sent with the cast
        assert models.deltas is not None  # noqa: S101 - sent with the cast
        self._nowhere.use()  # without a screen the driver wants some target even so
        self._matrices.use(UNITS["joint_rows"])
        self._chunks.use(UNITS["chunks"])
        models.sources.use(UNITS["sources"])
        models.deltas.use(UNITS["morph_deltas"])
        if self._skinning is None or self._skinning[0] is not program:
            self._skinning = program, self._context.vertex_array(program, [])
        self._skinning[1].transform(
            self._skin_buffer, moderngl.POINTS, vertices=self._chunk_count * CHUNK_VERTICES
        )

    def draw(self, program_of: Callable[[Run], moderngl.Program]) -> None:
        """Draw everyone skinned."""
        context, both = self._context, None
        for batch, stretches in self._stretches:
            if both is not batch.run.double_sided:
                both = batch.run.double_sided
                (context.disable if both else context.enable)(moderngl.CULL_FACE)
            if batch.look is not None:
                batch.look.use()
            self._calls.draw(self._array(program_of(batch.run)), stretches)

    def draw_outlines(self, program: moderngl.Program) -> None:
        """Draw everyone who casts into a shadow map."""
        if self._casting is not None and len(self._casting.count):
            self._calls.draw(self._array(program), self._casting)

    def draw_depth(self, program: moderngl.Program) -> None:
        """Draw the depth of all that is solid of everyone skinned."""
        for double_sided, stretches in self._solid:
            (self._context.disable if double_sided else self._context.enable)(moderngl.CULL_FACE)
            self._calls.draw(self._array(program), stretches)

    def use_soles(self) -> int:
        """Bind where everyone's soles are, a row a person; return the first of their texels."""
        self._matrices.use(UNITS["joint_rows"])
        return self.joints.sole_column

    def release(self) -> None:
        """Free the card's memory."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        if self._skinning is not None:
            self._skinning[1].release()
            self._skinning = None
        if self._chunks is not None:
            self._chunks.release()
            self._chunks = None
        for thing in (self._matrices, self._nowhere, self._skin_buffer):
            thing.release()

    def _lay_out(self, person: Ints, model: Ints, is_seen: Flags, is_casting: Flags) -> None:
        """List the chunks to skin, and the index ranges that draw each batch and the casting."""
        table = self._models.table
        first, count = table.vertices[model].T
        chunks = -(-count // CHUNK_VERTICES)
        before = np.cumsum(chunks) - chunks
        self._chunk_count = int(chunks.sum())
        inside = CHUNK_VERTICES * (np.arange(self._chunk_count) - np.repeat(before, chunks))
        rows = np.stack(
            [
                np.repeat(first, chunks) + inside,
                np.minimum(np.repeat(count, chunks) - inside, CHUNK_VERTICES),
                np.repeat(person, chunks),
                np.repeat(table.first_delta[model], chunks),
            ],
            axis=1,
        )
        self._send_chunks(rows)
        base = CHUNK_VERTICES * before
        first_corner, corners = table.corners[model[is_casting]].T
        self._casting = Stretches.of(first_corner, corners, base[is_casting])
        model, base = model[is_seen], base[is_seen]
        first_run, runs = table.runs[model].T
        which = np.repeat(first_run - np.cumsum(runs) + runs, runs) + np.arange(runs.sum())
        batch_of_run, first_corner, corners = table.run_table[which].T
        base_of = np.repeat(base, runs)
        self._stretches = [
            (self._models.batches[k], Stretches.of(first_corner[at], corners[at], base_of[at]))
            for k in np.unique(batch_of_run).tolist()
            for at in [batch_of_run == k]
        ]
        looks = [batch.run for batch in self._models.batches]
        is_solid = np.array([run.is_solid for run in looks])[batch_of_run]
        sides = np.array([run.double_sided for run in looks])[batch_of_run]
        self._solid = [
            (both, Stretches.of(first_corner[at], corners[at], base_of[at]))
            for both in (False, True)
            for at in [is_solid & (sides == both)]
            if at.any()
        ]

    def _send_chunks(self, rows: Ints) -> None:
        n_held = 0 if self._chunks is None else self._chunks.height * CHUNKS_WIDE
        if n_held < len(rows):
            high = -(-int(len(rows) * (1 + SPARE_01)) // CHUNKS_WIDE)
            if self._chunks is not None:
                self._chunks.release()
            self._chunks = self._context.texture((CHUNKS_WIDE, high), 4, dtype="i4")
            self._chunks.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._skin_buffer.orphan(high * CHUNKS_WIDE * CHUNK_VERTICES * SKINNED_BYTES)
        if self._chunks is not None and len(rows):
            high = -(-len(rows) // CHUNKS_WIDE)
            texels = np.zeros((high * CHUNKS_WIDE, 4), np.int32)
            texels[: len(rows)] = rows
            self._chunks.write(texels, viewport=(0, 0, CHUNKS_WIDE, high))

    def _array(self, program: moderngl.Program) -> moderngl.VertexArray:
        array = self._arrays.get(id(program))
        if array is None:
            array = self._arrays[id(program)] = self._context.vertex_array(
                program,
                [(self._skin_buffer, *SKINNED_LAYOUT)],
                self._models.indices,
                index_element_size=4,
                skip_errors=True,
            )
        return array
