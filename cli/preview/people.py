"""A close-up of everybody in the cast, from conversation distance."""

from collections.abc import Sequence

import numpy as np
from PIL import Image

from cli.preview.pictures import contact_sheet, face_camera, labelled
from lab.geometry import Vector, unit
from stage.stills import Stills
from stimuli.characters.cast import load_cast
from stimuli.characters.character import Character
from stimuli.dressing.casting import build_of
from stimuli.gaze.turning import Aimed
from stimuli.motion.kinds import Idle
from stimuli.motion.people import PeopleMotion, Person
from stimuli.motion.skeleton import forward
from stimuli.picture import Picture
from stimuli.rooms.portrait import portrait_studio

TURNED_DEG = 32.0
COLUMNS = 6


def people_sheet(size_px: tuple[int, int], people: Sequence[Character] = ()) -> Image.Image:
    """Return faces from the front and turned, each `size_px`, with their names: of the cast when
    nobody else is given.
    """
    tiles = []
    with Stills() as stills:
        for character in people or load_cast():
            for yaw_deg in (0.0, TURNED_DEG):
                picture, eyes_m = portrait(character, yaw_deg)
                camera = face_camera(eyes_m, yaw_deg, size_px[0] / size_px[1])
                image = stills.image(picture, camera, size_px)
                tiles.append(labelled(image, f"{character.name}, {character.stature_m:.2f} m"))
    return contact_sheet(tiles, "everybody at 1.1 m, looking at the camera", COLUMNS)


def portrait(character: Character, yaw_deg: float) -> tuple[Picture, Vector]:
    """Return a character who stands and looks at a camera `yaw_deg` to the side of its nose, and
    the middle (3,) of its eyes.
    """
    person = Person(build_of(character), Idle(), 7, (0.0, 0.0, 0.0), 180.0)
    motion = PeopleMotion((person,))
    angle = np.radians(yaw_deg)
    towards = unit(np.array([np.sin(angle), 0.04, np.cos(angle)]))
    people = motion.at(1.0, Aimed(towards[None], np.ones(1)))
    placed = forward(character.skeleton, people.root_m[0], people.orientation_wxyz[0])
    sides = [character.skeleton.index(f"{side}_eye") for side in ("left", "right")]
    eyes_m = placed.position_m[sides].mean(axis=0)
    return Picture(0, portrait_studio(), (character,), people), eyes_m
