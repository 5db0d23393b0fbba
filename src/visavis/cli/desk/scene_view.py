"""Views of a session's scene for the desk: from above, and from the participant's head."""

import base64
import io
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.lab.geometry import Vector, quat_conjugate, rotate
from visavis.protocol.session.operator import SessionStatus
from visavis.stage.contracts import Glance
from visavis.stimuli.moving_heads import agents_at
from visavis.stimuli.panels import PanelFrame
from visavis.stimuli.picture import Camera, Panel
from visavis.stimuli.scene import Scene

GAZE_KEPT: Final = 3
"""Number of statuses for which the last gaze stays without a new one: a blink, not a loss."""
VIEW: Final = (-1.0, 1.0, -0.75, 0.75)
"""Tangents left, right, bottom, top of a view without a picture."""
NEAREST_M: Final = 0.05
WIDEST_DEG: Final = 80.0
HEAD_M: Final = 0.12
"""Radius of heads for which the scene gives none."""
STANDING_HEAD_M: Final = 1.58
ABOVE_HIPS_M: Final = 0.62
JPEG_QUALITY: Final = 65


@dataclass(frozen=True, eq=False)
class Ray:
    """A copy of the newest gaze: from where, where to, and whom it meets (-1: nobody)."""

    origin_m: Vector
    direction: Vector
    hit: int


@dataclass(frozen=True, eq=False)
class Areas:
    """The areas of interest of a scene as one sample of gaze saw them.

    For m agents: `radius_deg` (m,) of each head and `pad_deg` (m,) by which its area is wider,
    both from `origin_m` (3,).
    """

    scene: Scene
    origin_m: Vector
    radius_deg: npt.NDArray[np.float64]
    pad_deg: npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LastGaze:
    """The last gaze, kept between statuses that may bring none."""

    ray: Ray | None = None
    ray_age: int = 0
    areas: Areas | None = None

    def after(self, status: SessionStatus, pad_deg: float) -> Self:
        """Return the last gaze after a status; areas of interest are `pad_deg` wider than heads."""
        ray, areas = _last_ray(status), _last_areas(status, pad_deg)
        scene = None if status.scene_frame is None else status.scene_frame.scene
        if areas is None and self.areas is not None and self.areas.scene is scene:
            areas = self.areas
        if ray is not None:
            return type(self)(ray, 0, areas)
        age = self.ray_age + 1
        return type(self)(self.ray if age <= GAZE_KEPT else None, age, areas)


def above(status: SessionStatus, looking: LastGaze) -> dict[str, Any] | None:
    """Return where everybody is, seen from above: metres to the right (x) and backwards (z).

    `people` have name, x, z and radius; `areas` the radii of areas of interest round as many of
    them; `touched` are the places in `people` of those whom the participant touches.
    """
    frame, scene_frame = status.frame, status.scene_frame
    if frame is None or scene_frame is None:
        return None
    is_dark = scene_frame.scene.brightness_01 == 0.0
    ray, areas = looking.ray, looking.areas
    people = [] if is_dark else _people(status)
    radii_m: list[float] = []
    if areas is not None and people:
        away_m = np.linalg.norm([at - areas.origin_m for _, at, _ in people], axis=1)
        half_rad = np.radians(np.minimum(areas.radius_deg + areas.pad_deg, WIDEST_DEG))
        radii_m = np.round(away_m * np.sin(half_rad), 4).tolist()
    touched_people = {contact.person for contact in status.contacts}
    return {
        "people": [[n, float(at[0]), float(at[2]), r] for n, at, r in people],
        "areas": radii_m,
        "touched": sorted(n for n in touched_people if n is not None and n < len(people)),
        "head": _ground(frame.head.position_m) if frame.head_valid else None,
        "ahead": _ground(rotate(frame.head.orientation_wxyz, np.array([0.0, 0.0, -1.0]))),
        "gaze": None if ray is None else [*_ground(ray.origin_m), *_ground(ray.direction)],
        "hit": _hit(status, ray, is_dark=is_dark),
    }


def from_head(
    status: SessionStatus, looking: LastGaze, glance: Glance | None = None
) -> dict[str, Any] | None:
    """Return what is before the participant, in tangents to the right and up of straight ahead.

    `heads` have name, x, y and radius, the farthest first, `areas` x, y and radius, `boards` four
    corners each; `hit` is the place in `heads` of the person that gaze meets. With a glance, all
    places are those in its picture, which is included as JPEG in base64.
    """
    frame, scene_frame = status.frame, status.scene_frame
    if frame is None or scene_frame is None or not (frame.head_valid or glance):
        return None
    camera = Camera(frame.head, *VIEW) if glance is None else glance.camera
    is_dark = scene_frame.scene.brightness_01 == 0.0
    ray, areas = looking.ray, looking.areas
    hit = _hit(status, ray, is_dark=is_dark)
    people = [] if is_dark else _people(status)
    centres_m = np.array([centre for _, centre, _ in people]).reshape(-1, 3)
    heads = []
    for i, ((name, _, radius_m), at) in enumerate(
        zip(people, _in_view(camera, centres_m), strict=True)
    ):
        if at is not None:
            heads.append((at[2], [name, at[0], at[1], round(radius_m / at[2], 4)], i == hit))
    heads.sort(key=lambda head: -head[0])
    rings = []
    if areas is not None and people:
        half_rad = np.radians(np.minimum(areas.radius_deg + areas.pad_deg, WIDEST_DEG))
        for at, radius in zip(_in_view(camera, centres_m), np.tan(half_rad).tolist(), strict=True):
            if at is not None:
                rings.append([at[0], at[1], round(radius, 4)])
    gaze = None if ray is None else _in_view(camera, camera.pose.position_m + ray.direction)[0]
    mark = (
        None if scene_frame.scene.mark_m is None else _in_view(camera, scene_frame.scene.mark_m)[0]
    )
    panels = scene_frame.panels if isinstance(scene_frame, PanelFrame) else ()
    return {
        "tangents": [camera.left, camera.right, camera.bottom, camera.top],
        "jpeg": None if glance is None else jpeg_of(glance.image),
        "heads": [head for _, head, _ in heads],
        "hit": next((i for i, (_, _, is_hit) in enumerate(heads) if is_hit), -1),
        "areas": rings,
        "boards": [corners for panel in panels if (corners := _corners(camera, panel))],
        "mark": None if mark is None else mark[:2],
        "gaze": None if gaze is None else gaze[:2],
    }


def jpeg_of(image: npt.NDArray[np.uint8]) -> str:
    """Return a picture (height, width, 3) as JPEG in base64."""
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=JPEG_QUALITY)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def _people(status: SessionStatus) -> list[tuple[str, Vector, float]]:
    """Return name, centre of the head (3,) and its radius of everybody in the scene."""
    scene_frame = status.scene_frame
    assert scene_frame is not None  # noqa: S101 - asked by both views
    frame = status.frame
    if scene_frame.people is not None:
        up = np.array([0.0, ABOVE_HIPS_M, 0.0])
        return [(str(n + 1), at + up, HEAD_M) for n, at in enumerate(scene_frame.people.root_m)]
    stand_m = scene_frame.scene.stand_m
    if len(stand_m):
        return [
            (str(n + 1), np.array([x, STANDING_HEAD_M, z]), HEAD_M)
            for n, (x, z) in enumerate(stand_m.tolist())
        ]
    return [
        (a.place, np.asarray(a.head_centre_m), max(a.head_radius_m, HEAD_M))
        for a in agents_at(scene_frame.scene, scene_frame.t_ns if frame is None else frame.t_ns)
    ]


def _hit(status: SessionStatus, ray: Ray | None, *, is_dark: bool) -> int:
    scene_frame = status.scene_frame
    is_agent = scene_frame is not None and scene_frame.people is None and not is_dark
    return ray.hit if ray is not None and is_agent else -1


def _last_ray(status: SessionStatus) -> Ray | None:
    if status.frame is None:
        return None
    gaze = status.frame.gaze
    valid_rows = np.flatnonzero(gaze.valid)
    if not valid_rows.size:
        return None
    i = int(valid_rows[-1])
    return Ray(gaze.origin_world_m[i].copy(), gaze.direction_world[i].copy(), int(gaze.hit[i]))


def _last_areas(status: SessionStatus, pad_deg: float) -> Areas | None:
    if status.frame is None or status.scene_frame is None or status.scene_frame.people is not None:
        return None
    gaze, scene = status.frame.gaze, status.scene_frame.scene
    if gaze.radius_deg.shape[1] != len(scene.agents) or not scene.agents:
        return None
    finite_rows = np.flatnonzero(np.isfinite(gaze.radius_deg).all(axis=1))
    if not finite_rows.size:
        return None
    i = int(finite_rows[-1])
    pads = np.clip(gaze.pad_limit_deg[i].astype(np.float64), 0.0, pad_deg)
    radii = gaze.radius_deg[i].astype(np.float64)
    return Areas(scene, gaze.origin_world_m[i].copy(), radii, pads)


def _in_view(camera: Camera, points_m: Vector) -> list[tuple[float, float, float] | None]:
    """Return tangents to the right and up of points (n, 3), and how far ahead; None behind."""
    back = quat_conjugate(camera.pose.orientation_wxyz)
    points = rotate(back, np.atleast_2d(np.asarray(points_m)) - camera.pose.position_m)
    return [
        (round(x / -z, 4), round(y / -z, 4), -z) if z < -NEAREST_M else None
        for x, y, z in points.tolist()
    ]


def _corners(camera: Camera, panel: Panel) -> list[list[float]]:
    """Return the corners of a board in view; none where one is behind."""
    width, height = panel.size_m
    own = np.array([(-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)]) * (width / 2, height / 2, 0.0)
    points = _in_view(camera, panel.pose.position_m + rotate(panel.pose.orientation_wxyz, own))
    corners = [[at[0], at[1]] for at in points if at is not None]
    return corners if len(corners) == len(points) else []


def _ground(vector: Vector) -> list[float]:
    return [round(float(vector[0]), 4), round(float(vector[2]), 4)]
