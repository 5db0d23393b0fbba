"""The station of the crowd study as a picture: people posed exactly as contact is computed."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lab.geometry import Vector
from stimuli.characters.character import MORPHS, Character
from stimuli.contact.body import BODY_JOINTS
from stimuli.contact.idle import crowd_turns, people_of, telephone_sides
from stimuli.dressing.casting import Casting, build_of, default_casting
from stimuli.dressing.telephone import holding_telephone
from stimuli.motion.kinds import Idle
from stimuli.motion.people import PeopleMotion, Person
from stimuli.motion.posture import B_STAND
from stimuli.picture import Picture, PosedPeople
from stimuli.rooms.station import board_face, station
from stimuli.scenes.station_crowd import CHARACTERS, Crowd, CrowdFrame, CrowdScene


@dataclass(frozen=True, eq=False)
class _Set:
    cast: tuple[Character, ...]
    people: Vector
    hips_m: Vector
    relaxed: PeopleMotion
    body: tuple[int, ...]


@lru_cache(maxsize=16)
def _set_of(crowd: Crowd, casting: Casting) -> _Set:
    bare = [casting(CHARACTERS[c]) for c in crowd.character.tolist()]
    people = tuple(
        Person(build_of(character), Idle(arms="hanging"), int(seed) % 2**31)
        for character, seed in zip(bare, crowd.seed, strict=True)
    )
    rows = people_of(crowd)
    sides = telephone_sides(rows)
    cast = tuple(
        character if side is None else holding_telephone(character, side)
        for character, side in zip(bare, sides, strict=True)
    )
    index = cast[0].skeleton.index_of
    return _Set(
        cast=cast,
        people=rows,
        hips_m=np.array([build_of(c).lengths_m[B_STAND] for c in bare]),
        relaxed=PeopleMotion(people),
        body=tuple(index[name] for name in BODY_JOINTS),
    )


def _posed(dressed: _Set, t_s: float) -> PosedPeople:
    """Return everybody with the trunk and limbs of the contact rule; fingers and face on top."""
    relaxed = dressed.relaxed.at(t_s)
    root, turns = crowd_turns(dressed.people, t_s)
    orientation = relaxed.orientation_wxyz.copy()
    orientation[:, dressed.body] = turns
    hips = np.stack([root[:, 0], dressed.hips_m, root[:, 2]], axis=1)
    return PosedPeople(hips, orientation, relaxed.morphs_01)


def station_picture(frame: CrowdFrame, *, casting: Casting = default_casting) -> Picture:
    """Return what a frame of the crowd study looks like."""
    crowd = frame.scene.crowd if isinstance(frame.scene, CrowdScene) else None
    board = board_face(frame.track)
    if crowd is None or not len(crowd):
        nobody = PosedPeople(np.zeros((0, 3)), np.zeros((0, 55, 4)), np.zeros((0, len(MORPHS))))
        cast: tuple[Character, ...] = ()
        people = nobody
    else:
        dressed = _set_of(crowd, casting)
        cast, people = dressed.cast, _posed(dressed, frame.crowd_t_ns * 1e-9)
    return Picture(
        t_ns=frame.t_ns,
        room=station(),
        cast=cast,
        people=people,
        moving=(board,),
        brightness_01=frame.scene.brightness_01,
        mark_m=frame.scene.mark_m,
    )
