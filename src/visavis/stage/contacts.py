"""Contact shadows of people and furniture, for which shadow maps are too coarse and too few."""

import moderngl
import numpy as np

from visavis.stage.card.programs import UNITS, compile_program
from visavis.stage.card.shaders import contacts as glsl_contacts
from visavis.stage.geometry.contact_shapes import block_rows
from visavis.stage.scene_buffers import Crowd
from visavis.stimuli.picture import Room


class Contacts:
    """Darkens floors below soles and furniture: sharply where it stands, softly below what hangs.

    Without maps of shadows what lamps above would throw of people is darkened, too. Floors are
    taken to be level below each person, and as high as the lower of the two soles. `is_separate`
    draws soles and furniture by a call each: processors compute both sides of a shader's branch.
    """

    def __init__(
        self, context: moderngl.Context, *, in_light: bool, with_maps: bool, is_separate: bool
    ) -> None:
        self._context, self._is_separate = context, is_separate
        self._defines = (
            *(("IN_LIGHT",) if in_light else ()),
            *(() if with_maps else ("NO_MAPS",)),
        )
        corners = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], np.float32)
        self._corners = context.buffer(corners.tobytes())
        self._drawn_by: dict[tuple[str, ...], tuple[moderngl.Program, moderngl.VertexArray]] = {}
        self._room: Room | None = None
        self._blocks: moderngl.Texture | None = None

    def draw(self, crowd: Crowd, room: Room, *, with_furniture: bool = True) -> None:
        """Darken what the camera sent sees below everyone's soles and the room's furniture."""
        self._draw(2 * len(crowd.cast), self._use_blocks(room) if with_furniture else 0, crowd)

    def draw_furniture(self, room: Room) -> None:
        """Darken what the camera sent sees below the room's furniture."""
        self._draw(0, self._use_blocks(room), None)

    def _draw(self, soles: int, blocks: int, crowd: Crowd | None) -> None:
        if soles + blocks == 0:
            return
        first_texel = crowd.use_soles() if crowd is not None and soles else 0
        context = self._context
        context.disable(moderngl.CULL_FACE)
        context.enable(moderngl.BLEND)
        # Shades overlap: each takes its share of what the others leave, and none hides another.
        context.blend_func = moderngl.DST_COLOR, moderngl.ZERO
        context.fbo.depth_mask = False
        if self._is_separate:
            self._render(soles, 0, first_texel)
            self._render(0, blocks, first_texel)
        else:
            self._render(soles, blocks, first_texel)
        context.fbo.depth_mask = True
        context.disable(moderngl.BLEND)
        context.enable(moderngl.CULL_FACE)

    def _render(self, soles: int, blocks: int, first_texel: int) -> None:
        """Draw `count` soles or pieces of furniture by one call."""
        which = (*(("SOLES",) if soles else ()), *(("BLOCKS",) if blocks else ()))
        if not which:
            return
        if which not in self._drawn_by:
            program = compile_program(
                self._context, glsl_contacts.VERTEX, glsl_contacts.FRAGMENT, *self._defines, *which
            )
            content = [(self._corners, "2f4", "in_corner")]
            self._drawn_by[which] = program, self._context.vertex_array(program, content)
        program, array = self._drawn_by[which]
        program["soles"], program["first_texel"] = soles, first_texel
        array.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=soles + blocks)

    def release(self) -> None:
        """Free the card's memory."""
        for program, array in self._drawn_by.values():
            array.release()
            program.release()
        if self._blocks is not None:
            self._blocks.release()
        self._corners.release()

    def _use_blocks(self, room: Room) -> int:
        """Bind the room's furniture that blocks light, a row each; return how many."""
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
