"""Blinks of a trial are those that its pupil shows; without a pupil they are missing."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.study.blink_measures import blink_count, blink_rate
from visavis.study.measures import Measure, TrialRecord

RATE_HZ = 120
T_NS = np.rint(np.arange(RATE_HZ * 60) * 1e9 / RATE_HZ).astype(np.int64)


class Recorded:
    """A minute of gaze at 120 Hz with blinks of 150 ms, as much of a recording as is asked for."""

    path = Path("S01B")
    manifest = SimpleNamespace(configuration={"devices": {}}, devices=())

    def __init__(self, blinks_s: list[float], lost_s: tuple[float, float] = (0, 0)) -> None:
        t_s = T_NS / 1e9
        closed = np.zeros(len(T_NS), bool)
        for at in blinks_s:
            closed |= (t_s >= at) & (t_s < at + 0.15)
        closed |= (t_s >= lost_s[0]) & (t_s < lost_s[1])
        rng = np.random.default_rng(3)
        size = np.where(closed, np.nan, 3.5 + 0.01 * rng.standard_normal(len(T_NS)))
        self.stream_names = ("gaze",)
        self.columns = {
            "t_host_ns": T_NS,
            "direction_head": np.tile([0.0, 0.0, -1.0], (len(T_NS), 1)),
            "left_pupil_mm": size,
            "left_valid": ~closed,
        }

    def stream_arrays(self, name: str, *, part: int) -> Any:
        return self.columns

    def stream_schema(self, name: str) -> None:
        return None

    def events(self) -> Any:
        return []


def value(measure: Measure, recorded: Any, start_s: float = 0.0, end_s: float = 60.0) -> Any:
    row = {"trial_id": "T01", "recording_part": 1}
    row |= {"t_start_ns": round(start_s * 1e9), "t_end_ns": round(end_s * 1e9)}
    row |= {"scene_on_ns": round((start_s + 1) * 1e9), "scene_off_ns": round(end_s * 1e9)}
    assert measure.of is not None
    return measure.of(TrialRecord(row, recorded))


@settings(max_examples=25)
@given(
    first=st.floats(0.5, 2.0),
    gaps=st.lists(st.floats(0.8, 6.0), max_size=12),
    window=st.tuples(st.floats(0, 25), st.floats(10, 30)),
)
def test_every_blink_that_begins_within_a_trial_counts_once(
    first: float, gaps: list[float], window: tuple[float, float]
) -> None:
    at = [t for t in np.cumsum([first, *gaps]).tolist() if t < 59]
    start, end = window[0], window[0] + window[1]
    if any(abs(t - edge) < 0.2 for t in at for edge in (start, end)):
        return  # where the lid begins to close is known to a few samples
    recorded = Recorded(at)
    expected = sum(start <= t < end for t in at)
    assert expected == value(blink_count(), recorded, start, end)
    rate = value(blink_rate(), recorded, start, end)
    assert pytest.approx(expected * 60 / window[1], rel=0.02) == rate


def test_time_without_an_eye_is_no_time_without_blinks() -> None:
    recorded = Recorded([2.0, 5.0, 8.0], lost_s=(10.0, 16.0))
    assert 3 == value(blink_count(), recorded, 0, 20)
    assert pytest.approx(3 / 14 * 60, rel=0.03) == value(blink_rate(), recorded, 0, 20)
    assert None is value(blink_count(), Recorded([2.0], lost_s=(4.0, 16.0)), 0, 20)
    assert 0 == value(blink_count(), recorded, 20, 40)


def test_blinks_while_a_scene_is_shown_are_those_of_the_scene() -> None:
    recorded = Recorded([0.6, 5.0])
    assert (2, 1) == (value(blink_count(), recorded), value(blink_count("scene"), recorded))
    assert None is value(blink_count("other"), recorded)


def test_without_a_pupil_blinks_are_missing() -> None:
    recorded = Recorded([2.0])
    del recorded.columns["left_pupil_mm"]
    assert None is value(blink_count(), recorded)
    recorded = Recorded([2.0])
    recorded.columns["left_pupil_mm"] = np.full(len(T_NS), np.nan)
    assert None is value(blink_rate(), recorded)
    recorded = Recorded([2.0])
    recorded.stream_names = ()
    assert None is value(blink_rate(), recorded)
    assert None is value(blink_rate(), None)
