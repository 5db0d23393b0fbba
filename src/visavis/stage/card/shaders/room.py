"""Rooms, things and flat boards, in GLSL."""

from visavis.stage.card.shaders import source
from visavis.stage.card.shaders.lighting import DECODED, FRAME_BLOCK, LIGHTING

VERTEX = LIGHTING + DECODED + source("room_vertex")

DEPTH_VERTEX = FRAME_BLOCK + source("room_depth_vertex")

SHADOW_VERTEX = source("room_shadow_vertex")

FRAGMENT = LIGHTING + DECODED + source("room_fragment")

BOARD_VERTEX = FRAME_BLOCK + source("board_vertex")

_CODES = DECODED + source("of_codes")

BOARD_FRAGMENT = _CODES + source("board_fragment")

SURROUND_VERTEX = source("surround_vertex")

SURROUND_FRAGMENT = _CODES + source("surround_fragment")

VEIL_FRAGMENT = _CODES + source("veil_fragment")

MARK_FRAGMENT = _CODES + source("mark_fragment")
