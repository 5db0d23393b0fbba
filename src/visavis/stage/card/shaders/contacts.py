"""Contact shadows in GLSL: how much light from above an object on the floor blocks."""

from visavis.stage.card.shaders import source
from visavis.stage.card.shaders.lighting import FRAME_BLOCK

_PULLED = source("on_floor")

VERTEX = FRAME_BLOCK + _PULLED + source("contact_vertex")

_SHADED = source("shade")

FRAGMENT = _SHADED + source("contact_fragment")
