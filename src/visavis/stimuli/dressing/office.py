"""The office of the waving study as a picture: clerks at desks, customers in line (one of them is
the participant), and bystanders in between.

Everything is in coordinates of the tracked room, in which the participant stands at the origin.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.chance import generator
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.dressing.casting import Casting, build_of, default_casting
from visavis.stimuli.dressing.telephone import Use, holding_telephone
from visavis.stimuli.gaze.behaviour import EyeBehaviour
from visavis.stimuli.gaze.blinks import draw_blinks
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.kinds import Idle, Kind, Phone, Recorded, Sit, Talk, Text
from visavis.stimuli.motion.people import Doing, PeopleMotion, Person
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.motion.warping.control import warped_turns
from visavis.stimuli.motion.warping.track import WarpTrack
from visavis.stimuli.picture import Picture, PosedPeople, Room
from visavis.stimuli.rooms import furniture
from visavis.stimuli.rooms.office import office
from visavis.stimuli.scene import Agent, SceneFrame
from visavis.stimuli.scenes import office as places
from visavis.stimuli.scenes.office import OfficeFrame, OfficeScene, Waving

PARTS: Final[dict[str, str]] = {
    "clerk_left": "chloe",
    "clerk_middle": "henrik",
    "clerk_right": "elif",
    "bystander_left": "gabriel",
    "bystander_middle": "freya",
    "bystander_right": "karim",
    "place_1": "bela",
    "place_2": "ike",
    "place_3": "anna",
    "place_4": "jun",
    "place_5": "dai",
}
"""Which character plays whom; the customer in the participant's place is left out."""
BUSY: Final[dict[str, Kind]] = {
    "bystander_left": Talk(size=0.5, voice_01=0.4),
    "bystander_middle": Text(hand="right"),
    "bystander_right": Phone(hand="right"),
}
HEAD_RADIUS_M: Final = 0.12
SCREEN_FROM_CLERK_M: Final = (-0.52, 0.95, 0.57)
NOBODY: Final = PosedPeople(np.zeros((0, 3)), np.zeros((0, 55, 4)), np.zeros((0, len(MORPHS))))
WORKING: Final = Sit(seat_m=places.SEAT_M, hands="thighs", lean_back_deg=2.0)


def roles_of(participant_place: str) -> tuple[str, ...]:
    """Return everybody in the order of agents and cast: clerks, bystanders, other customers."""
    return tuple(role for role in PARTS if role != participant_place)


@lru_cache(maxsize=4)
def room_from(participant_place: str) -> Room:
    """Return the office as it stands round a participant in this place; the same object."""
    room, by = office(), places.shift_m(participant_place)
    props = tuple(furniture.shift_prop(p, by) for p in room.props)
    lights = tuple(
        light if light.position_m is None else replace(light, position_m=light.position_m + by)
        for light in room.lights
    )
    return replace(room, props=props, lights=lights)


@dataclass(frozen=True, eq=False)
class _Set:
    cast: tuple[Character, ...]
    motion: PeopleMotion


def person_of(
    role: str,
    participant_place: str,
    waving: Waving | None,
    seed: int,
    casting: Casting = default_casting,
) -> Person:
    """Return a person's activity from the scene's onset on."""
    where = places.place(role)
    build = build_of(casting(PARTS[role]))
    own = seed * 31 + tuple(PARTS).index(role)
    at = where.floor_m + places.shift_m(participant_place)
    point = (float(at[0]), 0.0, float(at[2]))
    if waving is not None and role == waving.clerk:
        does = (
            Doing(WORKING),
            Doing(
                Recorded(waving.clip),
                waving.start_s - waving.fade_s,
                waving.fade_s,
                heading_deg=waving.heading_deg,
            ),
            Doing(WORKING, waving.end_s, waving.fade_s, heading_deg=where.yaw_deg),
        )
        return Person(build, does, own, point, where.yaw_deg)
    kind = WORKING if role.startswith("clerk") else BUSY.get(role, Idle())
    return Person(build, kind, own, point, where.yaw_deg)


@lru_cache(maxsize=8)
def _set_of(participant_place: str, waving: Waving | None, seed: int, casting: Casting) -> _Set:
    roles = roles_of(participant_place)
    people = tuple(person_of(role, participant_place, waving, seed, casting) for role in roles)
    return _Set(tuple(_holding(role, casting(PARTS[role])) for role in roles), PeopleMotion(people))


def _holding(role: str, character: Character) -> Character:
    """Return a character with a telephone in the hand for people who phone or type."""
    kind = BUSY.get(role)
    if isinstance(kind, Phone | Text) and kind.hand != "any":
        use: Use = "listening" if isinstance(kind, Phone) else "typing"
        return holding_telephone(character, kind.hand, use)
    return character


def look_of(character: Character, root_m: Vector, turns: Vector) -> tuple[Vector, Vector, Vector]:
    """Return head centre (3,), middle of the eyes (3,) and unit front of the head (3,)."""
    skeleton = character.skeleton
    body = forward(skeleton, root_m, turns)
    eyes = body.position_m[[skeleton.index("left_eye"), skeleton.index("right_eye")]].mean(axis=0)
    facing = rotate(body.orientation_wxyz[skeleton.index("head")], np.array([0.0, 0.0, -1.0]))
    return eyes - 0.09 * facing, eyes, facing


@lru_cache(maxsize=128)
def agents_of(
    participant_place: str, waving: Waving | None, seed: int, at_s: float
) -> tuple[Agent, ...]:
    """Return everybody as agents, with heads where they are `at_s` after the onset."""
    stage_set = _set_of(participant_place, waving, seed, default_casting)
    n = len(stage_set.cast)
    pose = stage_set.motion.at(
        at_s,
        Aimed(np.full((n, 3), np.nan), np.ones(n)),
        turn_changes=_warp_of_person(participant_place, waving, at_s),
    )
    agents = []
    for i, role in enumerate(roles_of(participant_place)):
        head, eyes, facing = look_of(stage_set.cast[i], pose.root_m[i], pose.orientation_wxyz[i])
        agents.append(Agent(role, PARTS[role], role, head, HEAD_RADIUS_M, facing, eyes))
    return tuple(agents)


def office_scene(participant_place: str, waving: Waving | None, seed: int) -> OfficeScene:
    """Return the office seen from a place; heads are where they are in the middle of the wave."""
    middle_s = 0.0 if waving is None else (waving.start_s + waving.end_s) / 2
    return OfficeScene(
        name=f"office_{participant_place}",
        agents=agents_of(participant_place, waving, seed, middle_s),
        participant_place=participant_place,
        waving=waving,
        seed=seed,
    )


def office_eyes(
    scene: OfficeScene, target_place: str, seed: int, duration_s: float, turn_s: float
) -> EyeBehaviour:
    """Return the behaviour of all eyes; times count from the onset. Clerks look at their screens,
    others ahead; the waving clerk turns the eyes to the person waved at `turn_s` after the onset:
    to the participant's current place, or to the eyes of a customer. `seed` draws the blinks.
    """
    by = places.shift_m(scene.participant_place)
    blinks = draw_blinks(generator(seed, 1), len(scene.agents), duration_s)
    eyes = EyeBehaviour.of_scene(scene, target_m=np.zeros(3), blinks=blinks)
    targets = eyes.targets_m.copy()
    for i, agent in enumerate(scene.agents):
        targets[:, i] = agent.eye_centre_m + 3.0 * agent.facing
        if agent.place in (c.name for c in places.CLERKS):
            targets[:, i] = places.place(agent.place).floor_m + by + np.array(SCREEN_FROM_CLERK_M)
    who = scene.waver
    if who is None:
        return replace(eyes, targets_m=targets)
    follows, turn_ns = eyes.follows_observer.copy(), eyes.turn_ns.copy()
    turn_ns[who] = round(turn_s * NS_PER_S)
    if target_place == scene.participant_place:
        follows[1, who] = True
    else:
        target = next(a for a in scene.agents if a.place == target_place)
        targets[1, who] = target.eye_centre_m
    return replace(eyes, targets_m=targets, follows_observer=follows, turn_ns=turn_ns)


def gaze_of(frame: SceneFrame) -> Aimed:
    """Return the gaze of a frame's agents, whose eyes meet where they look and never rest."""
    between_eyes = np.array([a.eye_centre_m for a in frame.scene.agents]).reshape(-1, 3)
    return Aimed(
        frame.gaze_direction,
        frame.eye_openness_01,
        frame.gaze_distance_m,
        between_eyes,
        fixates=True,
    )


def _warp_of_person(
    participant_place: str, waving: Waving | None, t_s: float, warp: WarpTrack | None = None
) -> dict[int, Callable[[Vector], Vector]]:
    """Return, by person, how the wave's warp changes joint turns at a time."""
    if waving is None or (track := warp or waving.warp) is None:
        return {}
    skeleton, units, omega = waving.clip.skeleton, track.units, track.at(t_s)
    who = roles_of(participant_place).index(waving.clerk)
    return {who: lambda turns: warped_turns(skeleton, units, turns, omega)}


def pose_of_waver(
    waving: Waving, t_s: float, warp: WarpTrack | None = None
) -> tuple[Vector, Vector]:
    """Return root (3,) and turns (55, 4) of the waving person, in the office's coordinates.

    As drawn, but for where the eyes point. `warp` stands in place of the wave's own.
    """
    root_m, turns = unwarped_pose_of_waver(waving, t_s)
    track = warp or waving.warp
    if track is not None:
        turns = warped_turns(waving.clip.skeleton, track.units, turns, track.at(t_s))
    return root_m, turns


def unwarped_pose_of_waver(waving: Waving, t_s: float) -> tuple[Vector, Vector]:
    """Return what `pose_of_waver` does, without what is added to the wave."""
    alone = _waver(waving).at(t_s, Aimed(np.full((1, 3), np.nan), np.ones(1)))
    return alone.root_m[0], alone.orientation_wxyz[0]


@lru_cache(maxsize=32)
def _waver(waving: Waving) -> PeopleMotion:
    return PeopleMotion((person_of(waving.clerk, "place_3", waving, 0),))


def office_picture(frame: SceneFrame, *, casting: Casting = default_casting) -> Picture:
    """Return what a frame of the waving study looks like; eyes point along `gaze_direction`."""
    scene = frame.scene
    if not isinstance(scene, OfficeScene):
        return Picture(
            frame.t_ns,
            room_from("place_3"),
            (),
            NOBODY,
            brightness_01=scene.brightness_01,
            mark_m=scene.mark_m,
        )
    start_ns = frame.start_ns if isinstance(frame, OfficeFrame) else 0
    t_s = max(0.0, (frame.t_ns - start_ns) * 1e-9)
    stage_set = _set_of(scene.participant_place, scene.waving, scene.seed, casting)
    warp = frame.warp if isinstance(frame, OfficeFrame) else None
    turn_changes = _warp_of_person(scene.participant_place, scene.waving, t_s, warp)
    return Picture(
        t_ns=frame.t_ns,
        room=room_from(scene.participant_place),
        cast=stage_set.cast,
        people=stage_set.motion.at(t_s, gaze_of(frame), turn_changes=turn_changes),
        brightness_01=scene.brightness_01,
        mark_m=scene.mark_m,
    )
