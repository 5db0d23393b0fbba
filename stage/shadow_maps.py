"""Shadows as maps of depth, drawn from the lamps."""

import moderngl

from stage.crowd_buffers import CrowdBuffers
from stage.glsl_lighting import MAX_SHADOWS
from stage.lamps import ShadowView
from stage.lit_programs import LitPrograms
from stage.programs import UNITS, set_bytes
from stage.projection import for_gl, world_from
from stage.scene_buffers import SceneBuffers
from stimuli.picture import Picture


class ShadowMaps:
    """The maps of at most two lamps; made when the first is drawn."""

    def __init__(self, context: moderngl.Context, size_px: int) -> None:
        self._context, self._size_px = context, size_px
        self._maps: list[tuple[moderngl.Texture, moderngl.Framebuffer]] = []

    def draw(
        self,
        picture: Picture,
        crowd: CrowdBuffers,
        views: tuple[ShadowView, ...],
        buffers: SceneBuffers,
        programs: LitPrograms,
    ) -> None:
        """Draw everything that casts a shadow, once per lamp."""
        if not views:
            return
        ctx = self._context
        while len(self._maps) < MAX_SHADOWS:
            self._maps.append(_shadow_map(ctx, self._size_px))
        ctx.disable(moderngl.CULL_FACE)
        ctx.polygon_offset = 1.5, 3.0
        for shadow_view, (_, frame) in zip(views, self._maps, strict=False):
            frame.use()
            frame.clear(depth=1.0)
            matrix = for_gl(shadow_view.from_world)
            program = programs.outline("room")
            set_bytes(program, "shadow_projection", matrix)
            buffers.room(picture.room).draw_outlines(program)
            for placed in picture.moving:
                if placed.prop.casts_shadow:
                    thing = buffers.thing(placed.prop)
                    thing.draw_outlines(program, world_from(placed.pose))
            if crowd.cast:
                program = programs.outline("people")
                set_bytes(program, "shadow_projection", matrix)
                crowd.draw_outlines(program)
        ctx.polygon_offset = 0.0, 0.0
        ctx.enable(moderngl.CULL_FACE)

    def use(self) -> None:
        """Bind the maps for the coming draw calls."""
        for k, (texture, _) in enumerate(self._maps):
            texture.use(UNITS[f"shadow_map_{k}"])

    def release(self) -> None:
        """Free the card's memory."""
        for texture, frame in self._maps:
            frame.release()
            texture.release()
        self._maps.clear()


def _shadow_map(
    context: moderngl.Context, size_px: int
) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
    texture = context.depth_texture((size_px, size_px))
    texture.compare_func = "<="
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture, context.framebuffer(depth_attachment=texture)
