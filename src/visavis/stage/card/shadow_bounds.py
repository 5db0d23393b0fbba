"""Between which depths lies what a place of a shadow map is compared with: where the answer is the
same for all of them, one read of these says it.
"""

import moderngl

from visavis.stage.card.programs import UNITS, compile_program
from visavis.stage.card.shaders import lighting as glsl_lighting


class ShadowBounds:
    """The nearest and the farthest depth about every square of both maps, drawn anew each frame."""

    def __init__(self, context: moderngl.Context, map_px: int) -> None:
        side = -(-map_px // glsl_lighting.SHADOW_SQUARE)
        self._programs = [
            compile_program(context, glsl_lighting.WHOLE_VERTEX, fragment)
            for fragment in (glsl_lighting.BOUNDS_FOUND, glsl_lighting.BOUNDS_SPREAD)
        ]
        self._arrays = [context.vertex_array(program, []) for program in self._programs]
        self._textures = [context.texture((side, side), 4, dtype="f4") for _ in self._programs]
        self._frames = [context.framebuffer(texture) for texture in self._textures]
        for texture in self._textures:
            texture.filter = moderngl.NEAREST, moderngl.NEAREST

    @property
    def texture(self) -> moderngl.Texture:
        """The bounds (rows, columns, 4): nearest and farthest of the first map, of the second."""
        return self._textures[1]

    def draw(self, maps: int) -> None:
        """Find the bounds of so many maps, whose depths are bound."""
        self._programs[0]["maps"] = maps
        for array, frame in zip(self._arrays, self._frames, strict=True):
            frame.use()
            array.render(moderngl.TRIANGLES, vertices=3)
            self._textures[0].use(UNITS["shadow_bounds"])

    def release(self) -> None:
        """Free the card's memory."""
        for array, program in zip(self._arrays, self._programs, strict=True):
            array.release()
            program.release()
        for frame, texture in zip(self._frames, self._textures, strict=True):
            frame.release()
            texture.release()
