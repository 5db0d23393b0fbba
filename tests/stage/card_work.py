"""What a graphics card is given to do, in numbers that depend on no computer's speed."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.stage.card import lit_programs
from visavis.stage.card.gl_calls import GlCalls
from visavis.stage.renderer import Quality, Renderer
from visavis.stage.shadow_maps import ShadowMaps
from visavis.stimuli.picture import Camera, Picture

COUNTING = """
int reads = 0;
float counted(sampler2DShadow map, vec3 at, float level) {
    ++reads;
    return textureLod(map, at, level);
}
vec4 counted(sampler2D map, ivec2 at, int level) {
    ++reads;
    return texelFetch(map, at, level);
}
"""
SHOWING = """
#undef main
void main() {
    shaded();
    pixel = vec4(float(reads) / 255.0, 0.0, 0.0, 1.0);
}
"""


@contextmanager
def counting_reads() -> Iterator[None]:
    """Let programs compiled until the block ends show, in red, how often each pixel read maps."""
    compile_program = lit_programs.compile_program

    def compile_counting(
        context: moderngl.Context, vertex: str, fragment: str | None, *defines: str, **others: Any
    ) -> moderngl.Program:
        last = "uniform sampler2D shadow_bounds;"
        if fragment is not None and last in fragment:
            before, after = fragment.split(last)
            for call in ("textureLod(map", "texelFetch(shadow_bounds"):
                assert call in after
                after = after.replace(call, call.replace(call.split("(")[0], "counted"))
            fragment = f"#define main shaded\n{before}{last}{COUNTING}{after}{SHOWING}"
        return compile_program(context, vertex, fragment, *defines, **others)

    with patch.object(lit_programs, "compile_program", compile_counting):
        yield


def reads_of_maps(
    picture: Picture, camera: Camera, size_px: tuple[int, int], *, map_px: int = 1024
) -> npt.NDArray[np.int64]:
    """Return how often what is seen at each pixel (height, width) reads shadow maps and what is
    known of them.
    """
    quality = Quality(samples=0, shadow_map_px=map_px)
    with counting_reads(), Renderer(quality=quality) as renderer:
        return renderer.image(picture, camera, size_px)[..., 0].astype(np.int64)


class Work:
    """What was asked of the card: `map_triangles` and `map_px` drawn into shadow maps, and `lit_px`
    whose light was computed, whether or not something nearer came later.
    """

    def __init__(self) -> None:
        self.map_triangles = self.map_px = self.lit_px = 0


@contextmanager
def counted_work(renderer: Renderer) -> Iterator[Work]:
    """Count what a renderer asks of the card until the block ends."""
    work, context = Work(), renderer.context
    draw_maps, draw, render = ShadowMaps.draw, GlCalls.draw, moderngl.VertexArray.render
    is_counted = True

    def maps_drawn(self: ShadowMaps, *arguments: Any) -> None:
        nonlocal is_counted
        query = context.query(samples=True, primitives=True)
        is_counted = False
        with query:
            draw_maps(self, *arguments)
        is_counted = True
        work.map_triangles += query.primitives
        work.map_px += query.samples

    def lit(call: Any) -> Any:
        def called(*arguments: Any, **options: Any) -> None:
            # Where no colour is written depth alone is drawn.
            if not is_counted or not any(context.fbo.color_mask):
                call(*arguments, **options)
                return
            query = context.query(samples=True)
            with query:
                call(*arguments, **options)
            work.lit_px += query.samples

        return called

    with (
        patch.object(ShadowMaps, "draw", maps_drawn),
        patch.object(GlCalls, "draw", lit(draw)),
        patch.object(moderngl.VertexArray, "render", lit(render)),
    ):
        yield work
