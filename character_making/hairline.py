"""Where hair grows on a head."""

import numpy as np

from character_making.figure import Figure
from character_making.noise import noise
from visavis.lab.geometry import Vector


def hairline_field(figure: Figure, points_m: Vector, receding: float = 0.0) -> Vector:
    """Return metres outside the haired scalp (v,): forehead, temples, ears and nape are out."""
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    scale = figure.stature_m / 1.72
    x = np.abs(points_m[:, 0]) / scale
    y, z = (points_m[:, 1] - eye[1]) / scale, (points_m[:, 2] - eye[2]) / scale
    # z grows backwards. From the forehead over the temple down before the ear, then the nape.
    corners = np.exp(-(((x - 0.042) / 0.022) ** 2))
    # A soft peak in the middle, a bay at either side; nobody's hairline is drawn with a ruler.
    peak, bay = np.exp(-((x / 0.013) ** 2)), np.exp(-(((x - 0.036) / 0.013) ** 2))
    front = 0.074 - 0.0015 * peak + 0.002 * bay - 10.0 * np.maximum(x - 0.03, 0) ** 2
    front = front + receding * (0.014 + 0.028 * corners)
    side = np.interp(
        z,
        [0.012, 0.030, 0.046, 0.062, 0.072, 0.080, 0.100, 0.125, 0.155],
        [0.064, 0.048, 0.024, -0.012, -0.016, 0.018, 0.022, -0.030, -0.085],
    )
    line = np.where(x > 0.052, side, np.where(z < 0.05, front, -0.085))
    blend = np.clip((x - 0.045) / 0.014, 0, 1)
    rear = np.where(z < 0.05, front, side)
    line = (1 - blend) * rear + blend * side
    uneven = 0.0030 * noise(points_m, 95, 5) + 0.0022 * noise(points_m, 260, 6)
    on_ear = (y < 0.045) & (z > 0.055) & (z < 0.15)
    ear = on_ear * np.clip((x - _EAR_FROM_M) / 0.004, 0, 1)
    field: Vector = (line - y) * scale + uneven + _NO_HAIR_M * ear
    return field


_EAR_FROM_M, _NO_HAIR_M = 0.079, 0.06
"""How far from the middle of somebody 1.72 m tall what is beside the scalp is ear; how far
outside hair its tip is set."""
