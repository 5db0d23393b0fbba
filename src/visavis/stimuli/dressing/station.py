"""The station of the crowd study as a picture: people posed exactly as contact is computed."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.characters.outfits import in_other_clothes
from visavis.stimuli.contact.idle import kinds_of, people_of, telephone_sides
from visavis.stimuli.dressing.casting import Casting, build_of, default_casting
from visavis.stimuli.dressing.telephone import holding_telephone
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.picture import Picture, PosedPeople
from visavis.stimuli.rooms.station import board_face, station
from visavis.stimuli.scenes.station_crowd import CHARACTERS, Crowd, CrowdFrame, CrowdScene


@dataclass(frozen=True, eq=False)
class _Set:
    cast: tuple[Character, ...]
    motion: PeopleMotion


@lru_cache(maxsize=16)
def _set_of(crowd: Crowd, casting: Casting) -> _Set:
    bare = [
        in_other_clothes(casting(CHARACTERS[c]), outfit)
        for c, outfit in zip(crowd.character.tolist(), crowd.outfit.tolist(), strict=True)
    ]
    rows = people_of(crowd)
    people = tuple(
        Person(
            build_of(character), kind, int(seed), (float(x), 0.0, float(z)), float(np.degrees(yaw))
        )
        for character, kind, seed, (x, z), yaw in zip(
            bare, kinds_of(rows), crowd.seed, crowd.position_m, crowd.yaw_rad, strict=True
        )
    )
    cast = tuple(
        character if side is None else holding_telephone(character, side)
        for character, side in zip(bare, telephone_sides(rows), strict=True)
    )
    return _Set(cast, PeopleMotion(people))


def station_picture(frame: CrowdFrame, *, casting: Casting = default_casting) -> Picture:
    """Return what a frame of the crowd study looks like."""
    crowd = frame.scene.crowd if isinstance(frame.scene, CrowdScene) else None
    board = board_face(frame.track)
    if crowd is None or not len(crowd):
        nobody = PosedPeople(np.zeros((0, 3)), np.zeros((0, 55, 4)), np.zeros((0, len(MORPHS))))
        cast: tuple[Character, ...] = ()
        people = nobody
    else:
        stage_set = _set_of(crowd, casting)
        cast, people = stage_set.cast, stage_set.motion.at(frame.crowd_t_ns * 1e-9)
    return Picture(
        t_ns=frame.t_ns,
        room=station(),
        cast=cast,
        people=people,
        moving=(board,),
        brightness_01=frame.scene.brightness_01,
        mark_m=frame.scene.mark_m,
    )
