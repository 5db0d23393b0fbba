"""Seat people so that their eyes are where a study wants them."""

from dataclasses import replace

import numpy as np

from visavis.lab.geometry import Vector, yaw_pitch_deg_of
from visavis.stimuli.motion.build import Build
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.kinds import MAX_SEAT_M, MIN_SEAT_M, Sit
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import forward


def eyes_of(build: Build, sit: Sit, seed: int) -> Vector:
    """Return the middle of the eyes (3,) of a sitter at the origin who faces −z and keeps still."""
    still = PeopleMotion((Person(build, replace(sit, lively=0.0), seed),)).at(0.0)
    place = forward(build.skeleton, still.root_m[0], still.orientation_wxyz[0])
    rows = [build.skeleton.index(f"{side}_eye") for side in ("left", "right")]
    middle: Vector = place.position_m[rows].mean(axis=0)
    return middle


def seated_under_eyes(
    build: Build,
    eyes_m: Vector,
    *,
    facing: Vector,
    seed: int,
    sit: Sit | None = None,
    floor_m: float | None = None,
) -> Person:
    """Return a sitter whose eyes are at `eyes_m` (3,) in world, turned along `facing` (3,).

    Without `floor_m` the floor (the person's `place_m[1]`) comes to lie where the seat of `sit`
    needs it; with it the seat gets the height that fits.

    Raises:
        MotionError: no seat between that floor and these eyes fits this person.
    """
    sit = sit or Sit()
    at = eyes_of(build, sit, seed)
    floor = float(eyes_m[1] - at[1])
    if floor_m is not None:
        seat_m = sit.seat_m + floor - floor_m
        if not MIN_SEAT_M <= seat_m <= MAX_SEAT_M:
            raise MotionError(
                f"eyes {eyes_m[1] - floor_m:.2f} m above the floor would need a seat at "
                f"{seat_m:.2f} m; raise or lower the floor, or use a person of another size"
            )
        sit, floor = replace(sit, seat_m=seat_m), floor_m
        at = eyes_of(build, sit, seed)
    heading_deg = float(yaw_pitch_deg_of(np.asarray(facing, np.float64))[0])
    c, s = np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg))
    x, z = eyes_m[0] - (c * at[0] + s * at[2]), eyes_m[2] - (-s * at[0] + c * at[2])
    return Person(build, sit, seed, (float(x), floor, float(z)), heading_deg)
