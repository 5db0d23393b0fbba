"""What the runtime's stamps say of a picture's head, and of the pace at which it showed frames."""

import math

import numpy as np
import pytest

from visavis.analysis.frame_times import account_of, pose_age, runtime_pace
from visavis.devices.contracts import FRAME_TIMING
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.schema import SampleBatch
from visavis.recording.journal import as_json

FRAME_NS = NS_PER_S // 90


def test_a_head_foreseen_for_its_light_is_between_the_photodiodes_delay_and_the_look_ahead():
    handed = FRAME_NS * np.arange(100)
    light = handed + 22 * NS_PER_MS
    age = pose_age(light, handed, light, 5.0)

    assert (age.at_least_ms, age.at_most_ms) == pytest.approx((5.0, 27.0))
    assert age.look_ahead_ms == pytest.approx(22.0)


def test_a_head_that_is_not_foreseen_is_as_old_as_its_way_to_the_light():
    handed = FRAME_NS * np.arange(100)
    age = pose_age(handed, handed, handed + 22 * NS_PER_MS, 5.0)
    assert (age.at_least_ms, age.at_most_ms) == pytest.approx((27.0, 27.0))


def test_an_unmeasured_light_is_not_in_the_age_and_is_not_zero_in_the_record():
    handed = FRAME_NS * np.arange(10)
    light = handed + 22 * NS_PER_MS
    age = pose_age(light, handed, light)
    assert (age.at_least_ms, age.at_most_ms) == pytest.approx((0.0, 22.0))
    assert as_json(age)["picture_delay_ms"] is None
    assert as_json(pose_age(light[:0], handed[:0], light[:0]))["at_most_ms"] is None


def test_a_halved_rate_is_told_and_dropped_frames_are_not_one():
    regular_ns = FRAME_NS * np.arange(300)
    halved = regular_ns[-1] + 2 * FRAME_NS * np.arange(1, 101)
    pace = runtime_pace(np.concatenate([regular_ns, halved]), FRAME_NS)
    assert pace.halved_01 == pytest.approx(100 / 399)
    (sentence,) = pace.sentences
    assert "halved its rate in 25% of frames" in sentence

    dropped = np.delete(regular_ns, np.arange(5, 290, 10))
    assert runtime_pace(dropped, FRAME_NS).sentences == ()
    assert runtime_pace(regular_ns, FRAME_NS).sentences == ()
    assert math.isnan(runtime_pace(regular_ns, FRAME_NS).reprojected_01)


def timing(flags, presents):
    values = np.zeros(len(flags), FRAME_TIMING.dtype)
    values["timing_known"], values["reprojection_flags"], values["presents"] = True, flags, presents
    stamps = np.arange(len(flags))
    return [SampleBatch(FRAME_TIMING, stamps, stamps, stamps, values)]


@pytest.mark.parametrize(
    ("flag", "presents", "share"), [(0b01, 1, 0.5), (0b10, 1, 0.5), (0b100, 1, 0.0), (0, 2, 0.5)]
)
def test_a_frame_shown_again_is_told_and_a_mode_that_only_could_is_not(flag, presents, share):
    pace = runtime_pace(
        FRAME_NS * np.arange(100),
        FRAME_NS,
        account_of(timing([flag, 0] * 50, [presents, 1] * 50)),
    )
    assert pace.reprojected_01 == pytest.approx(share)
    assert len(pace.sentences) == (share > 0)
