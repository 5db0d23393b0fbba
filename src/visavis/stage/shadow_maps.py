"""Shadow maps: depth drawn from the lamps."""

import moderngl

from visavis.stage.card.crowd_buffers import CrowdBuffers
from visavis.stage.card.gl_calls import GlCalls
from visavis.stage.card.lamps import ShadowView
from visavis.stage.card.lit_programs import LitPrograms
from visavis.stage.card.programs import UNITS, set_bytes
from visavis.stage.card.shaders.lighting import MAX_SHADOWS
from visavis.stage.card.shadow_bounds import ShadowBounds
from visavis.stage.geometry.projection import for_gl, world_from
from visavis.stage.scene_buffers import SceneBuffers
from visavis.stimuli.picture import Picture, Room


class ShadowMaps:
    """The maps of at most two lamps; made when the first is drawn.

    What stands still throws the same shadows from frame to frame: its depth is drawn once and
    copied below people and things that move.
    """

    def __init__(self, context: moderngl.Context, size_px: int, *, area: bool) -> None:
        self._context, self._size_px = context, size_px
        self._calls, self._area = GlCalls(context), area
        self._depths: moderngl.Sampler | None = None
        self._bounds: ShadowBounds | None = None
        self._maps: list[tuple[moderngl.Texture, moderngl.Framebuffer]] = []
        self._still: list[tuple[moderngl.Texture, moderngl.Framebuffer]] = []
        self._still_of: tuple[Room, tuple[ShadowView, ...]] | None = None

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
            self._still.append(_shadow_map(ctx, self._size_px))
        ctx.disable(moderngl.CULL_FACE)
        ctx.polygon_offset = 1.5, 3.0
        # Views are the same objects while nothing about them changes.
        was = self._still_of
        is_drawn = was is not None and was[0] is picture.room and was[1] is views
        self._still_of = picture.room, views
        for shadow_view, (_, frame), (_, still) in zip(
            views, self._maps, self._still, strict=False
        ):
            matrix = for_gl(shadow_view.from_world)
            program = programs.outline("room")
            set_bytes(program, "shadow_projection", matrix)
            if not is_drawn:
                still.use()
                still.clear(depth=1.0)
                buffers.room(picture.room).draw_outlines(program)
            self._calls.copy_depth(still, frame)
            for moving_prop in picture.moving:
                if moving_prop.prop.casts_shadow:
                    thing = buffers.thing(moving_prop.prop)
                    thing.draw_outlines(program, world_from(moving_prop.pose))
            if crowd.cast:
                program = programs.outline("people")
                set_bytes(program, "shadow_projection", matrix)
                crowd.draw_outlines(program)
        ctx.polygon_offset = 0.0, 0.0
        if not self._area:
            if self._bounds is None:
                self._bounds = ShadowBounds(ctx, self._size_px)
            self._use_depths()
            self._bounds.draw(len(views))
        ctx.enable(moderngl.CULL_FACE)

    def use(self) -> None:
        """Bind the maps for the coming draw calls."""
        for k, (texture, _) in enumerate(self._maps):
            texture.use(UNITS[f"shadow_map_{k}"])
        if self._area:
            self._use_depths()
        elif self._bounds is not None:
            self._bounds.texture.use(UNITS["shadow_bounds"])

    def _use_depths(self) -> None:
        """Bind the maps once more, as depths that nothing is compared with."""
        if self._depths is None:
            nearest = (moderngl.NEAREST, moderngl.NEAREST)
            self._depths = self._context.sampler(False, False, filter=nearest)
        for k, (texture, _) in enumerate(self._maps):
            unit = UNITS[f"shadow_depth_{k}"]
            texture.use(unit)
            self._depths.use(unit)

    def release(self) -> None:
        """Free the card's memory."""
        for texture, frame in (*self._maps, *self._still):
            frame.release()
            texture.release()
        if self._depths is not None:
            self._depths.release()
            self._depths = None
        if self._bounds is not None:
            self._bounds.release()
            self._bounds = None
        self._maps.clear()
        self._still.clear()
        self._still_of = None


def _shadow_map(
    context: moderngl.Context, size_px: int
) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
    texture = context.depth_texture((size_px, size_px))
    texture.compare_func = "<="
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture, context.framebuffer(depth_attachment=texture)
