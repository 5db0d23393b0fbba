"""Cubes that touch two bodies of capsules are those that the rule `published` counts on meshes."""

import numpy as np
import pytest

from visavis.analysis.collisions import ClosedMesh, capsule, common_volume, union
from visavis.stimuli.contact.cubes import cubes_touching_capsules

CUBE_M = 0.01
Body = tuple[np.ndarray, np.ndarray, np.ndarray]


def body(rng: np.random.Generator, aside_m: float = 0.0) -> Body:
    """Return three capsules (starts, ends, radii) in metres near the origin."""
    starts = rng.uniform(-0.1, 0.1, (3, 3)) + np.array([aside_m, 0.0, 0.0])
    return starts, starts + rng.uniform(-0.2, 0.2, (3, 3)), rng.uniform(0.03, 0.08, 3)


def mesh(of: Body) -> ClosedMesh:
    """Return a surface round the capsules, close to them."""
    parts = zip(*of, strict=True)
    return union([capsule(a, b, r, segments=96, rings=24) for a, b, r in parts])


@pytest.mark.parametrize("seed", range(6))
def test_cubes_are_those_counted_on_a_surface_round_the_capsules(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other = body(rng), body(rng, 0.05 * seed)
    counted = common_volume(mesh(one), mesh(other), "published")
    cubes = cubes_touching_capsules(*one, *other, CUBE_M)
    # The mesh lies within its capsule, by a tenth of a millimetre.
    assert counted.volume_m3 / CUBE_M**3 == pytest.approx(cubes, rel=0.01)


def cubes_of_two_posts(low_radius_m: float, high_radius_m: float) -> int:
    """Return the common cubes of an upright post at x = 0 and another at x = 11 cm."""
    ends = np.array([[0.0, -0.1, 0.005]]), np.array([[0.0, 0.1, 0.005]])
    beside = tuple(end + np.array([0.11, 0.0, 0.0]) for end in ends)
    radii = np.array([low_radius_m]), np.array([high_radius_m])
    return int(cubes_touching_capsules(*ends, radii[0], *beside, radii[1], CUBE_M))


def test_cubes_count_that_touch_both_of_two_bodies_that_do_not_meet() -> None:
    # Their surfaces end at x = 4.41 and 4.59 cm, in the same cubes.
    assert 20 <= cubes_of_two_posts(0.0441, 0.0641)
    # At 4.99 and 5.01 cm, in neighbouring ones.
    assert 0 == cubes_of_two_posts(0.0499, 0.0599)


def test_a_capsule_within_another_is_held_to_its_own_cubes() -> None:
    ball = np.zeros((1, 3)) + 0.0051
    large, small = np.array([0.5]), np.array([0.0048])
    assert 1 == cubes_touching_capsules(ball, ball, large, ball, ball, small, CUBE_M)
