from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stimuli.warping.bodies import box_person, waving_clip
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.joint_limits import beyond_deg
from visavis.stimuli.motion.skeleton import Skeleton
from visavis.stimuli.motion.warping.clips import warp_clip
from visavis.stimuli.motion.warping.control import ControlSettings
from visavis.stimuli.motion.warping.features import FeatureTarget, grain_of
from visavis.stimuli.motion.warping.outlook import looking_at, outlook
from visavis.stimuli.motion.warping.trajectory import interpolate_offsets
from visavis.stimuli.motion.warping.units import units_named
from visavis.stimuli.rooms.solids import box

CENTRE = np.array([0.0, 1.1, 0.0])


def view_from(yaw_deg=25.0, size=128, **more):
    yaw = np.radians(yaw_deg)
    eye = CENTRE + 3.0 * np.array([-np.sin(yaw), 0.1, -np.cos(yaw)])
    return outlook(looking_at(eye, CENTRE, 1.15), size, **more)


def warped(
    change=0.25,
    *,
    clip=None,
    kind="coverage",
    parts=("face", "right_hand"),
    view=None,
    units=("all",),
    **parameters,
):
    return warp_clip(
        clip or waving_clip(),
        box_person(),
        view or view_from(),
        (FeatureTarget(kind, parts, change),),
        units_named(units),
        ControlSettings(**{"rate_hz": 8.0, **parameters}),
    )


def test_target_is_kept_over_the_whole_clip_after_smoothing():
    result = warped()
    assert result.pose_reached.all()
    # What is not within a tenth of the change is off by single pixels: the wanted value itself
    # jumps by some 2 % from frame to frame with the pixels of the original.
    assert result.is_reached.mean() >= 0.6
    assert (np.abs(result.goal - result.final) <= 0.06 * result.goal).all()


def test_correction_keeps_what_a_stiff_movement_loses():
    bar = [box((0.42, 1.2, -0.9), (0.06, 2, 0.02), (0, 0, 0))]
    view = view_from(0.0, occluders=bar)
    shares = [
        warped(
            view=view, parts=("right_hand",), units=("right_arm",), smoothness=s
        ).is_reached.mean()
        for s in (0.01, 30.0)
    ]
    assert shares[0] > 0.65
    assert shares[0] > shares[1] + 0.2


def test_smoothness_is_bought_with_the_weight_of_bending():
    def bend(smoothness):
        offsets = warped(smoothness=smoothness).omega_rad
        return np.abs(np.diff(offsets, 2, axis=0)).max()

    assert bend(0.5) < bend(0.001)


def test_loop_is_as_smooth_at_its_seam_as_elsewhere():
    clip = waving_clip(frames=30)
    loop = replace(clip, is_loop=True)
    result = warped(clip=loop)
    assert 8 == len(result.key_s)
    keys = result.omega_rad
    round_again = np.concatenate([keys, keys[:2]])
    bends = np.abs(np.diff(round_again, 2, axis=0)).max(axis=1)
    assert bends[-2:].max() <= 1.5 * bends[:-2].max() + 0.02
    at_ends = interpolate_offsets(
        result.key_s, keys, np.array([0.0, loop.duration_s]), is_loop=True
    )
    np.testing.assert_allclose(at_ends[0], at_ends[1], atol=1e-12)


def test_frames_say_which_of_them_could_not_be_reached():
    # A board hides everything in the right half of the view during the second half of the clip.
    board = [box((-1.0, 1.2, -0.9), (8, 8, 0.02), (0, 0, 0))]
    open_view, shut = view_from(0.0), view_from(0.0, occluders=board)
    result = warped(view=lambda t: open_view if t < 0.5 else shut)
    hidden = result.frame_s >= 0.5
    np.testing.assert_array_equal(0.0, result.final[hidden])
    np.testing.assert_array_equal(0.0, result.goal[hidden])
    assert np.isfinite(result.clip.orientation_wxyz).all()
    assert result.is_reached[hidden].all()
    assert len(result.is_reached) == len(result.clip.root_m)


def test_more_movement_between_frames_can_be_asked_for():
    result = warped(
        0.5,
        kind="motion_coverage",
        parts=("right_hand", "right_forearm"),
        view=view_from(0.0, 256),
        units=("right_arm",),
        smoothness=2.0,
    )
    before, after = result.original.mean(), result.final.mean()
    assert after > 1.15 * before


@settings(max_examples=6, deadline=None)
@given(change=st.floats(-1.0, 2.0), yaw=st.floats(-80, 80), seed=st.integers(0, 99))
def test_warped_clip_keeps_within_joint_limits(change, yaw, seed):
    clip = waving_clip(0.4, 5)
    units = list(units_named(("all",)))
    chosen = np.random.default_rng(seed).choice(len(units), 6, replace=False)
    result = warped(
        change,
        clip=clip,
        view=view_from(yaw, 64),
        most_steps=4,
        passes=2,
        units=tuple(units[k].name for k in chosen),
    )
    turned = (result.clip.orientation_wxyz != clip.orientation_wxyz).any(axis=-1)
    assert beyond_deg(result.clip.orientation_wxyz)[turned].max(initial=0.0) < 1e-6
    assert np.isfinite(result.clip.orientation_wxyz).all()


def test_single_frame_is_warped_as_a_pose():
    clip = waving_clip()
    still = Clip(clip.skeleton, clip.frame_s, clip.root_m[:1], clip.orientation_wxyz[:1])
    result = warped(clip=still)
    assert result.is_reached.all()
    assert (1, 22) == result.omega_rad.shape


@pytest.mark.parametrize("n", [3, 7])
def test_offsets_between_keys_pass_through_the_keys(n):
    rng = np.random.default_rng(n)
    keys, at = rng.normal(size=(n, 4)), np.arange(n) * 0.1
    np.testing.assert_allclose(keys, interpolate_offsets(at, keys, at), atol=1e-12)


@given(value=st.floats(0.0, 1.0))
def test_grain_of_an_area_is_at_least_a_pixel_and_less_than_the_area_itself(value):
    target = FeatureTarget("coverage", ("face",), 0.1)
    pixel = 1 / 128**2
    grain = grain_of(target, value, (128, 128))
    assert pixel <= grain <= max(pixel, value)


def test_clip_without_frames_is_refused():
    clip = waving_clip()
    with pytest.raises(MotionError, match="does not fit"):
        Clip(clip.skeleton, clip.frame_s, clip.root_m[:0], clip.orientation_wxyz[:0])


def test_clip_of_another_skeleton_or_without_target_is_refused():
    clip, body = waving_clip(), box_person()
    target = (FeatureTarget("coverage", ("face",), 0.1),)
    with pytest.raises(MotionError, match="at least one feature"):
        warp_clip(clip, body, view_from(), (), units_named(("all",)))
    few = Skeleton(("hips",), np.array([-1]), np.zeros((1, 3)), np.full((1, 3), np.nan))
    other = Clip(few, 0.1, clip.root_m[:2], clip.orientation_wxyz[:2, :1])
    with pytest.raises(MotionError, match="different joints"):
        warp_clip(other, body, view_from(), target, units_named(("all",)))
