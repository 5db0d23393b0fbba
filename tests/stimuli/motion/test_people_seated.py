"""Sitters of the cast: on the seat, not in it; feet on the floor, not under it."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest

from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.cast import load_cast
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.skinning import skin_of
from visavis.stimuli.motion.build import build_of_character, build_of_skeleton
from visavis.stimuli.motion.kinds import Sit
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward

SEAT_M = 0.45
CAST = load_cast()


def surface_m(character: Character, sit: Sit, seed: int) -> npt.NDArray[np.float32]:
    pose = PeopleMotion((Person(build_of_character(character), sit, seed),)).at(3.0)
    placement = forward(character.skeleton, pose.root_m[0], pose.orientation_wxyz[0])
    return skin_of(character, placement).vertices_m


@pytest.mark.parametrize("character", CAST, ids=[c.name for c in CAST])
def test_no_body_and_no_hem_goes_a_centimetre_into_the_seat(character: Character) -> None:
    for seed, hands in ((1, "thighs"), (2, "lap"), (5, "folded")):
        body = surface_m(character, Sit(SEAT_M, hands), seed)  # type: ignore[arg-type]
        above_seat = (np.abs(body[:, 0]) < 0.22) & (np.abs(body[:, 2]) < 0.22)
        above_seat &= body[:, 1] > 0.25
        assert -0.010 < body[above_seat, 1].min() - SEAT_M < 0.035
        assert -0.0105 < body[:, 1].min() < 0.02


@pytest.mark.parametrize("character", CAST, ids=[c.name for c in CAST])
def test_thumbs_of_hands_in_a_lap_lie_along_them_and_do_not_stick_up(character: Character) -> None:
    mesh, names = character.levels[0], character.skeleton.names
    heaviest = np.take_along_axis(mesh.joints, mesh.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    parts = [PART_INDEX[f"{side}_hand"] for side in ("left", "right")]
    rows = np.unique(mesh.triangles[np.isin(mesh.triangle_part, parts)])
    moved_by = np.array(names)[heaviest[rows]]
    is_thumb = np.char.find(moved_by, "thumb") >= 0
    for seed in (1, 3):
        hands = surface_m(character, Sit(SEAT_M, "lap"), seed)[rows]
        for side in ("left", "right"):
            end = hands[moved_by == f"{side}_thumb_distal"]
            tip = end[end[:, 1].argmax()]
            beside = hands[~is_thumb & (np.abs(hands[:, 0] - tip[0]) < 0.015)]

            assert 0.022 > tip[1] - beside[:, 1].max()


@pytest.mark.parametrize(
    ("stature_m", "seat_m"),
    [(1.4, 0.36), (1.4, 0.42), (1.75, 0.38), (1.75, 0.45), (1.75, 0.52), (2.1, 0.45), (2.1, 0.55)],
)
def test_thighs_of_a_bare_skeleton_lie_on_the_seat(stature_m: float, seat_m: float) -> None:
    build = build_of_skeleton(canonical_skeleton(stature_m))
    for seed in range(6):
        pose = PeopleMotion((Person(build, Sit(seat_m), seed),)).at(1.0)
        body = forward(build.skeleton, pose.root_m[0], pose.orientation_wxyz[0])
        for side in ("left", "right"):
            hip = body.position_m[build.skeleton.index(f"{side}_upper_leg")]
            knee = body.position_m[build.skeleton.index(f"{side}_lower_leg")]
            flesh_m = 0.060 * stature_m / 1.75
            assert hip[1] - seat_m == pytest.approx(0.085 * stature_m / 1.75, abs=0.02)
            assert knee[1] - flesh_m > seat_m - 0.045
            assert knee[2] < hip[2] - 0.2


def _along_fingers_m(
    character: Character, sit: Sit, seed: int, side: str
) -> npt.NDArray[np.float64]:
    """Return points (k, 3) along the bones of four fingers, a few millimetres apart."""
    skeleton = character.skeleton
    pose = PeopleMotion((Person(build_of_character(character), sit, seed),)).at(3.0)
    body = forward(skeleton, pose.root_m[0], pose.orientation_wxyz[0])
    share = np.linspace(0.0, 1.0, 12)[:, None]
    points = []
    for finger in ("index", "middle", "ring", "little"):
        at = [
            body.position_m[skeleton.index(f"{side}_{finger}_{bone}")]
            for bone in ("proximal", "middle", "distal")
        ]
        points += [a + share * (b - a) for a, b in pairwise(at)]
    return np.concatenate(points)


@pytest.mark.parametrize("character", CAST, ids=[c.name for c in CAST])
def test_hands_in_the_lap_lie_one_over_the_other_without_tangled_fingers(
    character: Character,
) -> None:
    for seed in range(4):
        left, right = (
            _along_fingers_m(character, Sit(SEAT_M, "lap", lively=0.25), seed, side)
            for side in ("left", "right")
        )
        apart_m = np.linalg.norm(left[:, None] - right, axis=2).min()

        # Fingers are 15 to 18 mm thick.
        assert 0.015 < apart_m < 0.045
