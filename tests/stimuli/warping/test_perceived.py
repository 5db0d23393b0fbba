from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stimuli.warping.bodies import arm_raised, box_person
from visavis.lab.geometry import Pose
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.warping.features import (
    EDGE_PX,
    FeatureTarget,
    fine_values_of,
    parse_feature,
    values_of,
)
from visavis.stimuli.motion.warping.outlook import looking_at, outlook, packed_eye
from visavis.stimuli.motion.warping.perceived import (
    SeenBody,
    holding,
    mask_of,
    perceived_parts,
    posed_points,
    refuse_observer_inside,
    seen_and_free_parts,
)
from visavis.stimuli.motion.warping.raster_kernels import BOTH_SIDES
from visavis.stimuli.motion.warping.units import turned_by, units_named
from visavis.stimuli.picture import Light
from visavis.stimuli.rooms.solids import box

CENTRE = np.array([0.0, 1.1, 0.0])
WHOLE = ("head", "trunk", "arms", "legs", "neck")


def view_from(yaw_deg=0.0, distance_m=3.0, size=96, **more):
    yaw = np.radians(yaw_deg)
    eye = CENTRE + distance_m * np.array([-np.sin(yaw), 0.1, -np.cos(yaw)])
    return outlook(looking_at(eye, CENTRE, 1.15), size, **more)


def seen(view, body=None, root_turns=None):
    root, turns = root_turns or arm_raised()
    return perceived_parts(body or box_person(), view, root[None], turns[None])


def brute_force(body, view, root, turns):
    """Cast a ray through every pixel centre and keep the nearest front face."""
    eye = packed_eye(view.camera)
    axes = eye[3:12].reshape(3, 3)
    height, width = view.size_px
    corners = posed_points(body, root, turns)[body.triangles]
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(u, v)
    ids = np.zeros((height, width), dtype=np.uint8)
    for r in range(height):
        for c in range(width):
            x = eye[12] + (c + 0.5) / width * (eye[13] - eye[12])
            y = eye[15] - (r + 0.5) / height * (eye[15] - eye[14])
            ray = x * axes[0] + y * axes[1] - axes[2]
            front = normal @ ray
            with np.errstate(divide="ignore", invalid="ignore"):
                t = np.sum((a - eye[:3]) * normal, axis=1) / front
                p = eye[:3] + t[:, None] * ray - a
                uu, vv, uv = (np.sum(m * n, axis=1) for m, n in ((u, u), (v, v), (u, v)))
                pu, pv = np.sum(p * u, axis=1), np.sum(p * v, axis=1)
                area = uu * vv - uv * uv
                s1, s2 = (pu * vv - pv * uv) / area, (pv * uu - pu * uv) / area
            hit = (front < 0) & (t > 0) & (s1 >= 0) & (s2 >= 0) & (s1 + s2 <= 1)
            if hit.any():
                nearest = np.flatnonzero(hit)[np.argmin(t[hit])]
                ids[r, c] = body.labels[nearest]
    return ids


def test_buffer_equals_ray_casting_within_half_a_percent_of_pixels():
    view = view_from(25.0, size=48)
    root, turns = arm_raised()
    expected = brute_force(box_person(), view, root, turns)
    got = perceived_parts(box_person(), view, root[None], turns[None])[0]
    assert (expected > 0).sum() > 140
    assert (expected != got).mean() <= 0.005


def test_order_of_triangles_does_not_matter():
    body = box_person()
    order = np.random.default_rng(3).permutation(len(body.triangles))
    shuffled = SeenBody(
        body.skeleton,
        body.rest,
        body.joints,
        body.weights,
        body.triangles[order],
        body.labels[order],
    )
    np.testing.assert_array_equal(seen(view_from(40)), seen(view_from(40), shuffled))


def test_two_threads_see_what_one_sees():
    root, turns = arm_raised()
    rows = np.repeat(turns[None], 9, axis=0)
    rows[:, box_person().skeleton.index("head"), 0] = np.linspace(0.9, 1.0, 9)
    roots = np.repeat(root[None], 9, axis=0)
    one = perceived_parts(box_person(), view_from(), roots, rows)
    with ThreadPoolExecutor(2) as pool:
        two = perceived_parts(box_person(), view_from(), roots, rows, pool=pool, threads=2)
    np.testing.assert_array_equal(one, two)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**31 - 1), yaw=st.floats(-90, 90))
def test_poses_drawn_together_are_those_drawn_alone(seed, yaw):
    # Triangles that stay where they are in the first pose are drawn once for many poses.
    rng = np.random.default_rng(seed)
    root, turns = arm_raised()
    units, view = units_named(("all",)), view_from(yaw, size=64)
    omega = np.zeros((8, 22))
    omega[np.arange(8), rng.integers(0, 22, 8)] = rng.normal(0, 0.4, 8)
    omega += rng.normal(0, 0.2, 22) * rng.integers(0, 2)
    rows = turned_by(box_person().skeleton, units, turns, omega)
    together = perceived_parts(box_person(), view, np.repeat(root[None], 8, axis=0), rows)
    alone = [perceived_parts(box_person(), view, root[None], row[None])[0] for row in rows]
    np.testing.assert_array_equal(np.array(alone), together)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**31 - 1), yaw=st.floats(-90, 90))
def test_what_is_free_and_what_is_seen_are_what_each_would_be_alone(seed, yaw):
    rng = np.random.default_rng(seed)
    root, turns = arm_raised()
    rows = np.repeat(turns[None], 4, axis=0)
    rows[:, box_person().skeleton.index("head"), 0] = [1.0, 1.0, 0.95, 0.9]
    roots = np.repeat(root[None], 4, axis=0)
    nothing = view_from(yaw, size=64)
    view = replace(nothing, behind=rng.uniform(0.1, 2.0, nothing.behind.shape))
    nothing = replace(nothing, behind=np.zeros_like(nothing.behind))

    partly, free = seen_and_free_parts(box_person(), view, roots, rows)

    np.testing.assert_array_equal(perceived_parts(box_person(), nothing, roots, rows), free)
    np.testing.assert_array_equal(perceived_parts(box_person(), view, roots, rows), partly)
    assert 0 < (partly > 0).sum() < (free > 0).sum()


def test_cloth_is_seen_from_behind_and_skin_is_not():
    root, turns = arm_raised()
    inside_out = replace(box_person(), triangles=box_person().triangles[:, ::-1].copy())
    cloth = replace(inside_out, labels=inside_out.labels + np.uint8(BOTH_SIDES))
    skin, both = (seen(view_from(), b, (root, turns)) for b in (inside_out, cloth))
    whole = seen(view_from())
    assert both.max() <= max(PART_INDEX.values())
    np.testing.assert_array_equal(whole > 0, both > 0)
    assert (skin != whole).any()


def test_body_half_as_large_at_half_the_distance_looks_the_same():
    far, (root, turns) = view_from(20.0), arm_raised()
    body = box_person()
    skeleton = type(body.skeleton)(
        body.skeleton.names,
        body.skeleton.parents,
        body.skeleton.offsets_m / 2,
        body.skeleton.tips_m / 2,
    )
    half = SeenBody(skeleton, body.rest / 2, body.joints, body.weights, body.triangles, body.labels)
    eye = far.camera.pose.position_m / 2
    near = outlook(
        type(far.camera)(
            Pose(eye, far.camera.pose.orientation_wxyz),
            far.camera.left,
            far.camera.right,
            far.camera.bottom,
            far.camera.top,
        ),
        96,
    )
    expected = seen(far)
    got = perceived_parts(half, near, root[None] / 2, turns[None])
    assert (expected != got).mean() <= 0.001


@settings(max_examples=25, deadline=None)
@given(width=st.floats(0.05, 1.0), more=st.floats(0.0, 1.0), x=st.floats(-0.5, 0.5))
def test_larger_occluder_never_raises_coverage(width, more, x):
    target = (FeatureTarget("coverage", WHOLE, 0.0),)
    small, large = (
        view_from(occluders=[box((x, 1.2, -0.9), (w, 0.6, 0.02), (0, 0, 0))])
        for w in (width, width + more)
    )
    values = [values_of(target, seen(view))[0, 0] for view in (small, large)]
    assert values[1] <= values[0]


def test_occluder_over_everything_leaves_nothing():
    wall = box((0, 1.2, -1.2), (6, 6, 0.05), (0, 0, 0))
    ids = seen(view_from(occluders=[wall]))
    assert not ids.any()
    targets = tuple(
        FeatureTarget(k, WHOLE, 0.1)
        for k in ("coverage", "horizontal_extension", "vertical_extension", "motion_coverage")
    )
    np.testing.assert_array_equal(np.zeros((1, 4)), values_of(targets, ids, ids[0]))


@settings(max_examples=20, deadline=None)
@given(yaw=st.floats(-50, 50), near_m=st.floats(0.8, 1.7))
def test_wall_that_reaches_past_the_observer_hides_all_the_same(yaw, near_m):
    # So wide a wall has corners behind the observer's eye.
    wall = box((0.0, 1.2, -near_m), (60.0, 8.0, 0.02), (0, 0, 0))
    assert not seen(view_from(yaw, size=64, occluders=[wall])).any()


def test_floor_cut_at_the_eye_is_seen_where_the_whole_floor_is():
    # A tiled floor needs no cutting beyond its own tiles; both must give the same depth.
    def floor(tiles):
        edges = np.linspace(-8.0, 8.0, tiles + 1)
        size = 16.0 / tiles
        return [
            box((x + size / 2, 0.05, z + size / 2), (size, 0.02, size), (0, 0, 0))
            for x in edges[:-1]
            for z in edges[:-1]
        ]

    one, many = (view_from(30.0, occluders=floor(n)).behind for n in (1, 32))
    assert (one > 0).mean() > 0.2
    np.testing.assert_allclose(many, one, rtol=1e-6, atol=1e-9)


def test_part_in_the_dark_is_not_perceived_but_still_hides():
    lamp = Light("point", np.array([3.0, 3.0, 3.0]), position_m=np.array([0.0, 1.2, -2.0]))
    lit = view_from(lights=[lamp], lit_centre_m=CENTRE)
    # A board between lamp and head, beside the observer's line of sight.
    board = box((0.0, 1.42, -1.55), (0.25, 0.25, 0.02), (0, 0, 0))
    high = CENTRE + 3.0 * np.array([0.0, 0.9, -1.0])
    shaded = outlook(
        looking_at(high, CENTRE, 1.15), 96, lights=[lamp], lit_centre_m=CENTRE, occluders=[board]
    )
    open_view = outlook(looking_at(high, CENTRE, 1.15), 96, lights=[lamp], lit_centre_m=CENTRE)
    face = (FeatureTarget("coverage", ("face",), 0.0),)
    assert values_of(face, seen(lit))[0, 0] > 0
    before = values_of(face, seen(open_view))[0, 0]
    after = values_of(face, seen(shaded))[0, 0]
    assert after < 0.6 * before


def test_light_of_a_white_surface_follows_distance_and_angle():
    def coverage(intensity):
        lamp = Light("point", np.full(3, intensity), position_m=np.array([0.0, 1.6, -2.1]))
        view = view_from(lights=[lamp], lit_centre_m=CENTRE)
        return values_of((FeatureTarget("coverage", ("face",), 0.0),), seen(view))[0, 0]

    # The face is 2 m before the lamp: illumination is intensity / 4, the threshold 0.15.
    assert coverage(0.55) == 0
    assert coverage(0.70) > 0


def test_held_object_is_seen_in_the_hand_and_moves_with_it():
    tablet = box((0, 0, 0), (0.16, 0.24, 0.01), (20, 20, 20))
    at_hand = Pose(np.array([0.1, 0.0, 0.0]), np.array([1.0, 0, 0, 0]))
    body = holding(box_person(), tablet, "right_hand", at_hand)
    ids = seen(view_from(), body)
    assert (ids == PART_INDEX["held_object"]).sum() > 20
    assert mask_of(("held_object",))[PART_INDEX["held_object"]]


@pytest.mark.parametrize("text", ["coverage", "coverage:face", "coverage:face:much"])
def test_malformed_feature_is_refused_with_an_example(text):
    with pytest.raises(MotionError, match="write"):
        parse_feature(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("glow:face:+0.1", "no visual feature 'glow'"),
        ("coverage:tail:+0.1", "no body part 'tail'"),
        ("coverage:face:-2", "at least -1"),
        ("coverage::+0.1", "names no body part"),
    ],
)
def test_unknown_feature_or_part_is_named(text, message):
    with pytest.raises(MotionError, match=message):
        parse_feature(text)


def test_feature_reads_as_it_is_written():
    assert FeatureTarget("coverage", ("face", "right_hand"), 0.25) == parse_feature(
        "coverage:face,right_hand:+0.25"
    )


def test_observer_inside_the_body_is_refused():
    root, turns = arm_raised()
    body = box_person()
    with pytest.raises(MotionError, match="inside the body"):
        refuse_observer_inside(body, root + np.array([0, 0.2, 0]), root, turns)
    refuse_observer_inside(body, root + np.array([0, 0.2, -2.0]), root, turns)


def test_observer_nearer_than_the_view_is_refused():
    with pytest.raises(MotionError, match="move the observer back"):
        looking_at(CENTRE + np.array([0, 0, 0.5]), CENTRE, 1.0)


@given(above=st.integers(0, 8), tip=st.integers(0, 8), tall=st.integers(6, 30))
def test_extension_measured_finely_grows_with_the_share_of_the_next_row(above, tip, tall):
    ids = np.zeros((1, 64, 64), dtype=np.uint8)
    ids[0, 20 : 20 + tall, 10:18] = PART_INDEX["left_hand"]
    ids[0, 19, 10 : 10 + tip] = PART_INDEX["left_hand"]
    target = (FeatureTarget("vertical_extension", ("left_hand",), 0.1),)
    whole, found = values_of(target, ids)[0, 0], fine_values_of(target, ids)[0, 0]
    short = 2 * EDGE_PX / 8
    assert (tall + tip / 8 - short) / 64 == pytest.approx(found, abs=0.26 / 64)
    assert (tall + bool(tip)) / 64 == whole
    moved = np.roll(ids, above, axis=1)
    assert found == pytest.approx(fine_values_of(target, moved)[0, 0], abs=1e-12)


def test_fine_extension_of_a_few_pixels_is_the_plain_one():
    ids = np.zeros((1, 16, 16), dtype=np.uint8)
    ids[0, 4:6, 3:7] = PART_INDEX["left_hand"]
    for kind in ("horizontal_extension", "vertical_extension", "coverage"):
        target = (FeatureTarget(kind, ("left_hand",), 0.1),)
        np.testing.assert_array_equal(values_of(target, ids), fine_values_of(target, ids))
