import pandas as pd
import pytest

from visavis.experiments.stare.sections import gaze_changes

MS = 1_000_000


def trial(condition="AD", cause="look", look_ms=500.0, fixation_ms=500.0, duration_ms=300.0):
    start = 7_000_000_000
    return {
        "condition": condition,
        "switch_cause": cause,
        "t_start_ns": start,
        "look_ns": None if look_ms is None else start + int(look_ms * MS),
        "first_fixation_time_ms": fixation_ms,
        "first_fixation_duration_ms": duration_ms,
    }


def test_change_by_the_look_that_became_a_fixation_is_counted():
    found = gaze_changes(
        pd.DataFrame(
            [
                trial(),
                trial("DA", fixation_ms=900.0),  # a glance came first
                trial("DA", fixation_ms=None, duration_ms=None),  # only a glance
                trial("AD", look_ms=650.0),  # a trigger that waits, within the fixation
                trial("AD", "time", None, 9000.0),
                trial("A", None, None),
            ]
        )
    )

    assert (found.by_look, found.by_time, found.began_fixation) == (4, 1, 2)
    assert found.share_01 == pytest.approx(0.5)
    assert "2 of these 4 looks (50 %)" in found.sentence()


def test_table_without_causes_gives_nothing():
    assert gaze_changes(pd.DataFrame({"condition": ["AD"]})) is None


def test_no_change_by_a_look_is_said():
    found = gaze_changes(pd.DataFrame([trial("AD", "time", None)]))

    assert "time did" in found.sentence()
