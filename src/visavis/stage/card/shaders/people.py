"""Skin, eyes, hair and cloth, in GLSL: skinning from textures of vertices and joints; shading."""

from visavis.stage.card.shaders import source
from visavis.stage.card.shaders.lighting import DECODED, FRAME_BLOCK, LIGHTING

SHADERS = {
    "skin": "KIND_SKIN",
    "eye": "KIND_EYE",
    "hair": "KIND_HAIR",
    "cloth": "KIND_CLOTH",
}
"""Shader symbols of kinds of surface; all other kinds share one lighting model."""
KINDS = ("skin", "eye", "hair", "lash", "teeth", "cloth", "leather", "other")
"""Surface kinds by the number the shader knows them by."""

CHUNK_VERTICES = 256
"""Skinned at a time: a chunk holds vertices of one person, its last repeated until it is full."""
CHUNKS_WIDE, SOURCES_WIDE, DELTAS_WIDE = 64, 800, 200
"""How many lie in a row of each texture: chunks, vertices, displaced vertices."""

SKIN_VERTEX = (
    LIGHTING
    + DECODED
    + f"""
const int CHUNK = {CHUNK_VERTICES}, CHUNKS_WIDE = {CHUNKS_WIDE};
const int SOURCES_WIDE = {SOURCES_WIDE}, DELTAS_WIDE = {DELTAS_WIDE};
"""
    + source("skin_vertex")
)
"""Skins everyone once a frame; what it writes is drawn from every eye and lamp."""

SKINNED_VARYINGS = (
    "out_place",
    "out_normal",
    "out_detail",
    "out_albedo",
    "out_surface",
    "out_person",
)
SKINNED_BYTES = 56
SKINNED_LAYOUT = (
    "3f4 3f4 3f4 3f4 4u1 1u4",
    "in_place",
    "in_normal",
    "in_detail",
    "in_albedo",
    "in_surface",
    "in_person",
)

EACH = source("each")

VERTEX = LIGHTING + EACH + source("people_skinned_look") + source("people_vertex")

LIT_VERTEX = LIGHTING + DECODED + EACH + source("people_lit_look") + source("people_vertex")
"""For people whom the processor has skinned and lit."""

DEPTH_VERTEX = FRAME_BLOCK + source("people_depth_vertex")

SHADOW_VERTEX = source("people_shadow_vertex")

FRAGMENT = LIGHTING + DECODED + EACH + source("people_fragment")

SHADOW_FRAGMENT = "void main() {}\n"
DEPTH_FRAGMENT = "out vec4 colour;\nvoid main() { colour = vec4(1.0); }\n"
"""Writes that all of a pixel is covered, which decides how many of its samples have depth."""
