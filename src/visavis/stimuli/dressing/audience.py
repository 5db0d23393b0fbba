"""The audience of the stare study as a picture: seated people whose eyes are the study's."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Character
from visavis.stimuli.dressing.casting import Casting, build_of, default_casting
from visavis.stimuli.dressing.sitting import cushion_top_m
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.build import Build
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.kinds import Idle, Sit
from visavis.stimuli.motion.people import HeldHeads, PeopleMotion, Person
from visavis.stimuli.motion.seating import seated_under_eyes
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Picture, Room
from visavis.stimuli.rooms.audience_room import (
    HIP_BEHIND_EYES_M,
    HIPS_BEHIND_MIDDLE_M,
    Chair,
    audience_room,
    room_before_m,
    step_height_m,
)
from visavis.stimuli.scene import Agent, SceneFrame
from visavis.stimuli.scenes import audience

HABITS = 12
"""Number of sitting habits tried to find one that keeps the feet on the step."""
TUCKED_01 = (0.0, 0.3, 0.6, 1.0)
"""How far feet are drawn back, tried one after the other."""
ATTENTIVE = Sit(lively=0.25)
"""Listeners hardly move; breathing is as deep as usual."""
MAX_ARMS_ASIDE_M = 0.24
"""Largest sideways distance of elbows and wrists from the seat's middle, to spare neighbours."""
TOE_M = 0.07
MEN_TRIED = 24
FACING_OF_SPEAKER = np.array([0.0, 1.2, -2.5]) - audience.SPEAKER_EYE_M * np.array([1.0, 0.74, 1.0])


@dataclass(frozen=True, eq=False)
class _Set:
    room: Room
    cast: tuple[Character, ...]
    motion: PeopleMotion


@lru_cache(maxsize=256)
def _set_of(characters: tuple[str, ...], casting: Casting) -> _Set:
    agents = audience.audience_scene(characters).agents
    cast = tuple(casting(agent.character) for agent in agents)
    people: list[Person] = []
    chairs: dict[str, Chair] = {}
    for i, agent in enumerate(agents):
        person, chair = _place_sitter(i, agent.character, casting)
        people.append(person)
        if chair is not None:
            chairs[agent.place] = chair
    speaker = _speaker(cast, casting)
    feet = audience.SPEAKER_EYE_M * np.array([1.0, 0.0, 1.0])
    heading = float(np.degrees(np.arctan2(-FACING_OF_SPEAKER[0], -FACING_OF_SPEAKER[2])))
    people.append(
        Person(build_of(speaker), Idle(), 99, (float(feet[0]), 0.0, float(feet[2])), heading)
    )
    eyes = np.array([*(a.eye_centre_m for a in agents), np.full(3, np.nan)])
    facing = np.array([*(a.facing for a in agents), np.full(3, np.nan)])
    return _Set(
        audience_room(chairs),
        (*cast, speaker),
        PeopleMotion(tuple(people), HeldHeads(eyes, facing)),
    )


@lru_cache(maxsize=1024)
def _place_sitter(row: int, name: str, casting: Casting) -> tuple[Person, Chair | None]:
    """Return who sits at a place, and their chair; None of somebody who does not sit.

    Audiences of one study are the same people in other places: each is seated there once.
    """
    agent, character = audience.agent_at(row, name), casting(name)
    floor = step_height_m(agent.eye_centre_m - HIP_BEHIND_EYES_M * agent.facing)
    try:
        person = _sitter(build_of(character), agent, row, floor)
    except MotionError as error:
        raise MotionError(
            f"{character.name} cannot sit at {agent.place}, where eyes of the audience are: "
            f"{error}. Leave them out of `cast`"
        ) from error
    if not isinstance(person.does, Sit):
        return person, None
    hips_m = _joints_m([person], "upper_leg")[0].mean(axis=0)
    behind_m = float((agent.eye_centre_m - hips_m) @ agent.facing)
    top_m = floor + person.does.seat_m + _sunk_m(character, person)
    return person, Chair(top_m, behind_m - HIPS_BEHIND_MIDDLE_M)


def _speaker(listeners: tuple[Character, ...], casting: Casting) -> Character:
    """Return a man for the speaker who is not among the listeners: of another body if there is one,
    else in other clothes, else one of them.
    """
    men = [casting(f"male_{number:02d}") for number in range(1, MEN_TRIED + 1)]
    bodies = [listener.skeleton for listener in listeners]
    strangers = [man for man in men if man.skeleton not in bodies]
    return next(iter([*strangers, *(man for man in men if man not in listeners), *men]))


def _sitter(build: Build, agent: Agent, seed: int, floor_m: float) -> Person:
    """Return a sitter of the habits that keep arms within the seat and the feet best on their step,
    drawn back as little as that takes.
    """
    habits = [
        seated_under_eyes(
            build,
            agent.eye_centre_m,
            facing=agent.facing,
            seed=seed + 100 * habit,
            sit=ATTENTIVE,
            floor_m=floor_m,
        )
        for habit in range(HABITS)
    ]
    across = np.cross(agent.facing, [0.0, 1.0, 0.0])
    arms_m = np.concatenate([_joints_m(habits, name) for name in ("lower_arm", "hand")], axis=1)
    aside_m = np.abs((arms_m - agent.eye_centre_m) @ across).max(axis=1)
    limit_m = max(MAX_ARMS_ASIDE_M, float(aside_m.min()))
    habits = [one for one, m in zip(habits, aside_m, strict=True) if m <= limit_m]
    ahead = TOE_M * agent.facing * np.array([1.0, 0.0, 1.0])
    for tucked_01 in TUCKED_01:
        sitters = [_with_tucked_feet(person, tucked_01) for person in habits]
        toes_m = _joints_m(sitters, "toes") + ahead
        room_m = [min(room_before_m(toe, floor_m) for toe in toes) for toes in toes_m]
        best = int(np.argmax(room_m))
        if room_m[best] >= 0.0:
            break
    return sitters[best]


def _with_tucked_feet(person: Person, tucked_01: float) -> Person:
    sit = person.does
    return (
        replace(person, does=replace(sit, tucked_01=tucked_01)) if isinstance(sit, Sit) else person
    )


def _joints_m(people: Sequence[Person], name: str) -> Vector:
    """Return where people's left and right joints (n, 2, 3) of a name are, kept still."""
    pose = PeopleMotion(tuple(people)).at(0.0)
    joints_m = []
    for person, root_m, turns in zip(people, pose.root_m, pose.orientation_wxyz, strict=True):
        skeleton = person.build.skeleton
        rows = [skeleton.index(f"{side}_{name}") for side in ("left", "right")]
        joints_m.append(forward(skeleton, root_m, turns).position_m[rows])
    return np.array(joints_m)


def _sunk_m(character: Character, person: Person) -> float:
    """Return how far above the height of their seat a cushion is that somebody sinks into; 0 of a
    figure without flesh there.
    """
    pose = PeopleMotion((person,)).at(0.0)
    body = forward(character.skeleton, pose.root_m[0], pose.orientation_wxyz[0])
    top_m = cushion_top_m(character, body)
    if top_m is None or not isinstance(person.does, Sit):
        return 0.0
    return top_m - person.place_m[1] - person.does.seat_m


def audience_picture(frame: SceneFrame, *, casting: Casting = default_casting) -> Picture:
    """Return what a frame of the stare study looks like.

    Both eyes meet where the study has them look, within what fixating eyes do; heads stay where
    the study has them but for a few millimetres of sway.
    """
    stage_set = _set_of(tuple(a.character for a in frame.scene.agents), casting)
    to_audience = np.array([-0.4, 1.3, -2.6]) - audience.SPEAKER_EYE_M
    distance_m = np.full(len(frame.scene.agents), np.nan)
    if frame.gaze_distance_m is not None:
        distance_m = frame.gaze_distance_m
    between_eyes = [a.eye_centre_m for a in frame.scene.agents]
    gaze = Aimed(
        np.concatenate([frame.gaze_direction, [to_audience / np.linalg.norm(to_audience)]]),
        np.concatenate([frame.eye_openness_01, [1.0]]),
        np.append(distance_m, np.linalg.norm(to_audience)),
        np.array([*between_eyes, audience.SPEAKER_EYE_M]),
        fixates=True,
    )
    return Picture(
        t_ns=frame.t_ns,
        room=stage_set.room,
        cast=stage_set.cast,
        people=stage_set.motion.at(frame.t_ns * 1e-9, gaze),
        brightness_01=frame.scene.brightness_01,
        mark_m=frame.scene.mark_m,
    )
