"""The waves of the study: turned towards the addressee, or warped to the addressee's view as well.

A warped wave takes seconds to find and is the same for everybody, so it is kept: in memory, and
on the computer under the hash of everything it follows from.
"""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Final

import numpy as np

import stimuli.motion.warping
from lab.geometry import Vector, quat_from_yaw_pitch_deg, quat_multiply, rotate
from lab.kept import digest_of, keep, read_kept
from stimuli.characters.character import Character
from stimuli.dressing.casting import build_of, default_casting
from stimuli.dressing.office import PARTS, person_of
from stimuli.gaze.turning import Aimed
from stimuli.motion.baking import baked
from stimuli.motion.clip import Clip
from stimuli.motion.kinds import Wave
from stimuli.motion.people import PeopleMotion, Person
from stimuli.motion.warping.clips import warp_clip
from stimuli.motion.warping.control import ControlSettings
from stimuli.motion.warping.features import FeatureTarget
from stimuli.motion.warping.outlook import Outlook, looking_at, outlook_in
from stimuli.motion.warping.perceived import SeenBody, body_of, posed_points
from stimuli.motion.warping.units import units_named
from stimuli.picture import StaticMesh
from stimuli.rooms.office import office
from stimuli.scenes import office as places
from stimuli.scenes.office import Waving

ORIENTATION: Final = "orientation"
WARPING: Final = "warping"
TECHNIQUES: Final = (ORIENTATION, WARPING)
"""The whole body turned towards the addressee, or the same wave warped to the addressee's view."""
KEPT_AS: Final = "waving"
HAND: Final = "right"
BODY_TRIANGLES: Final = 2500
BYSTANDER_TRIANGLES: Final = 2500
VIEW_RADIUS_M: Final = 0.8
VIEW_PX: Final = 128
MIDDLE_ABOVE_HIPS_M: Final = 0.35
SETTINGS: Final = ControlSettings(rate_hz=6.0, most_steps=6)
WARPED_PARTS: Final = (("face", "eyes"), ("right_hand",))
"""Coverage is wanted of each: the head by its face (a profile has more pixels), the waving hand."""
UNITS: Final = ("spine", "neck_head", "right_arm")
"""All warping units that move head or waving hand."""
FADE_S: Final = 0.5
STILL: Final = Aimed(np.full((1, 3), np.nan), np.ones(1))


@dataclass(frozen=True)
class Making:
    """What waves are made from: the wave lasts `wave_s` from `before_s` after the onset on.

    `increment` is how much more coverage of head and hand the warped wave shall have, `warp_from`
    what it starts from: the wave "oriented" to the addressee, or the one to the "front".
    """

    before_s: float = 1.0
    wave_s: float = 2.6
    increment: float = 0.25
    warp_from: str = "oriented"


DEFAULT_MAKING: Final = Making()


@dataclass(frozen=True)
class WarpRecord:
    """What became of a warp, for the record.

    `wanted` and `reached` coverage as shares of the original, NaN where the addressee sees nothing
    to begin with.
    """

    sha256: str
    wanted: float
    reached: float
    reached_share_01: float
    largest_turn_deg: float


@dataclass(frozen=True, eq=False)
class StudyWave:
    """One wave of the study; `record` is None where nothing was warped."""

    waving: Waving
    sha256: str
    record: WarpRecord | None


@cache
def study_wave(
    clerk: str, target_place: str, technique: str, making: Making = DEFAULT_MAKING,
    eye_height_m: float = places.STANDING_EYE_M,
) -> StudyWave:  # fmt: skip
    """Return how a clerk waves at somebody in a customer's place whose eyes are at a height.

    The same object for the same wave.
    """
    base = base_clip(clerk, making.wave_s)
    towards = heading_deg(clerk, target_place)
    front = places.place(clerk).yaw_deg
    warps = technique == WARPING
    heading = front if warps and making.warp_from == "front" else towards
    record = None
    clip = base
    if warps and making.increment > 0:
        eye_m = eye_at(target_place, eye_height_m)
        clip, record = _warped(base, clerk, target_place, eye_m, heading, making.increment)
    waving = Waving(clerk, clip, heading, making.before_s, FADE_S)
    return StudyWave(waving, digest_of(clip.root_m, clip.orientation_wxyz), record)


@lru_cache(maxsize=8)
def base_clip(clerk: str, wave_s: float) -> Clip:
    """Return a clerk's wave straight ahead on their seat, before anything is done to it."""
    number = tuple(PARTS).index(clerk)
    person = Person(
        build_of(character_of(clerk)), Wave(hand=HAND, seat_m=places.SEAT_M), 300 + number
    )
    return baked(person, wave_s, gaze=STILL)


def character_of(role: str) -> Character:
    """Return who plays somebody of the office."""
    return default_casting(PARTS[role])


def heading_deg(clerk: str, target_place: str) -> float:
    """Return the turn (left of −z) of a clerk who faces a customer's place, near their front."""
    way = places.place(target_place).floor_m - places.place(clerk).floor_m
    found = float(np.degrees(np.arctan2(-way[0], -way[2])))
    return found % 360.0


def eye_at(place: str, height_m: float = places.STANDING_EYE_M) -> Vector:
    """Return where a customer's eyes are (3,), in the office's coordinates."""
    eye: Vector = places.place(place).floor_m + np.array([0.0, height_m, 0.0])
    return eye


def in_place(clip: Clip, floor_m: Vector, turn_deg: float) -> Clip:
    """Return a clip carried to a place and turned."""
    turn = quat_from_yaw_pitch_deg(turn_deg)
    turns = clip.orientation_wxyz.copy()
    turns[:, 0] = quat_multiply(np.broadcast_to(turn, turns[:, 0].shape), turns[:, 0])
    root = floor_m + rotate(np.broadcast_to(turn, (len(turns), 4)), clip.root_m)
    return replace(clip, root_m=root, orientation_wxyz=turns)


@lru_cache(maxsize=16)
def body_mesh(role: str) -> StaticMesh:
    """Return somebody of the office who stands or sits at ease as a mesh that hides others."""
    person = person_of(role, "place_3", None, 0)
    pose = PeopleMotion((person,)).at(0.0, STILL)
    body = body_of(character_of(role), most_triangles=BYSTANDER_TRIANGLES)
    points = posed_points(body, pose.root_m[0], pose.orientation_wxyz[0])
    points = points - places.shift_m("place_3")
    flat = np.zeros_like(points, dtype=np.float32)
    grey = np.full(points.shape, 128, np.uint8)
    return StaticMesh(points.astype(np.float32), flat, grey, body.triangles)


def others_in_view(clerk: str, viewer_place: str) -> tuple[StaticMesh, ...]:
    """Return everybody who may hide a clerk from a customer's place."""
    return tuple(body_mesh(role) for role in PARTS if role not in (clerk, viewer_place))


def view_of(clerk: str, eye_m: Vector, viewer_place: str, size_px: int = VIEW_PX) -> Outlook:
    """Return what somebody in a customer's place sees a clerk through, in office coordinates."""
    centre = places.place(clerk).floor_m + np.array(
        [0.0, places.SEAT_M + 0.1 + MIDDLE_ABOVE_HIPS_M, 0.0]
    )
    return outlook_in(
        office(), looking_at(eye_m, centre, VIEW_RADIUS_M), size_px, lit_centre_m=centre,
        more=others_in_view(clerk, viewer_place),
    )  # fmt: skip


def seen_body_of(clerk: str) -> SeenBody:
    """Return a clerk's body as the raster draws it."""
    return body_of(character_of(clerk), most_triangles=BODY_TRIANGLES)


def _warped(
    base: Clip, clerk: str, target_place: str, eye_m: Vector, heading: float, increment: float
) -> tuple[Clip, WarpRecord]:
    targets = tuple(FeatureTarget("coverage", parts, increment) for parts in WARPED_PARTS)
    body = seen_body_of(clerk)
    view = view_of(clerk, eye_m, target_place)
    said = json.dumps(
        [[asdict(t) for t in targets], UNITS, asdict(SETTINGS), heading, clerk], sort_keys=True
    )
    key = digest_of(
        base.root_m, base.orientation_wxyz, body.rest, body.triangles, view.eye, view.behind,
        view.lamps, view.maps, said=said + _warping_code(),
    )  # fmt: skip
    kept = read_kept(KEPT_AS, key)
    if kept is None:
        stood = in_place(base, places.place(clerk).floor_m, heading)
        found = warp_clip(stood, body, view, targets, units_named(UNITS), SETTINGS)
        kept = {
            "orientation_wxyz": found.clip.orientation_wxyz[:, 1:],
            "numbers": np.array([
                _share(found.wanted, found.original),
                _share(found.reached, found.original),
                found.is_reached.mean(),
                np.degrees(np.abs(found.omega_rad).max()),
            ]),
        }  # fmt: skip
        keep(KEPT_AS, key, kept)
    turns = base.orientation_wxyz.copy()
    turns[:, 1:] = kept["orientation_wxyz"]
    return replace(base, orientation_wxyz=turns), WarpRecord(key, *map(float, kept["numbers"]))


def _share(value: Vector, original: Vector) -> float:
    """Return summed coverage as a share of the original; NaN where nothing was seen."""
    whole = float(original.sum())
    return float(value.sum()) / whole if whole > 0 else float("nan")


@cache
def _warping_code() -> str:
    """Return the hash of the code that warps: another version finds other waves."""
    found = hashlib.sha256()
    for folder in stimuli.motion.warping.__path__:
        for path in sorted(Path(folder).glob("*.py")):
            found.update(path.read_bytes())
    return found.hexdigest()
