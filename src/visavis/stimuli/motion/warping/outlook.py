"""An observer's view: camera, occluders and lamps, packed once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from visavis.lab.geometry import Pose, Vector, quat_multiply, rotate, unit
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.warping.raster_kernels import (
    BOTH_SIDES,
    EYE,
    LAMP,
    NEAR_M,
    Bytes,
    Faces,
    Floats,
    Ints,
    Lighting,
    draw,
    project_points,
)
from visavis.stimuli.picture import Camera, Light, Room, StaticMesh

SHADOW_PX: Final = 192
SUN_DISTANCE_M: Final = 200.0
MIN_LIGHT_01: Final = 0.15
"""Share of the luminance of a fully lit white surface below which nothing is perceived."""
UNLIT: Final = Lighting(0.0, np.zeros((0, LAMP)), np.zeros((0, 1, 1)), np.zeros((0, EYE)), 0.0)
"""Without lamps everything counts as lit."""


@dataclass(frozen=True, eq=False)
class Outlook:
    """A still view: camera, inverse depth of the surroundings (h, w), lamps with shadow maps."""

    camera: Camera
    eye: Floats
    behind: Floats
    lighting: Lighting

    @property
    def size_px(self) -> tuple[int, int]:
        """Height and width of the buffer."""
        height, width = self.behind.shape
        return height, width


def looking_at(eye_m: Vector, centre_m: Vector, radius_m: float, *, aspect: float = 1.0) -> Camera:
    """Return a camera at `eye_m` whose view just holds a ball about `centre_m`.

    Raises:
        MotionError: the eye is inside the ball.
    """
    to_centre = np.asarray(centre_m, dtype=np.float64) - eye_m
    distance = float(np.linalg.norm(to_centre))
    if not distance > 1.05 * radius_m:
        raise MotionError(
            f"the observer is {distance:.2f} m from the middle of a view of {radius_m:.2f} m "
            "radius; move the observer back or look at something smaller"
        )
    half = radius_m / float(np.sqrt(distance**2 - radius_m**2))
    return Camera(
        Pose(np.asarray(eye_m, dtype=np.float64), _towards(to_centre / distance)),
        -half * aspect,
        half * aspect,
        -half,
        half,
    )


def _towards(direction: Vector) -> Vector:
    """Return the turn that leads −z to a unit direction with the horizon kept level."""
    yaw = np.arctan2(-direction[0], -direction[2])
    pitch = np.arcsin(np.clip(direction[1], -1.0, 1.0))
    about_y = np.array([np.cos(yaw / 2), 0.0, np.sin(yaw / 2), 0.0])
    about_x = np.array([np.cos(pitch / 2), np.sin(pitch / 2), 0.0, 0.0])
    return quat_multiply(about_y, about_x)


def packed_eye(camera: Camera) -> Floats:
    """Return the camera as the kernels read it."""
    q = camera.pose.orientation_wxyz
    axes = np.array([rotate(q, axis) for axis in np.eye(3)])
    row = np.zeros(EYE)
    row[:3] = camera.pose.position_m
    row[3:12] = axes.ravel()
    row[12:16] = camera.left, camera.right, camera.bottom, camera.top
    return row


def depth_of(meshes: Sequence[StaticMesh], eye: Floats, height: int, width: int) -> Floats:
    """Return the inverse depth (h, w) of rigid meshes seen by a packed camera; both sides hide."""
    nearness = np.zeros((height, width))
    ids: Bytes = np.zeros((height, width), dtype=np.uint8)
    for mesh in meshes:
        points, triangles = _cut_at_eye(mesh, eye)
        screen = np.empty_like(points)
        project_points(points, eye, width, height, screen)
        labels: Bytes = np.full(len(triangles), BOTH_SIDES, dtype=np.uint8)
        draw(points, screen, Faces(triangles, labels), ids, nearness, UNLIT)
    return nearness


def _cut_at_eye(mesh: StaticMesh, eye: Floats) -> tuple[Floats, Ints]:
    """Return vertices and triangles of what of a mesh lies before the eye.

    Walls and floors reach past the observer; the kernels draw whole triangles only.
    """
    points = np.ascontiguousarray(mesh.vertices_m, dtype=np.float64)
    ahead = -(points - eye[:3]) @ eye[9:12] - 2 * NEAR_M
    corner = ahead[mesh.triangles]
    inside = (corner > 0).sum(axis=1)
    whole = np.asarray(mesh.triangles[inside == 3], dtype=np.int32)
    cut = np.flatnonzero((inside == 1) | (inside == 2))
    if not len(cut):
        return points, np.ascontiguousarray(whole)
    # Turn each triangle so that its first corner is alone on its side; two edges leave from it.
    alone = np.where(inside[cut] == 1, corner[cut].argmax(axis=1), corner[cut].argmin(axis=1))
    a, b, c = (mesh.triangles[cut, (alone + k) % 3] for k in range(3))
    new = len(points) + np.arange(2 * len(cut), dtype=np.int32).reshape(2, -1)
    on_edge = []
    for other in (b, c):
        share = (ahead[a] / (ahead[a] - ahead[other]))[:, None]
        on_edge.append((1 - share) * points[a] + share * points[other])
    one, two = inside[cut] == 1, inside[cut] == 2
    pieces = [
        whole,
        np.stack([a, new[0], new[1]], axis=1)[one],
        np.stack([new[0], b, c], axis=1)[two],
        np.stack([new[0], c, new[1]], axis=1)[two],
    ]
    return np.concatenate([points, *on_edge]), np.concatenate(pieces).astype(np.int32)


def outlook(
    camera: Camera,
    size_px: int | tuple[int, int] = 128,
    *,
    occluders: Sequence[StaticMesh] = (),
    lights: Sequence[Light] = (),
    ambient_01: float = 0.0,
    lit_centre_m: Vector | None = None,
    lit_radius_m: float = 1.2,
    least_light_01: float = MIN_LIGHT_01,
) -> Outlook:
    """Pack a view; shadows of the occluders are kept for the ball where the body is.

    `lit_centre_m` (3,) is needed with lights. Raises MotionError when it is missing or the size
    is not that of a picture.
    """
    height, width = (size_px, size_px) if isinstance(size_px, int) else size_px
    if min(height, width) < 8:
        raise MotionError(f"a view of {height} × {width} pixels; use at least 8 × 8")
    eye = packed_eye(camera)
    lamps, eyes, maps = [], [], []
    for light in lights:
        if lit_centre_m is None:
            raise MotionError("lights need to know where the body is; give lit_centre_m")
        lamp, place = _lamp(light, lit_centre_m)
        view = packed_eye(looking_at(place, lit_centre_m, lit_radius_m))
        lamps.append(lamp)
        eyes.append(view)
        maps.append(depth_of(occluders, view, SHADOW_PX, SHADOW_PX))
    return Outlook(
        camera=camera,
        eye=eye,
        behind=depth_of(occluders, eye, height, width),
        lighting=Lighting(
            ambient=ambient_01,
            lamps=np.array(lamps).reshape(-1, LAMP),
            maps=np.array(maps).reshape(-1, SHADOW_PX, SHADOW_PX),
            map_eyes=np.array(eyes).reshape(-1, EYE),
            least_light=least_light_01,
        ),
    )


def outlook_in(
    room: Room,
    camera: Camera,
    size_px: int | tuple[int, int] = 128,
    *,
    lit_centre_m: Vector,
    lit_radius_m: float = 1.2,
    more: Sequence[StaticMesh] = (),
    least_light_01: float = MIN_LIGHT_01,
) -> Outlook:
    """Pack a view into a room: its props hide and shade, its lamps and ambient light it."""
    props = [p.mesh for p in room.props]
    shading = [p.mesh for p in room.props if p.casts_shadow]
    view = outlook(
        camera,
        size_px,
        occluders=[*shading, *more],
        lights=room.lights,
        ambient_01=float((room.sky.mean() + room.ground.mean()) / 2),
        lit_centre_m=lit_centre_m,
        lit_radius_m=lit_radius_m,
        least_light_01=least_light_01,
    )
    return seen_from(view, camera, [*props, *more])


def seen_from(view: Outlook, camera: Camera, hiding: Sequence[StaticMesh]) -> Outlook:
    """Return a view from another camera: what hides is drawn anew, shadows stay as they are."""
    height, width = view.size_px
    eye = packed_eye(camera)
    return replace(view, camera=camera, eye=eye, behind=depth_of(hiding, eye, height, width))


def _lamp(light: Light, lit_centre_m: Vector) -> tuple[Vector, Vector]:
    """Return a light as the kernels read it, and its place; a sun is a lamp far away."""
    strength = float(np.mean(light.intensity))
    if light.kind == "sun":
        if light.direction is None:
            raise MotionError("a sun without direction; give one")
        along = unit(np.asarray(light.direction, dtype=np.float64))
        place = lit_centre_m - SUN_DISTANCE_M * along
        return np.array([strength, *place, *along, -1.0, 0.0]), place
    if light.position_m is None:
        raise MotionError(f"a {light.kind} light without place; give position_m")
    place = np.asarray(light.position_m, dtype=np.float64)
    if light.kind == "point" or light.direction is None:
        return np.array([strength, *place, 0.0, 0.0, 0.0, -1.0, 1.0]), place
    along = unit(np.asarray(light.direction, dtype=np.float64))
    edge = float(np.cos(np.radians(light.half_angle_deg)))
    return np.array([strength, *place, *along, edge, 1.0]), place
