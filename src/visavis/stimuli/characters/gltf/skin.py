"""Tell skin from clothes where one material of a file covers both, by the colour of the face."""

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.gltf.looks import linear_of

MAX_HUE_DISTANCE = 0.30
"""How far skin's red over green and green over blue, as logarithms, lie from the face's."""
MAX_LIGHT_DISTANCE = 1.0
"""The same for its light: skin in a file is at most so much lighter or darker than its face; the
darker, the nearer in hue.
"""
MIN_HAIR_DARKNESS = 0.4
"""Hair before the ears is at least so much darker than the face, as a logarithm: ears may differ
from it in hue, but not in light.
"""
MIN_FACE_TRIANGLES = 20
"""A surface with less of a face has none to compare with."""
ROUNDS = 4
Mask = npt.NDArray[np.bool_]
_CORNERS = np.array([[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6], [1 / 3, 1 / 3, 1 / 3]])


def look_of_face(
    pixels: npt.NDArray[np.uint8], uv: Vector, triangles: npt.NDArray[np.int64], faces: Mask
) -> Vector:
    """Return the look (3,) of a face: red over green, green over blue and light, as logarithms.

    `uv` (v, 2) are places in `pixels`, `faces` (t,) says which triangles (t, 3) are of the face.
    """
    look: Vector = np.median(_looks(pixels, uv, triangles[faces]), axis=0)
    return look


def like_the_face(
    pixels: npt.NDArray[np.uint8], uv: Vector, triangles: npt.NDArray[np.int64], face: Vector
) -> Mask:
    """Return which triangles (t,) look like a face of the look (3,)."""
    difference = _looks(pixels, uv, triangles) - face
    hue = np.abs(difference[:, :2]).max(axis=1) / MAX_HUE_DISTANCE
    light = difference[:, 2] / MAX_LIGHT_DISTANCE
    # Palms are lighter and of another hue; what is darker and of another hue is brown cloth.
    near = (hue**2 + np.minimum(light, 0.0) ** 2 < 1.0) & (light < 1.0)
    # Single triangles of another colour, such as nails or buttons, follow their neighbours.
    n = len(uv)
    share = near.astype(np.float64)
    many = np.maximum(np.bincount(triangles.ravel(), minlength=n), 1)
    for _ in range(ROUNDS):
        at = np.bincount(triangles.ravel(), np.repeat(share, 3), minlength=n) / many
        share = at[triangles].mean(axis=1)
    is_alike: Mask = share > 0.5
    return is_alike


def darker_than_the_face(
    pixels: npt.NDArray[np.uint8], uv: Vector, triangles: npt.NDArray[np.int64], face: Vector
) -> Mask:
    """Return which triangles (t,) are as much darker than the face's look (3,) as hair is."""
    darker: Mask = _looks(pixels, uv, triangles)[:, 2] < face[2] - MIN_HAIR_DARKNESS
    return darker


def _looks(pixels: npt.NDArray[np.uint8], uv: Vector, triangles: npt.NDArray[np.int64]) -> Vector:
    """Return red over green, green over blue and light (t, 3) of triangles, as logarithms."""
    places = np.einsum("sk,tkc->tsc", _CORNERS, uv[triangles])
    height, width = pixels.shape[:2]
    column = np.floor(places[..., 0] % 1.0 * width).astype(np.int64) % width
    row = np.floor(places[..., 1] % 1.0 * height).astype(np.int64) % height
    light = linear_of(pixels[row, column, :3] / 255).mean(axis=1) + 0.004
    r, g, b = np.log(light).T
    return np.stack([r - g, g - b, (r + g + b) / 3], axis=1)
