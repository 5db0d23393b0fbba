"""What a recording gives to analysis: the trials' own padding, frozen gaze lost."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest

from visavis.analysis.gaze.aoi import LOST
from visavis.analysis.gaze.targets import gaze_of_part
from visavis.protocol.session.boards import NOTHING_IN_TIME
from visavis.results.intake import _without_limits, validations_of
from visavis.study.look_measures import LooksOn


class FewSamples:
    """A recording of 24 samples at 120 Hz; the first twelve repeat one direction."""

    manifest = SimpleNamespace(configuration={"devices": {}}, devices=())

    def events_named(self, name: str, part: int) -> pd.DataFrame:
        return pd.DataFrame({"payload": []})

    def stream_arrays(self, name: str, *, part: int) -> dict[str, npt.NDArray[np.generic]]:
        n, m = 24, 2
        t_ns = np.arange(n, dtype=np.int64) * 10**9 // 120
        direction = np.zeros((n, 3), dtype=np.float32)
        direction[:, 2] = -1
        direction[12:, 0] = np.linspace(0.01, 0.1, 12)
        if name == "gaze":
            last = n - 1  # which was not recorded
            return {
                "seq": np.arange(last),
                "t_device_ns": t_ns[:last],
                "t_host_ns": t_ns[:last],
                "direction_head": direction[:last],
                "valid": np.arange(last) != 13,
            }
        return {
            "gaze_seq": np.arange(n),
            "t_sample_ns": t_ns,
            "valid": np.ones(n, dtype=np.bool_),
            "direction_world": direction,
            "angle_deg": np.zeros((n, m)),
            "radius_deg": np.ones((n, m)),
            "pad_limit_deg": np.ones((n, m)),
            "hit": np.zeros(n, dtype=np.int16),
        }


def test_gaze_that_repeats_one_direction_for_100_ms_is_lost() -> None:
    gaze = gaze_of_part(FewSamples(), 1)  # type: ignore[arg-type]  # only its streams are read
    samples, frozen = gaze.targets, gaze.frozen

    assert [True] * 12 + [False] * 12 == frozen.tolist()
    assert [LOST] * 12 + [0] * 12 == samples.hit.tolist()
    assert not samples.valid[:12].any()
    assert samples.valid[12:].all()


def test_eye_in_head_is_that_of_the_same_sample_and_missing_where_it_was_lost() -> None:
    samples = gaze_of_part(FewSamples(), 1).targets  # type: ignore[arg-type]  # as above

    assert samples.direction_head is not None
    right = samples.direction_head[:, 0].tolist()
    known = np.linspace(0.01, 0.1, 12)
    assert np.isnan([right[13], right[23]]).all()
    assert [0.0] * 12 == right[:12]
    assert known[[0, *range(2, 11)]].tolist() == pytest.approx([right[12], *right[14:23]])


def test_measures_pad_heads_as_the_trials_did_online() -> None:
    assert LooksOn().rules({"parameters": {"pad_deg": 0.5}}).pad_deg == 0.5
    assert LooksOn().rules({}).pad_deg == pytest.approx(1.0)


def validation(moment: str, accuracy_deg: float | None, *, accepted: bool = True) -> dict[str, Any]:
    return {"moment": moment, "accuracy_deg": accuracy_deg, "accepted": accepted}


def test_drift_is_the_last_error_minus_the_one_before_the_last_block() -> None:
    payloads = [
        validation("block_start", 2.0, accepted=False),
        validation("block_start", 0.5),
        validation("block_start", 0.75),
        validation("end", 1.0, accepted=False),
    ]
    events = pd.DataFrame({"name": "validation", "payload": payloads})

    expected = {"end_accuracy_deg": 1.0, "drift_deg": 0.25, "rejected_validations": 1}
    assert expected == validations_of(events)


def test_a_session_without_validations_has_no_columns_of_them() -> None:
    assert {} == validations_of(pd.DataFrame({"name": [], "payload": []}))


def test_of_recordings_that_hold_the_limit_an_answer_that_nobody_gave_has_no_time() -> None:
    rows = pd.DataFrame(
        {
            "nice": ["3", None],
            "nice_by": ["keys", NOTHING_IN_TIME],
            "nice_ms": [640.0, 8000.0],
            "ended_by": ["seconds", "seconds"],
        }
    )
    times_ms = _without_limits(rows)["nice_ms"]
    assert 640.0 == times_ms[0]
    assert np.isnan(times_ms[1])
