"""A customer's view of a clerk: eyes, occluders and light.

Coordinates are the office's, in which the third customer stands at the origin.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Character
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.dressing.office import PARTS, person_of, pose_of_waver
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.people import PeopleMotion
from visavis.stimuli.motion.warping.outlook import Outlook, looking_at, outlook_in, seen_from
from visavis.stimuli.motion.warping.perceived import SeenBody, body_of, posed_points
from visavis.stimuli.picture import StaticMesh
from visavis.stimuli.rooms.office import office
from visavis.stimuli.scenes import office as places
from visavis.stimuli.scenes.office import Waving

BODY_TRIANGLES: Final = 2500
BYSTANDER_TRIANGLES: Final = 2500
VIEW_RADIUS_M: Final = 0.8
VIEW_PX: Final = 256
MIDDLE_ABOVE_HIPS_M: Final = 0.35
STILL: Final = Aimed(np.full((1, 3), np.nan), np.ones(1))


def character_of(role: str) -> Character:
    """Return the character of a person in the office."""
    return default_casting(PARTS[role])


def heading_deg(clerk: str, target_place: str) -> float:
    """Return the turn (left of −z) of a clerk who faces a customer's place, near their front."""
    way = places.place(target_place).floor_m - places.place(clerk).floor_m
    turn_deg = float(np.degrees(np.arctan2(-way[0], -way[2])))
    return turn_deg % 360.0


def eye_at(place: str, height_m: float = places.STANDING_EYE_M) -> Vector:
    """Return where a customer's eyes are (3,), in the office's coordinates."""
    eye: Vector = places.place(place).floor_m + np.array([0.0, height_m, 0.0])
    return eye


@lru_cache(maxsize=16)
def body_mesh(role: str) -> StaticMesh:
    """Return a person of the office, standing or sitting relaxed, as a mesh that hides others."""
    person = person_of(role, "place_3", None, 0)
    pose = PeopleMotion((person,)).at(0.0, STILL)
    body = body_of(character_of(role), most_triangles=BYSTANDER_TRIANGLES)
    points = posed_points(body, pose.root_m[0], pose.orientation_wxyz[0])
    points = points - places.shift_m("place_3")
    flat = np.zeros_like(points, dtype=np.float32)
    grey = np.full(points.shape, 128, np.uint8)
    return StaticMesh(points.astype(np.float32), flat, grey, body.triangles)


def others_in_view(clerk: str, viewer_place: str) -> tuple[StaticMesh, ...]:
    """Return the people who may hide a clerk from a customer's place."""
    return tuple(body_mesh(role) for role in PARTS if role not in (clerk, viewer_place))


def view_of(clerk: str, eye_m: Vector, viewer_place: str, size_px: int = VIEW_PX) -> Outlook:
    """Return what somebody in a customer's place sees a clerk through, in office coordinates."""
    return _view_from(clerk, tuple(eye_m.tolist()), viewer_place, size_px)


@lru_cache(maxsize=64)
def _view_from(clerk: str, eye_m: tuple[float, ...], viewer_place: str, size_px: int) -> Outlook:
    lit, centre = _lit_view(clerk, viewer_place, size_px), _middle_of(clerk)
    hiding = [p.mesh for p in office().props]
    camera = looking_at(np.array(eye_m), centre, VIEW_RADIUS_M)
    return seen_from(lit, camera, [*hiding, *others_in_view(clerk, viewer_place)])


@lru_cache(maxsize=32)
def _lit_view(clerk: str, viewer_place: str, size_px: int) -> Outlook:
    """Return a view with the lamps' shadows, which do not depend on the eye."""
    centre = _middle_of(clerk)
    return outlook_in(
        office(),
        looking_at(eye_at(viewer_place), centre, VIEW_RADIUS_M),
        size_px,
        lit_centre_m=centre,
        more=others_in_view(clerk, viewer_place),
    )


def _middle_of(clerk: str) -> Vector:
    middle: Vector = places.place(clerk).floor_m + np.array(
        [0.0, places.SEAT_M + 0.1 + MIDDLE_ABOVE_HIPS_M, 0.0]
    )
    return middle


def seen_body_of(clerk: str) -> SeenBody:
    """Return a clerk's body as the raster draws it."""
    return body_of(character_of(clerk), most_triangles=BODY_TRIANGLES)


def drawn_clip(waving: Waving) -> Clip:
    """Return a wave as it is drawn between its start and its end, in the office's coordinates."""
    n = round((waving.end_s - waving.start_s) / waving.clip.frame_s) + 1
    times = waving.start_s + waving.clip.frame_s * np.arange(n)
    poses = [pose_of_waver(waving, float(t)) for t in times]
    return replace(
        waving.clip,
        root_m=np.array([root for root, _ in poses]),
        orientation_wxyz=np.array([turns for _, turns in poses]),
    )
