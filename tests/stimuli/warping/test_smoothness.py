from dataclasses import replace

import numpy as np
import pytest

from tests.stimuli.warping.bodies import box_person, waving_clip
from tests.stimuli.warping.smoothness import peak_turning
from visavis.lab.geometry import quat_from_yaw_pitch_deg
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import Skeleton
from visavis.stimuli.motion.warping.clips import warp_clip
from visavis.stimuli.motion.warping.control import ControlSettings
from visavis.stimuli.motion.warping.features import FeatureTarget
from visavis.stimuli.motion.warping.outlook import looking_at, outlook
from visavis.stimuli.motion.warping.units import units_named

ONE_JOINT = Skeleton(("hips",), np.array([-1]), np.zeros((1, 3)), np.full((1, 3), np.nan))


def turning(yaw_deg, frame_s=0.1, **more):
    turns = np.array([[quat_from_yaw_pitch_deg(y)] for y in yaw_deg])
    return Clip(ONE_JOINT, frame_s, np.zeros((len(turns), 3)), turns, **more)


def test_peaks_of_a_cubic_turn_are_its_differences():
    t = 0.1 * np.arange(6)
    peak = peak_turning(turning(40 * t**3))
    assert 40 * (0.5**3 - 0.4**3) / 0.1 == pytest.approx(peak.speed_deg_s)
    assert 40 * 6 * 0.4 == pytest.approx(peak.acceleration_deg_s2)
    assert 40 * 6 == pytest.approx(peak.jerk_deg_s3, rel=1e-6)


def test_sign_of_a_quaternion_is_no_movement():
    clip = turning([0.0, 10.0, 20.0, 30.0, 40.0])
    flipped = clip.orientation_wxyz.copy()
    flipped[2] *= -1
    assert peak_turning(clip).speed_deg_s == pytest.approx(100.0)
    assert peak_turning(replace(clip, orientation_wxyz=flipped)) == peak_turning(clip)


def test_seam_of_a_loop_counts():
    steps = [0.0, 10.0, 20.0, 30.0]
    assert peak_turning(turning(steps)).jerk_deg_s3 == pytest.approx(0.0, abs=1e-6)
    assert peak_turning(turning(steps, is_loop=True)).speed_deg_s == pytest.approx(300.0)


def test_only_joints_named_are_measured():
    clip = waving_clip()
    assert peak_turning(clip, ("left_foot",)).speed_deg_s == 0.0
    assert peak_turning(clip, ("right_lower_arm",)).speed_deg_s > 10.0


def test_too_few_frames_or_an_unknown_joint_are_refused():
    with pytest.raises(MotionError, match="four frames"):
        peak_turning(turning([0.0, 1.0, 2.0]))
    with pytest.raises(MotionError, match="tail"):
        peak_turning(turning([0.0] * 5), ("tail",))


def warped(clip, **loop):
    view = outlook(looking_at(np.array([-1.3, 1.4, -2.7]), np.array([0.0, 1.1, 0.0]), 1.15), 128)
    units = units_named(("spine", "neck_head", "right_arm"))
    target = (FeatureTarget("coverage", ("face", "right_hand"), 0.25),)
    loop = {"rate_hz": 8.0, **loop}
    return warp_clip(clip, box_person(), view, target, units, ControlSettings(**loop)).clip


@pytest.mark.parametrize("search", [False, True], ids=["plain", "searched"])
def test_warped_wave_is_hardly_livelier_than_the_wave(search):
    clip = waving_clip()
    found = warped(clip, search=search)
    before, after = peak_turning(clip), peak_turning(found)
    assert not np.array_equal(clip.orientation_wxyz, found.orientation_wxyz)
    assert after.speed_deg_s <= 1.5 * before.speed_deg_s
    assert after.acceleration_deg_s2 <= 1.5 * before.acceleration_deg_s2
    # An even swing has the least jerk a wave can have; that of people has ten times as much.
    assert after.jerk_deg_s3 <= 2.5 * before.jerk_deg_s3


def test_keys_that_follow_every_pixel_would_be_jerky():
    clip = waving_clip()
    hasty = warped(clip, rate_hz=15.0, smooth_s=0.02, smoothness=1e-6)
    assert peak_turning(hasty).jerk_deg_s3 > 2.5 * peak_turning(clip).jerk_deg_s3
