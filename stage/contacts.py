"""Shade where people and furniture stand, which lamps' shadows are too coarse and too few for."""

import moderngl
import numpy as np

from stage import glsl_contacts
from stage.contact_shapes import block_rows
from stage.programs import UNITS, compile_program
from stage.scene_buffers import Crowd
from stimuli.picture import Room


class Contacts:
    """Darkens floors below soles and furniture: sharply where it stands, softly below what hangs.

    Without maps of shadows what lamps above would throw of people is darkened, too. Floors are
    taken to be level below each person, and as high as the lower of the two soles.
    """

    def __init__(self, context: moderngl.Context, *, in_light: bool, with_maps: bool) -> None:
        self._context = context
        self._defines = (
            *(("IN_LIGHT",) if in_light else ()),
            *(() if with_maps else ("NO_MAPS",)),
        )
        corners = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], np.float32)
        self._corners = context.buffer(corners.tobytes())
        self._drawn_by: tuple[moderngl.Program, moderngl.VertexArray] | None = None
        self._room: Room | None = None
        self._blocks: moderngl.Texture | None = None

    def draw(self, crowd: Crowd, room: Room) -> None:
        """Darken what the camera sent sees below everyone's soles and the room's furniture, in one
        call.
        """
        blocks = self._use_blocks(room)
        soles = 2 * len(crowd.cast)
        if soles + blocks == 0:
            return
        if self._drawn_by is None:
            program = compile_program(
                self._context, glsl_contacts.VERTEX, glsl_contacts.FRAGMENT, *self._defines
            )
            content = [(self._corners, "2f4", "in_corner")]
            self._drawn_by = program, self._context.vertex_array(program, content)
        program, array = self._drawn_by
        program["soles"] = soles
        if soles:
            program["first_texel"] = crowd.use_soles()
        context = self._context
        context.disable(moderngl.CULL_FACE)
        context.enable(moderngl.BLEND)
        # Shades overlap: each takes its share of what the others leave, and none hides another.
        context.blend_func = moderngl.DST_COLOR, moderngl.ZERO
        context.fbo.depth_mask = False
        array.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=soles + blocks)
        context.fbo.depth_mask = True
        context.disable(moderngl.BLEND)
        context.enable(moderngl.CULL_FACE)

    def release(self) -> None:
        """Free the card's memory."""
        if self._drawn_by is not None:
            for thing in reversed(self._drawn_by):
                thing.release()
        if self._blocks is not None:
            self._blocks.release()
        self._corners.release()

    def _use_blocks(self, room: Room) -> int:
        """Bind what of a room's furniture hides light, a row each; return how many."""
        if self._room is not room:
            if self._blocks is not None:
                self._blocks.release()
            rows, self._room, self._blocks = block_rows(room), room, None
            if len(rows):
                size = rows.shape[1], len(rows)
                self._blocks = self._context.texture(size, 4, rows.tobytes(), dtype="f4")
                self._blocks.filter = moderngl.NEAREST, moderngl.NEAREST
        if self._blocks is None:
            return 0
        self._blocks.use(UNITS["blocks"])
        return self._blocks.height
