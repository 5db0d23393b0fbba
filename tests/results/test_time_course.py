"""Looks over time: steps of a trial, and people by condition."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis.analysis.gaze.targets import GazeTargets
from visavis.results.figures.time_course_figure import time_course_figure
from visavis.results.selection import Selection
from visavis.results.time_course import TIME_COURSE, with_time_course
from visavis.study.look_course import look_course
from visavis.study.texts import Texts

MS = 1_000_000
HZ = 100


def targets(on: list[bool], valid: list[bool] | None = None, *, begin_ms: int = 0) -> GazeTargets:
    n = len(on)
    is_valid = np.ones(n, np.bool_) if valid is None else np.array(valid)
    angle = np.where(np.array(on), 0.5, 30.0)[:, None]
    hit = np.where(np.array(on), 0, -1).astype(np.int16)
    direction = np.tile([0.0, 0.0, -1.0], (n, 1))
    stamps = (np.arange(n) * 1000 // HZ + begin_ms).astype(np.int64) * MS
    radius, limit = np.full((n, 1), 2.0), np.full((n, 1), 90.0)
    return GazeTargets(stamps, is_valid, direction, angle, radius, limit, hit)


def row(end_ms: int, begin_ms: int = 0) -> dict[str, Any]:
    return {"active_index": 0, "t_start_ns": begin_ms * MS, "t_end_ns": end_ms * MS}


def shares(gaze: GazeTargets, end_ms: int, begin_ms: int = 0) -> list[object]:
    return [step["on_agent_01"] for step in look_course(gaze, row(end_ms, begin_ms))]


def test_a_step_holds_the_share_of_its_own_samples() -> None:
    on = [True] * 25 + [False] * 25 + [i % 5 == 0 for i in range(25)]
    assert [1.0, 0.0, 0.2] == shares(targets(on), 750)
    assert [125.0, 375.0, 625.0] == [s["t_ms"] for s in look_course(targets(on), row(750))]


def test_a_step_without_usable_gaze_is_missing_and_lost_samples_do_not_count() -> None:
    on, valid = [True] * 50, [True] * 10 + [False] * 40
    assert [1.0, None] == shares(targets(on, valid), 500)


def test_the_sample_before_the_start_is_of_no_step() -> None:
    on = [True] + [False] * 25
    assert [0.0] == shares(targets(on, begin_ms=90), 350, begin_ms=100)


@pytest.mark.parametrize(("end_ms", "steps"), [(600, 2), (625, 3), (740, 3)])
def test_a_last_step_counts_from_half_its_length_on(end_ms: int, steps: int) -> None:
    assert steps == len(shares(targets([True] * 80), end_ms))


def by_trial(*rows: tuple[str, str, float, float | None]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {
                "participant": who,
                "session": 1,
                "trial_id": trial,
                "attempt": 1,
                "t_ms": t_ms,
                "on_agent_01": on,
            }
            for who, trial, t_ms, on in rows
        ]
    )


def selection(*trials: tuple[str, str, str]) -> Selection:
    rows = pd.DataFrame(
        [
            {
                "participant": who,
                "session": 1,
                "trial_id": trial,
                "attempt": 1,
                "condition": condition,
                "is_analysed": True,
                "status": "complete",
                "is_practice": False,
            }
            for who, trial, condition in trials
        ]
    )
    return Selection(rows, pd.DataFrame(), len(rows), (), {})


def test_only_trials_that_count_enter_each_with_the_same_weight() -> None:
    course = by_trial(
        ("07K", "T01", 125.0, 1.0),
        ("07K", "T02", 125.0, 0.0),
        ("07K", "T03", 125.0, 1.0),  # of a trial that does not count
        ("07K", "T02", 375.0, None),
    )
    chosen = selection(("07K", "T01", "A"), ("07K", "T02", "A"))
    tables = with_time_course({TIME_COURSE: course}, chosen, ["condition"])
    expected = pd.DataFrame(
        {
            "participant": ["07K"],
            "condition": ["A"],
            "t_ms": [125.0],
            "on_agent_01": [0.5],
            "trials": [2],
        }
    )
    pd.testing.assert_frame_equal(expected, tables[TIME_COURSE])


def test_shares_are_drawn_up_to_one_and_intervals_where_enough_people_are_left() -> None:
    """Four people look for a step, two of them for two."""
    rows = [(f"S{i}", t_ms, float(i % 2)) for i in range(4) for t_ms in (125.0, 375.0)]
    course = pd.DataFrame(
        [(who, "A", t, on, 1) for who, t, on in rows if t < 200 or who < "S2"],
        columns=["participant", "condition", "t_ms", "on_agent_01", "trials"],
    )
    found: Any = SimpleNamespace(
        tables={TIME_COURSE: course},
        levels={"condition": ["A"]},
        selection=selection(("S0", "T01", "A")),
        is_simulated=False,
        study=SimpleNamespace(analysis=SimpleNamespace(looks=())),
    )
    figure = time_course_figure(found, Texts("none", {}))
    assert figure is not None
    axes = figure.figure.axes[0]
    assert 1.02 >= axes.get_ylim()[1]
    with_interval_s = {x for path in axes.collections[0].get_paths() for x in path.vertices[:, 0]}
    assert 0.375 not in with_interval_s
    assert "Share of gaze on people" == axes.get_ylabel()


def test_without_looks_there_is_no_table() -> None:
    assert {} == with_time_course({TIME_COURSE: pd.DataFrame()}, selection(), ["condition"])
