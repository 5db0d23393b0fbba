"""The picture of an eye for programs that do not compute eyes as our own drawing does."""

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Eyeball
from visavis.stimuli.characters.gltf.looks import Pixels, linear_of, srgb_of

SIDE_PX = 256
UPPER_LID, LOWER_LID, CORNER = 0.85, 1.0, 2.2
UPPER_DEEP, LOWER_DEEP, CORNER_DEEP = 0.40, 0.20, 0.40
"""Where lids and corners lie about the pupil and how deep, as in `people_fragment.glsl`."""
SOFT = 0.02


def eye_uv(local: Vector) -> Vector:
    """Return where points (v, 3) of an eyeball lie in its picture (v, 2).

    `local` is counted in radii of the ball, in the eye's own axes, which looks along −z. What lies
    behind the middle is at the rim, which is white.
    """
    length = np.maximum(np.linalg.norm(local[:, :2], axis=1, keepdims=True), 1e-6)
    across = np.where(local[:, 2:] > 0, local[:, :2] / length, local[:, :2])
    uv: Vector = 0.5 + 0.5 * across * np.array([1.0, -1.0])
    return uv


def eye_picture(ball: Eyeball, skin_01: float) -> Pixels:
    """Return the picture (h, w, 3) of an eyeball as seen from the front: iris, pupil, white.

    The shade of lids and corners is in it, for an eye that looks straight ahead; `skin_01` is how
    light the skin about it is.
    """
    steps = (np.arange(SIDE_PX) + 0.5) / SIDE_PX * 2.0 - 1.0
    x, y = np.meshgrid(steps, -steps)
    iris, pupil = ball.iris_radius_m / ball.radius_m, ball.pupil_radius_m / ball.radius_m
    radius = np.hypot(x, y)
    share, place_x, place_y = radius / iris, x / iris, y / iris
    iris_colour = linear_of(np.array(ball.iris_srgb) / 255.0)
    # Who has much pigment in iris or skin has some in the white, too.
    pale = _rise(0.03, 0.10, float(iris_colour @ np.array([0.2126, 0.7152, 0.0722])))
    fair = _rise(0.05, 0.25, skin_01)
    white = np.array([0.72, 0.69, 0.66]) * _mix(np.array([0.86, 0.83, 0.78]), np.ones(3), pale)
    white = white * _mix(np.array([0.70, 0.69, 0.67]), np.ones(3), fair)
    corner = _rise(0.9, CORNER, np.abs(place_x))[..., None]
    white = _mix(white, np.array([0.50, 0.34, 0.30]), corner * corner)
    fibres = 0.72 + 0.5 * _grain(np.arctan2(y, x) * 22.0 + 80.0 + 3.0 * share)
    ring = iris_colour * (_mix(0.54, 0.33, _rise(pupil / iris, 0.85, share)) * fibres)[..., None]
    ring = _mix(ring, iris_colour * 0.12, _rise(0.62, 0.90, share)[..., None])
    light = _mix(ring, white, _rise(iris - SOFT / 2, iris + SOFT / 2, radius)[..., None])
    light = _mix(
        np.full(3, 0.006), light, _rise(pupil - SOFT / 2, pupil + SOFT / 2, radius)[..., None]
    )
    opening = (
        1.0
        - _hidden(UPPER_DEEP, UPPER_LID - place_y)
        - _hidden(LOWER_DEEP, LOWER_LID + place_y)
        - _hidden(CORNER_DEEP, CORNER - np.abs(place_x))
    )
    codes = srgb_of(light * np.maximum(opening, 0.0)[..., None])
    return np.round(255 * codes).astype(np.uint8)


def _rise(low: float, high: float, value: Vector | float) -> Vector:
    x: Vector = np.clip((np.asarray(value) - low) / (high - low), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def _mix(a: Vector | float, b: Vector | float, share: Vector) -> Vector:
    mixed: Vector = np.asarray(a) * (1.0 - share) + np.asarray(b) * share
    return mixed


def _hidden(deep: float, away: Vector) -> Vector:
    """Return the share of the light all round that an edge hides, so deep and so far away."""
    at = np.maximum(away, 0.0)
    hidden: Vector = 0.5 - 0.5 * at / np.hypot(at, deep)
    return hidden


def _grain(at: Vector) -> Vector:
    whole = np.floor(at)

    def value(x: Vector) -> Vector:
        noise: Vector = np.modf(np.abs(np.sin(x * 12.9898 + 3.0 * 78.233) * 43758.5453))[0]
        return noise

    return _mix(value(whole), value(whole + 1.0), _rise(0.0, 1.0, at - whole))
