"""A close-up of everybody in the cast, from conversation distance."""

from collections.abc import Sequence

import numpy as np
from PIL import Image

from visavis.cli.preview.pictures import (
    FACE_AWAY_M,
    FACE_TANGENT,
    add_label,
    contact_sheet,
    face_camera,
    looking,
    symmetric_camera,
)
from visavis.lab.geometry import Vector, unit
from visavis.stage.stills import Stills
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import Character
from visavis.stimuli.dressing.casting import build_of
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.faces import NEUTRAL, Face, face_of, shape_lacking
from visavis.stimuli.motion.kinds import Idle
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Picture
from visavis.stimuli.rooms.portrait import LightOf, portrait_studio

TURNED_DEG = 32.0
COLUMNS = 6
FRAME_M = 0.42
"""What is shown round a face, from side to side."""
TILE_PX = 240


def people_sheet(
    size_px: tuple[int, int],
    people: Sequence[Character],
    expressions: Sequence[str] = (),
    light: LightOf = "day",
) -> Image.Image:
    """Return faces, each `size_px`, with names: from the front and turned, or a row of expressions
    from the front for each person.
    """
    views = [(0.0, Face(expression), expression) for expression in expressions]
    tiles = []
    with Stills() as stills:
        for character in people:
            name = f"{character.name}, {character.stature_m:.2f} m"
            away_m = _away_m(character)
            if not character.has_gaze:
                name += f", without gaze, from {away_m:.1f} m"
            for yaw_deg, face, label in views or [(a, NEUTRAL, name) for a in (0.0, TURNED_DEG)]:
                picture, eyes_m = portrait(character, yaw_deg, face, light)
                camera = face_camera(eyes_m, yaw_deg, size_px[0] / size_px[1], away_m)
                image = stills.image(picture, camera, size_px)
                if views and shape_lacking(character, label):
                    label = f"no {label}: lacks {shape_lacking(character, label)}"
                tiles.append(add_label(image, f"{character.name}, {label}" if views else label))
    columns = len(views) * max(COLUMNS // len(views), 1) if views else COLUMNS
    return contact_sheet(tiles, "everybody at 1.1 m, looking at the camera", columns)


def _away_m(character: Character) -> float:
    """Return from how far away all of a head is seen: that of a mascot may be of any size."""
    if character.has_gaze:
        return FACE_AWAY_M
    mesh, skeleton = character.levels[0], character.skeleton
    on_head = np.isin(mesh.triangle_part, [PART_INDEX["face"], PART_INDEX["scalp"]])
    eyes_m = skeleton.rest_m[[skeleton.index("left_eye"), skeleton.index("right_eye")]].mean(axis=0)
    from_eyes_m = np.abs(mesh.vertices_m[mesh.triangles[on_head]] - eyes_m)[..., :2]
    return max(FACE_AWAY_M, float(from_eyes_m.max(initial=0.0)) / FACE_TANGENT)


def distance_sheet(
    people: Sequence[Character],
    distances_m: Sequence[float],
    px_per_deg: float,
    light: LightOf = "day",
) -> Image.Image:
    """Return faces as a display of so many pixels a degree shows them, enlarged: a row for each, or
    several in a row where distances are few.
    """
    tiles = []
    with Stills() as stills:
        for character in people:
            picture, eyes_m = portrait(character, 0.0, light=light)
            for distance_m in distances_m:
                at = eyes_m + distance_m * np.array([0.0, 0.04, 1.0])
                half = FRAME_M / 2 / distance_m
                camera = symmetric_camera(looking(at, eyes_m - at), half, 1.0)
                side_px = max(round(2 * float(np.degrees(np.arctan(half))) * px_per_deg), 8)
                image = stills.image(picture, camera, (side_px, side_px))
                tile = Image.fromarray(np.asarray(image)).resize(
                    (TILE_PX, TILE_PX), Image.Resampling.NEAREST
                )
                label = f"{character.name}  {distance_m:g} m"
                tiles.append(add_label(np.asarray(tile), label))
    title = f"faces as {px_per_deg:g} pixels a degree show them"
    in_a_row = max(COLUMNS // len(distances_m), 1)
    return contact_sheet(tiles, title, in_a_row * len(distances_m))


def portrait(
    character: Character, yaw_deg: float, face: Face = NEUTRAL, light: LightOf = "day"
) -> tuple[Picture, Vector]:
    """Return a character who stands and looks at a camera `yaw_deg` to the side of its nose, and
    the middle (3,) of its eyes.
    """
    face = face_of(character, face)
    person = Person(build_of(character), Idle(), 7, (0.0, 0.0, 0.0), 180.0, face)
    motion = PeopleMotion((person,))
    angle = np.radians(yaw_deg)
    towards = unit(np.array([np.sin(angle), 0.04, np.cos(angle)]))
    people = motion.at(1.0, Aimed(towards[None], np.ones(1)))
    joints = forward(character.skeleton, people.root_m[0], people.orientation_wxyz[0])
    sides = [character.skeleton.index(f"{side}_eye") for side in ("left", "right")]
    eyes_m = joints.position_m[sides].mean(axis=0)
    return Picture(0, portrait_studio(light), (character,), people), eyes_m
