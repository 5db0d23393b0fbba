"""Somebody who stands or sits where the participant did, so that films from outside show them."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from visavis.cli.recorded_trial import RecordedTrial
from visavis.lab.clock import NS_PER_S
from visavis.lab.eye_height import MAX_SEATED_EYE_M
from visavis.lab.geometry import Pose, Vector, quat_conjugate, quat_multiply, yaw_pitch_deg_of
from visavis.lab.geometry import rotate as turned
from visavis.protocol.plan.shown_scene import of_part
from visavis.stage.own_body import OwnBody
from visavis.stimuli.characters.cast import load_cast
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.characters.sizing import MIN_M, TALLEST_M, scale_to_stature
from visavis.stimuli.dressing.casting import build_of, default_casting, numbered_people
from visavis.stimuli.dressing.sitting import cushion_top_m
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.kinds import MAX_SEAT_M, MIN_SEAT_M, Idle, Sit
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.seating import eyes_of, seated_under_eyes
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Picture, PosedPeople, Prop, Room
from visavis.stimuli.rooms.audience_room import HIPS_BEHIND_MIDDLE_M
from visavis.stimuli.rooms.furniture import chair
from visavis.study.parts import Posture

PARTS_TRIED = tuple(f"male_{number:02d}" for number in range(12, 0, -1))
EYES_OF_STATURE = 0.936
"""Height of the eyes as a share of stature (Winter 2009)."""
MAX_APART_M = 0.5
"""A body whose head is farther from the headset is not where the participant was."""
FRESH_NS = NS_PER_S // 5
OWN_CHAIR = "chair_of_participant"
SAME_CHAIR_M = 0.5
"""A chair whose middle is nearer than this to somebody's seat is theirs."""
FLESH_M = 0.09
"""How far below the joints of the hips a cushion is, of a figure without flesh there."""


class StandIn:
    """Add a person to pictures where the participant was.

    The pose is the body tracker's. Without a tracker, or where its head is far from the one that
    the headset measured, the person stands or sits at rest under the measured head: as the study
    declares, else as the height of their eyes says. Who sits has a chair below them, where the
    room has none there.
    """

    def __init__(self, trial: RecordedTrial, posture: Posture | None = None) -> None:
        self._trial = trial
        self._posture = posture
        names = trial.recording.stream_names
        self._body: dict[str, Any] | None = None
        self._own: OwnBody | None = None
        self._rest: tuple[Character, PeopleMotion] | None = None
        self._rooms: dict[Room, Room] = {}
        schema = trial.recording.stream_schema("body") if "body" in names else None
        if schema is not None:
            field = next(f for f in schema.fields if f.name == "position_m")
            self._segments = tuple(field.description.partition(": ")[2].split())
            self._body = of_part(trial.recording, "body", trial.part)
            self._dtype = schema.dtype

    def in_picture(self, picture: Picture, t_ns: int, head: Pose) -> Picture:
        """Return a picture with the participant in it."""
        picture_with_body = self._with_body(picture, t_ns, head)
        room = picture.room
        if room not in self._rooms:
            is_seated = (self._posture or posture_of(float(head.position_m[1]))) == "seated"
            self._rooms[room] = with_chair(room, picture_with_body) if is_seated else room
        return replace(picture_with_body, room=self._rooms[room])

    def _with_body(self, picture: Picture, t_ns: int, head: Pose) -> Picture:
        row = self._row_at(t_ns)
        if row is not None and self._is_under(head, row):
            if self._own is None:
                self._own = OwnBody(somebody_else(picture), self._segments, from_outside=True)
            self._own.take_row(row)
            picture_with_body = self._own.add_to(picture, head)
            if picture_with_body is not picture:
                return picture_with_body
        return self._at_rest(picture, t_ns, head)

    def _row_at(self, t_ns: int) -> np.void | None:
        body = self._body
        if body is None or not len(body["t_host_ns"]):
            return None
        i = int(np.searchsorted(body["t_host_ns"], t_ns, side="right")) - 1
        if i < 0 or t_ns - int(body["t_host_ns"][i]) > FRESH_NS:
            return None
        row = np.zeros(1, self._dtype)
        for name in self._dtype.names or ():
            row[name][0] = body[name][i]
        return row[0]  # type: ignore[no-any-return]  # an element of a structured array

    def _is_under(self, head: Pose, row: np.void) -> bool:
        """Tell whether the tracker has its head near the one that the headset measured."""
        at = self._segments.index("head") if "head" in self._segments else -1
        if at < 0 or not row["valid"][at]:
            return True
        return float(np.linalg.norm(row["position_m"][at] - head.position_m)) <= MAX_APART_M

    def _at_rest(self, picture: Picture, t_ns: int, head: Pose) -> Picture:
        if self._rest is None:
            posture = self._posture or posture_of(float(head.position_m[1]))
            character = somebody_else(picture)
            character, person = (_seated if posture == "seated" else _standing)(character, head)
            self._rest = character, PeopleMotion((person,))
        character, motion = self._rest
        idle_pose = motion.at(t_ns / NS_PER_S, Aimed(np.full((1, 3), np.nan), np.ones(1)))
        skeleton = character.skeleton
        local = idle_pose.orientation_wxyz[0].copy()
        joints = forward(skeleton, idle_pose.root_m[0], local)
        at = skeleton.index("head")
        above: Vector = joints.orientation_wxyz[skeleton.parents[at]]
        local[at] = quat_multiply(quat_conjugate(above), head.orientation_wxyz)
        joints = forward(skeleton, idle_pose.root_m[0], local)
        eyes = [skeleton.index(name) for name in ("left_eye", "right_eye")]
        apart = head.position_m - joints.position_m[eyes].mean(axis=0)  # feet stay on the floor
        root = idle_pose.root_m[0] + apart * np.array([1.0, 0.0, 1.0])
        people = picture.people
        return replace(
            picture,
            cast=(*picture.cast, character),
            people=PosedPeople(
                np.concatenate([people.root_m, root[None]]),
                np.concatenate([people.orientation_wxyz, local[None]]),
                np.concatenate([people.morphs_01, np.zeros((1, len(MORPHS)))]),
            ),
        )


def with_chair(room: Room, picture: Picture) -> Room:
    """Return a room with a chair below the last person of a picture; as it is where it has a chair
    there.
    """
    if not room.props:  # flat stimuli, in no place
        return room
    character, people = picture.cast[-1], picture.people
    body = forward(character.skeleton, people.root_m[-1], people.orientation_wxyz[-1])
    left, right = (
        body.position_m[character.skeleton.index(f"{side}_upper_leg")] for side in ("left", "right")
    )
    across_m, hips_m = right - left, (left + right) / 2
    facing = np.array([across_m[2], 0.0, -across_m[0]]) / np.hypot(across_m[0], across_m[2])
    middle_m = hips_m + HIPS_BEHIND_MIDDLE_M * facing
    if any(_is_chair_at(middle_m, prop) for prop in room.props):
        return room
    top_m = cushion_top_m(character, body)
    seat_m = float(hips_m[1]) - FLESH_M if top_m is None else top_m
    at_m = (float(middle_m[0]), 0.0, float(middle_m[2]))
    yaw_deg = float(yaw_pitch_deg_of(facing)[0])
    return replace(room, props=(*room.props, *chair(OWN_CHAIR, at_m, yaw_deg, seat_m=seat_m)))


def _is_chair_at(middle_m: Vector, prop: Prop) -> bool:
    """Tell whether a thing is a chair around a place."""
    apart_m = prop.mesh.vertices_m.mean(axis=0) - middle_m
    return "chair" in prop.name and float(np.hypot(apart_m[0], apart_m[2])) < SAME_CHAIR_M


RESTING_JOINTS = (
    *("hips", "spine", "chest", "upper_chest", "neck", "head"),
    *(
        f"{side}_{name}"
        for side in ("left", "right")
        for name in ("upper_arm", "lower_arm", "hand", "upper_leg", "lower_leg", "foot", "toes")
    ),
)


def resting_joints(eye_height_m: float, posture: Posture | None = None) -> dict[str, Vector]:
    """Return where the joints of somebody at rest are who faces −z with the eyes above the origin.

    Each is (3,) in metres; the posture is as of `StandIn`.
    """
    head = Pose(np.array([0.0, eye_height_m, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    posture = posture or posture_of(eye_height_m)
    character, person = (_seated if posture == "seated" else _standing)(next(_candidates()), head)
    pose = PeopleMotion((person,)).at(0.0)
    skeleton = character.skeleton
    joints = forward(skeleton, pose.root_m[0], pose.orientation_wxyz[0])
    eyes = [skeleton.index(f"{side}_eye") for side in ("left", "right")]
    apart = joints.position_m[eyes].mean(axis=0) * np.array([1.0, 0.0, 1.0])
    return {n: joints.position_m[skeleton.index(n)] - apart for n in RESTING_JOINTS}


def posture_of(eye_height_m: float) -> Posture:
    """Return whether somebody with eyes at that height above the floor sits or stands."""
    return "seated" if eye_height_m <= MAX_SEATED_EYE_M else "standing"


def _facing(head: Pose) -> Vector:
    return turned(head.orientation_wxyz, np.array([0.0, 0.0, -1.0]))


def _standing(character: Character, head: Pose) -> tuple[Character, Person]:
    """Return a person who stands with the eyes at the height of the head's."""
    stature_m = float(np.clip(head.position_m[1] / EYES_OF_STATURE, MIN_M, TALLEST_M))
    sized = scale_to_stature(character, round(stature_m, 3))
    yaw_deg, _ = yaw_pitch_deg_of(_facing(head))
    return sized, Person(build_of(sized), Idle(), 1, (0.0, 0.0, 0.0), float(yaw_deg))


def _seated(character: Character, head: Pose) -> tuple[Character, Person]:
    """Return a person of usual size who sits with the eyes there; of another where no seat fits."""
    sit, eyes_m = Sit(hands="thighs"), np.asarray(head.position_m, np.float64)
    try:
        person = seated_under_eyes(
            build_of(character), eyes_m, facing=_facing(head), seed=1, sit=sit, floor_m=0.0
        )
    except MotionError:  # a child, or somebody on a high stool
        usual_m = float(eyes_of(build_of(character), sit, 1)[1])
        size = float(np.clip(eyes_m[1] / usual_m, 0.4, 1.4))
        character = scale_to_stature(character, round(size * character.stature_m, 3))
        seat_m = float(np.clip(size * sit.seat_m, MIN_SEAT_M, MAX_SEAT_M))
        fitting = replace(sit, seat_m=seat_m)
        yaw_deg, _ = yaw_pitch_deg_of(_facing(head))
        person = Person(build_of(character), fitting, 1, (0.0, 0.0, 0.0), float(yaw_deg))
    return character, person


def somebody_else(picture: Picture) -> Character:
    """Return a character who plays no other part in a picture."""
    playing = {character.name for character in picture.cast}
    return next((c for c in _candidates() if c.name not in playing), next(_candidates()))


def _candidates() -> Iterator[Character]:
    """Yield who may stand in: men of the cast; where it has none, who come with Visavis."""
    if numbered_people("male"):
        yield from (default_casting(part) for part in PARTS_TRIED)
    else:
        yield from (person for person in reversed(load_cast()) if person.gender == "male")
