"""A few people in a room as a picture, and as agents whose heads are where they are drawn."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Character
from visavis.stimuli.dressing.casting import Casting, build_of, default_casting
from visavis.stimuli.dressing.office import HEAD_RADIUS_M, gaze_of, look_of
from visavis.stimuli.dressing.picture_of import named_function
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.faces import face_of
from visavis.stimuli.motion.kinds import Idle, Sit
from visavis.stimuli.motion.people import HeldHeads, PeopleMotion, Person
from visavis.stimuli.moving_heads import MovingHeads
from visavis.stimuli.picture import Picture, Room
from visavis.stimuli.rooms.plain import plain_room
from visavis.stimuli.scene import Agent, SceneFrame
from visavis.stimuli.scenes.gathering import GatheringScene, Standing

AT_REST: Final = (Idle, Sit)
"""A gaze that does not move the head: these heads stay exactly on their areas of interest."""


@dataclass(frozen=True, eq=False)
class _Set:
    cast: tuple[Character, ...]
    motion: PeopleMotion


def _room(people: tuple[Standing, ...], room_by: str) -> Room:
    if room_by:
        room: Room = named_function(room_by, "makes this scene's room")()
        return room
    return plain_room(
        tuple((p.x_m, p.z_m, p.yaw_deg, p.does.seat_m) for p in people if isinstance(p.does, Sit))
    )


def _motion(people: tuple[Standing, ...], casting: Casting) -> PeopleMotion:
    return PeopleMotion(
        tuple(
            Person(
                build_of(casting(p.character)),
                p.does,
                p.seed,
                (p.x_m, 0.0, p.z_m),
                p.yaw_deg,
                face_of(casting(p.character), p.face),
            )
            for p in people
        )
    )


@lru_cache(maxsize=64)
def agents_of(
    people: tuple[Standing, ...], casting: Casting = default_casting
) -> tuple[Agent, ...]:
    """Return everybody as agents, with heads where they are at the onset."""
    n = len(people)
    pose = _motion(people, casting).at(0.0, Aimed(np.full((n, 3), np.nan), np.ones(n)))
    agents = []
    for i, person in enumerate(people):
        character = casting(person.character)
        head, eyes, facing = look_of(character, pose.root_m[i], pose.orientation_wxyz[i])
        agents.append(
            Agent(
                f"agent_{i + 1:02d}",
                person.character,
                person.place,
                head,
                HEAD_RADIUS_M,
                facing,
                eyes,
                character.has_gaze,
                character.has_lids,
            )
        )
    return tuple(agents)


@lru_cache(maxsize=16)
def _set_of(people: tuple[Standing, ...], casting: Casting) -> _Set:
    agents = agents_of(people, casting)
    rests = np.array([isinstance(p.does, AT_REST) for p in people]).reshape(-1, 1)
    eyes = np.where(rests, np.array([a.eye_centre_m for a in agents]).reshape(-1, 3), np.nan)
    facing = np.where(rests, np.array([a.facing for a in agents]).reshape(-1, 3), np.nan)
    motion = replace(_motion(people, casting), held_heads=HeldHeads(eyes, facing))
    return _Set(tuple(casting(p.character) for p in people), motion)


def heads_of_gathering(scene: GatheringScene) -> MovingHeads | None:
    """Return how the heads of a gathering move; None where everybody stays in their place."""
    if all(isinstance(person.does, AT_REST) for person in scene.people):
        return None
    return _heads_of(scene.people, scene.start_ns, default_casting)


@lru_cache(maxsize=16)
def _heads_of(people: tuple[Standing, ...], start_ns: int, casting: Casting) -> MovingHeads:
    stage_set, agents = _set_of(people, casting), agents_of(people, casting)
    # The gaze of people in a gathering turns their eyes, never their heads.
    n = len(people)
    ahead = Aimed(np.full((n, 3), np.nan), np.ones(n))

    def pose(t_ns: int) -> Vector:
        people_pose = stage_set.motion.at(max(0.0, (t_ns - start_ns) * 1e-9), ahead)
        return np.array(
            [
                agents[i].head_centre_m
                if isinstance(person.does, AT_REST)
                else look_of(
                    stage_set.cast[i], people_pose.root_m[i], people_pose.orientation_wxyz[i]
                )[0]
                for i, person in enumerate(people)
            ]
        )

    return MovingHeads(pose)


def gathering_picture(frame: SceneFrame, *, casting: Casting = default_casting) -> Picture:
    """Return what a frame of a gathering looks like; eyes point along `frame.gaze_direction`."""
    scene = frame.scene
    people = scene.people if isinstance(scene, GatheringScene) else ()
    start_ns = scene.start_ns if isinstance(scene, GatheringScene) else 0
    stage_set = _set_of(people, casting)
    t_s = max(0.0, (frame.t_ns - start_ns) * 1e-9)
    return Picture(
        t_ns=frame.t_ns,
        room=_room(people, scene.room_by if isinstance(scene, GatheringScene) else ""),
        cast=stage_set.cast,
        people=stage_set.motion.at(t_s, gaze_of(frame)),
        brightness_01=scene.brightness_01,
        mark_m=scene.mark_m,
    )
