"""Gaze at a screen: where it meets the pixels, as a ray into the scene behind them."""

from dataclasses import replace

import numpy as np

from visavis.lab.geometry import Pose, quat_conjugate, rotate
from visavis.lab.schema import SampleBatch
from visavis.lab.screen import FlatScreen

DIRECTIONS = ("direction_head", "left_direction_head", "right_direction_head")


def gaze_through_screen(
    batch: SampleBatch, screen: FlatScreen, place: Pose, drawn_from: Pose
) -> SampleBatch:
    """Return gaze samples as rays of the eye that the picture is drawn for.

    A tracker's rays lead from the eyes to points of the screen (frame: the viewing place). What is
    drawn at such a point is what the picture's eye, at `drawn_from`, sees through it: that ray, in
    its head's frame, leads to what was looked at. A combined sample beside the screen is not valid:
    nothing of the scene is there. What is recorded of the tracker stays as it was.
    """
    values = batch.values.copy()
    turn = quat_conjugate(place.orientation_wxyz)
    eye_m = rotate(turn, drawn_from.position_m - place.position_m)
    at_m = values["origin_m"].astype(np.float64)
    at_m[~np.isfinite(at_m).all(axis=1)] = 0.0
    # All at once: a frame brings one sample or two, and each call costs more than its numbers.
    directions = np.concatenate([values[name] for name in DIRECTIONS]).astype(np.float64)
    rays = screen.seen_through(eye_m, np.tile(at_m, (len(DIRECTIONS), 1)), directions)
    for name, ray in zip(DIRECTIONS, np.split(rays, len(DIRECTIONS)), strict=True):
        values[name] = ray
    combined = directions[: len(values)]
    values["valid"] &= screen.is_on(screen.meets_m(at_m, combined))
    values["origin_m"] = 0.0
    return replace(batch, values=values)
