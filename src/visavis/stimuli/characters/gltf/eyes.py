"""Where the eyes of an imported figure are and where they look, fitted from the eyeballs."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, unit
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf.figure import Figure, Surface
from visavis.stimuli.characters.gltf.file import GltfFile
from visavis.stimuli.characters.gltf.looks import linear_of, srgb_of

MIN_RADIUS_M, MAX_RADIUS_M = 0.005, 0.03
STANDS_BY = "or import it with --without-gaze, as somebody who stands by"
MAX_OFF_BONE_M = 0.02
"""How far an eyeball's centre may lie from its bone."""


@dataclass(frozen=True, eq=False)
class EyeFit:
    """A sphere, the unit axis the eye looks along as made, and the colour of its iris."""

    centre_m: Vector
    radius_m: float
    axis: Vector
    iris_srgb: tuple[int, int, int]


def fit_eye(file: GltfFile, figure: Figure, side: str) -> EyeFit:
    """Fit an eye from the surface bound to its bone.

    The axis is that of the eyeball's own symmetry: its rings are denser at the front, or it is
    open at the back, or the cornea bulges, and each puts the mean of its surface before the
    centre of the sphere on the axis. Bones' axes say nothing: many lean.

    Raises:
        CharacterError: nothing, or no ball, hangs on the bone.
    """
    bone = figure.bone_of[f"{side}_eye"]
    balls = balls_on(figure, side)
    if not balls:
        raise CharacterError(
            f"{file.path}: no eyeball hangs on bone {figure.names[bone]!r}; bind each eyeball "
            f"wholly to its own eye bone, {STANDS_BY}"
        )
    surface, ball = max(balls, key=lambda pair: len(pair[1]))
    points = surface.vertices_m[ball]
    centre, radius = fit_sphere(points)
    if not MIN_RADIUS_M < radius < MAX_RADIUS_M:
        raise CharacterError(
            f"{file.path}: what hangs on bone {figure.names[bone]!r} is not an eyeball (sphere of "
            f"{1000 * radius:.0f} mm); an eyeball's radius is 5 to 30 mm: separate the "
            f"eyeball from other surfaces, scale the figure to metres, {STANDS_BY}"
        )
    off_m = float(np.linalg.norm(centre - figure.at_m[bone]))
    if off_m > MAX_OFF_BONE_M:
        raise CharacterError(
            f"{file.path}: what hangs on bone {figure.names[bone]!r} is not an eyeball round it: "
            f"its sphere lies {1000 * off_m:.0f} mm off, as where an iris is drawn on a flat disc; "
            f"give the figure round eyeballs, each about its own bone, {STANDS_BY}"
        )
    axis = _axis(surface, ball, centre)
    return EyeFit(centre, radius, axis, iris_colour(file, surface, ball, centre, axis))


def balls_on(figure: Figure, side: str) -> list[tuple[Surface, npt.NDArray[np.int64]]]:
    """Return surfaces with points (n,) that hang wholly on an eye's bone; none without a bone."""
    bone = figure.bone_of.get(f"{side}_eye")
    balls = []
    for surface in figure.surfaces:
        share = (surface.weights * (surface.joints == bone)).sum(axis=1)
        if "gland" not in surface.name.lower() and (share > 0.9).sum() >= 12:
            balls.append((surface, np.flatnonzero(share > 0.9)))
    return balls


def fit_sphere(points_m: Vector) -> tuple[Vector, float]:
    """Return the sphere of least squares, first all points, then without a bulging cornea."""
    fit_points_m = points_m
    centre, radius = points_m.mean(axis=0), 0.0
    for _ in range(4):
        table = np.concatenate([2 * fit_points_m, np.ones((len(fit_points_m), 1))], axis=1)
        solution, *_ = np.linalg.lstsq(table, np.sum(fit_points_m**2, axis=1), rcond=None)
        centre = solution[:3]
        radius = float(np.sqrt(max(solution[3] + centre @ centre, 0.0)))
        away = np.abs(np.linalg.norm(points_m - centre, axis=1) - radius)
        close = away < max(2.5 * np.median(away), 1e-5)
        if close.sum() < 10:
            break
        fit_points_m = points_m[close]
    return centre, radius


def _axis(surface: Surface, ball: npt.NDArray[np.int64], centre: Vector) -> Vector:
    """Return the axis of an eyeball from its front: mean over its area, refined ring by ring."""
    points = surface.vertices_m
    inside = np.isin(surface.triangles, ball).all(axis=1)
    triangles = surface.triangles[inside]
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    middle = unit((a + b + c) / 3 - centre)
    mean = (area[:, None] * middle).sum(axis=0)
    axis = np.array([0.0, 0.0, -1.0])
    if np.linalg.norm(mean) > 0.05 * area.sum():
        axis = unit(mean)
    # Poles of a lathed ball: the vertex where most triangles meet near the axis.
    corners, count = np.unique(triangles, return_counts=True)
    directions = unit(points[corners] - centre)
    front = directions @ axis > 0.85
    if front.any():
        pole = corners[front][count[front].argmax()]
        if count[front].max() >= 10:
            return unit(points[pole] - centre)
    return axis


def iris_colour(
    file: GltfFile, surface: Surface, ball: npt.NDArray[np.int64], centre: Vector, axis: Vector
) -> tuple[int, int, int]:
    """Return the colour of the iris in the texture: sRGB, of a ring between pupil and white.

    Lies between median and mean of its light. Painted glints make a mean grey; without any, as in
    the median, the browns of many files are a red that no eye has.
    """
    brown = (74, 52, 36)
    if surface.uv is None or surface.material is None:
        return brown
    look = file.items("materials")[surface.material].get("pbrMetallicRoughness", {})
    if "baseColorTexture" not in look:
        return brown
    pixels = file.image(look["baseColorTexture"]["index"])
    triangles = surface.triangles[np.isin(surface.triangles, ball).all(axis=1)]
    shares = np.random.default_rng(0).dirichlet((1, 1, 1), 40)
    places = np.einsum("sk,tkc->tsc", shares, surface.vertices_m[triangles]).reshape(-1, 3)
    uv = np.einsum("sk,tkc->tsc", shares, surface.uv[triangles]).reshape(-1, 2)
    slant = np.degrees(np.arccos(np.clip(unit(places - centre) @ axis, -1, 1)))
    ring = (slant > 10) & (slant < 20)
    if not ring.any():
        return brown
    a, b, c = (surface.vertices_m[triangles[:, k]] for k in range(3))
    area = np.repeat(np.linalg.norm(np.cross(b - a, c - a), axis=1), len(shares))[ring]
    h, w = pixels.shape[:2]
    column = np.clip((uv[ring, 0] % 1 * w).astype(int), 0, w - 1)
    row = np.clip((uv[ring, 1] % 1 * h).astype(int), 0, h - 1)
    light = linear_of(pixels[row, column, :3] / 255)
    between = (np.median(light, axis=0) + np.average(light, axis=0, weights=area)) / 2
    red, green, blue = np.round(255 * srgb_of(between))
    return int(red), int(green), int(blue)
