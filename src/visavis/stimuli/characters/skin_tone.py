"""How light somebody's skin is: what their eyes' whites go with."""

import numpy as np

from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import Character

GAMMA = 2.2
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
MAX_FACE_SAMPLES = 200
NO_SKIN_01 = 0.4


def skin_of_face_01(character: Character) -> float:
    """Return the share of light (luminance) that the skin of somebody's face gives back."""
    mesh, materials = character.levels[0], character.materials
    is_skin = np.array([m.kind == "skin" for m in materials])[mesh.triangle_material]
    rows = np.flatnonzero(is_skin & (mesh.triangle_part == PART_INDEX["face"]))
    rows = rows[:: max(1, len(rows) // MAX_FACE_SAMPLES)]
    if not len(rows):
        return NO_SKIN_01
    corner, material = mesh.triangles[rows, 0], mesh.triangle_material[rows]
    light = (mesh.colour_srgb[corner] / 255.0) ** GAMMA
    for i in np.unique(material).tolist():
        picture = materials[i].texture_srgb
        if picture is not None and mesh.uv is not None:
            mine = material == i
            size = np.array(picture.shape[1::-1])
            column, row = (np.floor(mesh.uv[corner[mine]] % 1.0 * size).astype(int) % size).T
            light[mine] *= (picture[row, column, :3] / 255.0) ** GAMMA
    return float(np.clip(np.median(light @ LUMINANCE), 0.0, 1.0))
