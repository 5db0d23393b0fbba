"""A square in the window, filled by a fragment program."""

import moderngl
import numpy as np

from visavis.stage.card.programs import compile_program

_VERTEX = """
uniform vec4 placing;   // centre and half size in clip space
in vec2 in_corner;
out vec2 uv;
void main() {
    uv = in_corner * 0.5 + 0.5;
    gl_Position = vec4(placing.xy + in_corner * placing.zw, 0.0, 1.0);
}
"""


class Square:
    """Draws squares in one context; programs are compiled at their first use."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._programs: dict[str, tuple[moderngl.Program, moderngl.VertexArray]] = {}

    def draw(self, name: str, fragment: str, placing: tuple[float, ...]) -> None:
        """Draw the program called `name` at a place: centre and half size in clip space."""
        if name not in self._programs:
            program = compile_program(self._context, _VERTEX, fragment)
            square = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], np.float32)
            corners = self._context.buffer(square.tobytes())
            array = self._context.vertex_array(program, [(corners, "2f4", "in_corner")])
            self._programs[name] = (program, array)
        program, array = self._programs[name]
        member = program["placing"]
        if isinstance(member, moderngl.Uniform):
            member.value = placing
        array.render(moderngl.TRIANGLE_STRIP, vertices=4)
