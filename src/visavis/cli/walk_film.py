"""A film of a walk on the spot, seen from its front and side."""

from pathlib import Path
from typing import Final

import numpy as np

from visavis.lab.geometry import quat_multiply, rotate
from visavis.stage.movie import open_movie
from visavis.stage.stills import Stills
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.motion.rotations import quat_about
from visavis.stimuli.motion.synthesis.example_blend import Blend
from visavis.stimuli.motion.warping.outlook import looking_at
from visavis.stimuli.picture import Picture, PosedPeople
from visavis.stimuli.rooms.portrait import portrait_studio

SIZE_PX: Final = (480, 720)
TURN_DEG: Final = 140.0
"""The walker faces the camera, turned to the side."""
MIDDLE_M, RADIUS_M, AWAY_M = 0.92, 1.05, 4.6


def write_walk_film(path: Path, who: Character, walk: Blend, rounds: int) -> None:
    """Write so many cycles of a walk on the spot as a film, at the walk's own frame rate.

    Raises:
        StageError: the film cannot be written, or nothing draws here.
    """
    clip = walk.sampled()
    turn = quat_about("Y", np.radians(np.array(TURN_DEG)))
    camera = looking_at(
        np.array([0.0, 1.25, AWAY_M]),
        np.array([0.0, MIDDLE_M, 0.0]),
        RADIUS_M,
        aspect=SIZE_PX[0] / SIZE_PX[1],
    )
    frames = clip.at(clip.frame_times_s)
    root = rotate(np.broadcast_to(turn, (*frames.root_m.shape[:-1], 4)), frames.root_m)
    turns = frames.orientation_wxyz.copy()
    turns[:, 0] = quat_multiply(np.broadcast_to(turn, turns[:, 0].shape), turns[:, 0])
    with Stills() as stills:
        images = []
        for k in range(len(root)):
            people = PosedPeople(root[k : k + 1], turns[k : k + 1], np.zeros((1, len(MORPHS))))
            picture = Picture(round(k * clip.frame_s * 1e9), portrait_studio(), (who,), people)
            images.append(stills.image(picture, camera, SIZE_PX))
    with open_movie(path, SIZE_PX, round(1.0 / clip.frame_s)) as movie:
        for _ in range(rounds):
            for image in images:
                movie.add(image)
