"""Somebody who stands where the participant did, so that films from outside show them."""

from dataclasses import replace
from typing import Any

import numpy as np

from visavis.cli.recorded_trial import RecordedTrial
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Pose, Vector, quat_conjugate, quat_multiply, yaw_pitch_deg_of
from visavis.lab.geometry import rotate as turned
from visavis.protocol.plan.shown_scene import of_part
from visavis.stage.own_body import OwnBody
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.characters.sizing import MIN_M, TALLEST_M, scale_to_stature
from visavis.stimuli.dressing.casting import build_of, default_casting
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.kinds import Idle
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Picture, PosedPeople

PARTS_TRIED = tuple(f"male_{number:02d}" for number in range(12, 0, -1))
EYES_OF_STATURE = 0.936
"""Height of the eyes as a share of stature (Winter 2009)."""
MAX_APART_M = 0.5
"""A body whose head is farther from the headset is not where the participant was."""
FRESH_NS = NS_PER_S // 5


class StandIn:
    """Add a person to pictures where the participant was.

    The pose is the body tracker's. Without a tracker, or where its head is far from the one that
    the headset measured, the person stands at rest under the measured head.
    """

    def __init__(self, trial: RecordedTrial) -> None:
        self._trial = trial
        names = trial.recording.stream_names
        self._body: dict[str, Any] | None = None
        self._own: OwnBody | None = None
        self._idle: tuple[Character, PeopleMotion] | None = None
        schema = trial.recording.stream_schema("body") if "body" in names else None
        if schema is not None:
            field = next(f for f in schema.fields if f.name == "position_m")
            self._segments = tuple(field.description.partition(": ")[2].split())
            self._body = of_part(trial.recording, "body", trial.part)
            self._dtype = schema.dtype

    def in_picture(self, picture: Picture, t_ns: int, head: Pose) -> Picture:
        """Return a picture with the participant in it."""
        row = self._row_at(t_ns)
        if row is not None and self._is_under(head, row):
            if self._own is None:
                self._own = OwnBody(_not_in(picture), self._segments, from_outside=True)
            self._own.take_row(row)
            picture_with_body = self._own.add_to(picture, head)
            if picture_with_body is not picture:
                return picture_with_body
        return self._standing(picture, t_ns, head)

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

    def _standing(self, picture: Picture, t_ns: int, head: Pose) -> Picture:
        facing = turned(head.orientation_wxyz, np.array([0.0, 0.0, -1.0]))
        if self._idle is None:
            yaw_deg, _ = yaw_pitch_deg_of(facing)
            stature_m = float(np.clip(head.position_m[1] / EYES_OF_STATURE, MIN_M, TALLEST_M))
            character = scale_to_stature(_not_in(picture), round(stature_m, 3))
            person = Person(build_of(character), Idle(), 1, (0.0, 0.0, 0.0), float(yaw_deg))
            self._idle = character, PeopleMotion((person,))
        character, motion = self._idle
        idle_pose = motion.at(t_ns / NS_PER_S, Aimed(np.full((1, 3), np.nan), np.ones(1)))
        skeleton = character.skeleton
        local = idle_pose.orientation_wxyz[0].copy()
        joints = forward(skeleton, idle_pose.root_m[0], local)
        at = skeleton.index("head")
        above: Vector = joints.orientation_wxyz[skeleton.parents[at]]
        local[at] = quat_multiply(quat_conjugate(above), head.orientation_wxyz)
        joints = forward(skeleton, idle_pose.root_m[0], local)
        eyes = [skeleton.index(name) for name in ("left_eye", "right_eye")]
        apart = head.position_m - joints.position_m[eyes].mean(axis=0)
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


def _not_in(picture: Picture) -> Character:
    """Return a character who plays no other part in a picture."""
    playing = {character.name for character in picture.cast}
    candidates = (default_casting(part) for part in PARTS_TRIED)
    first = default_casting(PARTS_TRIED[0])
    return next((c for c in candidates if c.name not in playing), first)
