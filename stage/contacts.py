"""Shade where people and furniture stand, which lamps' shadows are too coarse and too few for."""

import moderngl
import numpy as np

from stage import glsl_contacts
from stage.programs import compile_program
from stage.scene_buffers import Crowd


class Contacts:
    """Darkens floors below soles: sharply where one is down, softly where one is lifted.

    Without maps of shadows what lamps above would throw is darkened, too. Floors are taken to be
    level below each person, and as high as the lower of the two soles.
    """

    def __init__(self, context: moderngl.Context, *, in_light: bool, with_maps: bool) -> None:
        self._context = context
        self._defines = (
            *(("IN_LIGHT",) if in_light else ()),
            *(() if with_maps else ("NO_MAPS",)),
        )
        corners = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], np.float32)
        self._corners = context.buffer(corners.tobytes())
        self._soles: tuple[moderngl.Program, moderngl.VertexArray] | None = None

    def draw(self, crowd: Crowd) -> None:
        """Darken what the camera sent sees below everyone's soles, in one call."""
        if not crowd.cast:
            return
        if self._soles is None:
            program = compile_program(
                self._context,
                glsl_contacts.SOLE_VERTEX,
                glsl_contacts.SOLE_FRAGMENT,
                *self._defines,
            )
            content = [(self._corners, "2f4", "in_corner")]
            self._soles = program, self._context.vertex_array(program, content)
        program, array = self._soles
        program["first_texel"] = crowd.use_soles()
        context = self._context
        context.disable(moderngl.CULL_FACE)
        context.enable(moderngl.BLEND)
        # Shades overlap: each takes its share of what the others leave, and none hides another.
        context.blend_func = moderngl.DST_COLOR, moderngl.ZERO
        context.fbo.depth_mask = False
        array.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=2 * len(crowd.cast))
        context.fbo.depth_mask = True
        context.disable(moderngl.BLEND)
        context.enable(moderngl.CULL_FACE)

    def release(self) -> None:
        """Free the card's memory."""
        if self._soles is not None:
            for thing in reversed(self._soles):
                thing.release()
        self._corners.release()
