"""Copies of pictures, halved time and again, from which a processor reads what is far away."""

from collections.abc import Iterator

import moderngl
import numpy as np
import numpy.typing as npt
import pytest

from visavis.stage.card.context import offscreen_context, release_offscreen
from visavis.stage.card.gl_calls import GlCalls
from visavis.stage.card.programs import UNITS, compile_program
from visavis.stage.card.textures import code_layers
from visavis.stage.errors import StageError

VERTEX = """
in vec2 in_corner;
void main() { gl_Position = vec4(in_corner, 0.0, 1.0); }
"""
FRAGMENT = """
uniform sampler2DArray picture;
uniform int level, layer;
layout(location = 0) out vec4 pixel;
void main() { pixel = texelFetch(picture, ivec3(gl_FragCoord.xy, layer), level); }
"""
EVERYWHERE = np.array([[-1, -1], [3, -1], [-1, 3]], np.float32)


@pytest.fixture(scope="module")
def context() -> Iterator[moderngl.Context]:
    try:
        made = offscreen_context()
    except StageError as problem:
        pytest.skip(str(problem))
    yield made
    release_offscreen(made)


def _read(
    context: moderngl.Context, array: moderngl.TextureArray, level: int, layer: int
) -> npt.NDArray[np.uint8]:
    """Return a copy (height, width, 4) as shaders read it."""
    width, height = max(array.width >> level, 1), max(array.height >> level, 1)
    program = compile_program(context, VERTEX, FRAGMENT)
    program["level"], program["layer"] = level, layer
    frame = context.simple_framebuffer((width, height), 4)
    frame.use()
    array.use(UNITS["picture"])
    corners = context.buffer(EVERYWHERE.tobytes())
    context.vertex_array(program, [(corners, "2f4", "in_corner")]).render(vertices=3)
    return np.frombuffer(frame.read(components=4), np.uint8).reshape(height, width, 4)


@pytest.mark.parametrize(
    ("height", "width", "channels"), [(16, 16, 3), (16, 16, 4), (4, 16, 4), (12, 20, 3)]
)
def test_a_smaller_copy_is_the_mean_of_four_pixels_whatever_their_alpha(
    context: moderngl.Context, height: int, width: int, channels: int
) -> None:
    rng = np.random.default_rng(3)
    stack = [rng.integers(0, 256, (height, width, channels), np.uint8) for _ in range(3)]
    array = code_layers(context, GlCalls(context), stack)
    for layer in range(3):
        finer = _read(context, array, 0, layer)
        assert np.array_equal(stack[layer], finer[..., :channels])
        level = 1
        while max(array.width, array.height) >> level:
            read = _read(context, array, level, layer).astype(float)
            high, wide = finer.shape[0] // len(read), finer.shape[1] // read.shape[1]
            if (high * len(read), wide * read.shape[1]) != finer.shape[:2]:
                break  # an odd side is halved as the driver will
            means = finer.reshape(len(read), high, read.shape[1], wide, 4).mean(axis=(1, 3))
            assert abs(means - read).max() <= 2.0
            finer, level = read, level + 1


def test_the_driver_is_asked_for_no_copies_where_sides_are_powers_of_two(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(moderngl.TextureArray, "build_mipmaps", asked.append)
    code_layers(context, GlCalls(context), [np.zeros((8, 32, 3), np.uint8)])
    assert asked == []
