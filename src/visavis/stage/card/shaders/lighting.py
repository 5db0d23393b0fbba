"""Light, shadow and tone in GLSL, shared by all lit surfaces."""

from collections.abc import Sequence

from visavis.stage.card.shaders import source

MAX_LIGHTS = 8
MAX_SHADOWS = 2
SHADOW_SQUARE = 3
"""Texels a side of the squares of a shadow map whose bounds are known."""
MAX_TAPS = 3
"""A way across a shadow map: such reads stay within the squares beside that of their place."""

FRAME_BLOCK = source("frame")


LIGHTING = (
    FRAME_BLOCK
    + f"""
#define MAX_LIGHTS {MAX_LIGHTS}
#define MAX_SHADOWS {MAX_SHADOWS}
#define SHADOW_SQUARE {SHADOW_SQUARE}
"""
    + source("lighting")
)

_SQUARE = f"#define SHADOW_SQUARE {SHADOW_SQUARE}\n"
WHOLE_VERTEX = source("whole_vertex")
"""One triangle of three corners from nowhere, over all of a target."""

BOUNDS_FOUND = _SQUARE + source("bounds_found")
BOUNDS_SPREAD = source("bounds_spread")

DECODED = source("decoded")

TEXEL = source("texel")

OUTPUT_COLOUR = TEXEL + source("output_colour")

OUTPUT_IDENTITY = TEXEL + source("output_identity")


def lamp_constants(kinds: Sequence[int], shadow_of: Sequence[int]) -> str:
    """Return how many lamps there are, of which kind (0 sun, 1 spot, 2 point) and with which
    shadow map (−1 none), as constants: compilers then leave out what a room does not need.
    """
    n = max(len(kinds), 1)
    kind_list = ", ".join(str(k) for k in (*kinds, 0)[:n])
    maps = ", ".join(str(k) for k in (*shadow_of, -1)[:n])
    lamps = "".join(f"#define LAMP_OF_MAP_{k} {i}\n" for i, k in enumerate(shadow_of) if k >= 0)
    return (
        f"{lamps}#define LAMPS {len(kinds)}\n"
        f"const int LAMP_KIND[{n}] = int[{n}]({kind_list});\n"
        f"const int SHADOW_OF[{n}] = int[{n}]({maps});\n"
    )
