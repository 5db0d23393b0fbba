"""How well pixels of a headset distinguish direct gaze from gaze averted by 10°.

Faces are drawn eyes to the camera or 10° to its left or right, heads turned and shifted by a little
each time. A simulated observer is shown half of the pictures to learn from and tells the rest
apart: a linear discriminant of the luminance about the eyes with internal noise of 4 % contrast a
pixel. Chance is 50 %.
"""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, rotate, unit
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.characters.character import Character
from visavis.stimuli.dressing.casting import build_of
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.kinds import Idle
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Camera, Picture
from visavis.stimuli.rooms.portrait import portrait_studio

AVERTED_DEG: Final = 10.0
LIMIT_01: Final = 0.9
POSES: Final = 24
NOISES: Final = 20
"""How often each picture is looked at, with other noise each time."""
NOISE_01: Final = 0.04
EYES_M: Final = (0.11, 0.045)
"""Width and height of what the observer looks at."""
SHRINKAGE: Final = 0.1
HEAD_TURN_DEG, SHIFT_M = 4.0, 0.01


def readable_at(
    people: Sequence[Character], distances_m: Sequence[float], px_per_deg: float
) -> Iterator[tuple[Character, float, float]]:
    """Draw everybody at every distance and return the share of correct looks, one by one."""
    renderer = Renderer(quality=Quality(samples=4))
    try:
        for character in people:
            for distance_m in distances_m:
                yield character, distance_m, right_01(renderer, character, distance_m, px_per_deg)
    finally:
        renderer.close()


def seen_eyes(
    renderer: Renderer,
    character: Character,
    distance_m: float,
    averted_deg: float,
    px_per_deg: float,
    rng: np.random.Generator,
) -> Vector:
    """Return the luminance, 0 to 1, around the eyes of one picture of a character, flattened."""
    turn_deg = float(rng.uniform(-HEAD_TURN_DEG, HEAD_TURN_DEG))
    person = Person(
        build_of(character),
        Idle(lively=0.0),
        int(rng.integers(1000)),
        (0.0, 0.0, 0.0),
        180.0 + turn_deg,
    )
    motion = PeopleMotion((person,))
    towards = unit(np.array([0.0, 0.02, 1.0]))
    skeleton = character.skeleton
    eyes = [skeleton.index(f"{side}_eye") for side in ("left", "right")]

    people = motion.at(1.0, Aimed(towards[None], np.ones(1), np.array([distance_m])))
    eyes_m = (
        forward(skeleton, people.root_m[0], people.orientation_wxyz[0])
        .position_m[eyes]
        .mean(axis=0)
    )
    aside = rotate(quat_from_yaw_pitch_deg(averted_deg), towards)
    people = motion.at(1.0, Aimed(aside[None], np.ones(1), np.array([distance_m])))
    at = eyes_m + distance_m * towards + np.append(rng.uniform(-SHIFT_M, SHIFT_M, 2), 0.0)
    wide, high = (max(4, round(np.degrees(m / distance_m) * px_per_deg)) for m in EYES_M)
    # The picture's pixels lie anywhere on the face.
    px_m = distance_m * np.radians(1.0 / px_per_deg)
    to = unit(eyes_m + np.append(rng.uniform(-0.5, 0.5, 2) * px_m, 0.0) - at)
    yaw_deg = float(np.degrees(np.arctan2(-to[0], -to[2])))
    pitch_deg = float(np.degrees(np.arcsin(to[1])))
    across, up = (np.tan(np.radians(n / px_per_deg) / 2) for n in (wide, high))
    camera = Camera(Pose(at, quat_from_yaw_pitch_deg(yaw_deg, pitch_deg)), -across, across, -up, up)
    picture = Picture(0, portrait_studio(), (character,), people)
    image = renderer.image(picture, camera, (wide, high)).astype(np.float64) / 255.0
    luminance_01: Vector = (image @ [0.2126, 0.7152, 0.0722]).ravel()
    return luminance_01


def right_01(
    renderer: Renderer, character: Character, distance_m: float, px_per_deg: float
) -> float:
    """Return the share of looks at which the observer tells direct from averted gaze.

    Half of the looks are direct; chance is .5.
    """
    rng = np.random.default_rng(1)
    looks, gaze, is_learned = [], [], []
    for i in range(POSES):
        for direction, averted_deg in ((0, 0.0), (0, 0.0), (1, AVERTED_DEG), (2, -AVERTED_DEG)):
            looks.append(seen_eyes(renderer, character, distance_m, averted_deg, px_per_deg, rng))
            gaze.append(direction)
            is_learned.append(i % 2 == 0)
    samples = np.repeat(np.array(looks), NOISES, axis=0)
    samples += rng.normal(0.0, NOISE_01, samples.shape)
    directions, is_training = np.repeat(gaze, NOISES), np.repeat(is_learned, NOISES)
    means = np.array([samples[is_training & (directions == k)].mean(axis=0) for k in range(3)])
    within = samples[is_training] - means[directions[is_training]]
    spread = within.T @ within / len(within)
    spread += SHRINKAGE * np.trace(spread) / len(spread) * np.eye(len(spread))
    weights = np.linalg.solve(spread, means.T)
    likely = samples[~is_training] @ weights - (means.T * weights).sum(axis=0) / 2
    likely += np.log([0.5, 0.25, 0.25])
    return float(((likely.argmax(axis=1) == 0) == (directions[~is_training] == 0)).mean())
