"""From gaze samples to a trial's row."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.experiments.stare.performance import perform
from visavis.experiments.stare.design import StareParameters
from visavis.experiments.stare.study import plan_session
from visavis.experiments.stare.trial import run_trial
from visavis.lab.errors import DataError, DesignError
from visavis.stimuli.scenes.audience import PLACES
from visavis.study.look_measures import (
    LOOK_COLUMNS,
    MAIN_MEASURES,
    GazeTargets,
    second_view,
    sensitivity_rows,
    trial_measures,
)
from visavis.study.measures import TrialRecord, dwell_on

MS = 1_000_000
ACTIVE = PLACES.index("centre_far")
OTHER = PLACES.index("left_close")
PARAMS = StareParameters(trial_s=4.0)
STEP_MS = 8.333333


def measured(condition: str, look: Any) -> tuple[GazeTargets, dict[str, Any]]:
    template = plan_session(0, 1).trials[1]
    factors = {"condition": condition, "place": "centre_far", "zone": "centre", "depth": "far"}
    done = perform(run_trial(replace(template, factors=factors), PARAMS), look)
    return GazeTargets.from_columns(done.recorded()), dict(done.row)


def on_between(*spans_ms: tuple[float, float]) -> Any:
    return lambda t: ACTIVE if any(a * MS <= t < b * MS for a, b in spans_ms) else OTHER


def test_two_looks_and_a_glance_become_two_fixations_and_a_glance() -> None:
    targets, row = measured("D", on_between((500, 800), (1500, 1600), (2000, 2500)))
    measures = trial_measures(targets, row)

    assert pytest.approx(900, abs=3 * STEP_MS) == measures["dwell_ms"]
    assert pytest.approx(800, abs=3 * STEP_MS) == measures["dwell_in_fixations_ms"]
    assert (2, 1) == (measures["fixation_count"], measures["glance_count"])
    assert pytest.approx(500, abs=STEP_MS) == measures["first_fixation_time_ms"]
    assert pytest.approx(300, abs=STEP_MS) == measures["first_fixation_duration_ms"]
    assert pytest.approx(2000, abs=STEP_MS) == measures["second_fixation_time_ms"]
    assert pytest.approx(500, abs=STEP_MS) == measures["second_fixation_duration_ms"]
    assert pytest.approx(480, abs=1) == measures["gaze_samples"]


def test_agent_never_looked_at_has_no_dwell_and_no_fixation_times() -> None:
    measures = trial_measures(*measured("D", lambda _: OTHER))

    assert (0.0, 0) == (measures["dwell_ms"], measures["fixation_count"])
    assert measures["first_fixation_time_ms"] is None
    assert measures["second_fixation_duration_ms"] is None


def test_trial_without_gaze_is_lost_and_has_zero_dwell() -> None:
    measures = trial_measures(*measured("AD", lambda _: -2))

    assert (1.0, 0.0, 0) == (measures["lost_01"], measures["dwell_ms"], measures["fixation_count"])
    assert measures["first_fixation_time_ms"] is None


def test_parts_exist_only_where_a_gaze_changed_and_sum_to_the_whole() -> None:
    static = trial_measures(*measured("D", on_between((500, 800))))
    targets, row = measured("AD", on_between((500, 800), (2000, 2500)))
    measures = trial_measures(targets, row)

    assert static["before_dwell_ms"] is None
    assert static["after_fixation_count"] is None
    parts = float(measures["before_dwell_ms"]) + float(measures["after_dwell_ms"])  # type: ignore[arg-type]
    assert pytest.approx(measures["dwell_ms"], abs=1e-6) == parts
    # The change comes with the first sample of the look, so most of it lies after.
    assert 0 < float(measures["before_dwell_ms"]) < 40  # type: ignore[arg-type]
    assert 2 == measures["after_fixation_count"]


def test_samples_of_neighbouring_trials_do_not_count() -> None:
    targets, row = measured("D", lambda _: ACTIVE)
    later = replace(targets, t_ns=targets.t_ns + 60_000 * MS)
    both = GazeTargets(
        **{
            name: np.concatenate([getattr(targets, name), getattr(later, name)])
            for name in targets.__dataclass_fields__
            if getattr(targets, name) is not None
        }
    )

    assert trial_measures(targets, row) == trial_measures(both, row)
    assert pytest.approx(4000) == trial_measures(both, row)["dwell_ms"]


def test_raw_ray_needs_the_ray_on_the_head_and_padding_does_not() -> None:
    targets, row = measured("D", on_between((500, 1000)))
    shifted = replace(targets, hit=np.where(targets.hit == ACTIVE, -1, targets.hit))
    angle = targets.angle_deg.copy()
    on = targets.hit == ACTIVE
    angle[on, ACTIVE] = targets.radius_deg[on, ACTIVE] + 0.5
    measures = trial_measures(replace(shifted, angle_deg=angle), row)

    assert 0.0 == measures["raw_dwell_ms"]
    assert pytest.approx(500, abs=STEP_MS) == measures["dwell_ms"]


def test_sensitivity_table_varies_padding_and_minimum_duration() -> None:
    targets, row = measured("D", on_between((500, 620), (1000, 1180), (2000, 2500)))
    rows = list(sensitivity_rows(targets, row))
    by = {(r["pad_deg"], r["minimum_fixation_ms"]): r for r in rows}

    assert 15 == len(rows) == len(by)
    assert [3, 2, 1] == [by[1.0, m]["fixation_count"] for m in (100.0, 150.0, 200.0)]
    main = trial_measures(targets, row)
    assert {n: main[n] for n in MAIN_MEASURES} == {n: by[1.0, 150.0][n] for n in MAIN_MEASURES}


def test_second_view_counts_fixations_everywhere_and_on_the_active_agent() -> None:
    targets, row = measured("D", on_between((1000, 1500), (2500, 3200)))
    measures = second_view(targets, row)

    assert (5, 2) == (measures["ivt_fixation_count"], measures["ivt_on_active_count"])
    assert (5, 2) == (measures["idt_fixation_count"], measures["idt_on_active_count"])
    assert pytest.approx(800, rel=0.1) == measures["ivt_mean_fixation_ms"]
    assert (5, 2) == (measures["adaptive_fixation_count"], measures["adaptive_on_active_count"])
    assert (4, "engbert_kliegl") == (
        measures["adaptive_saccade_count"],
        measures["adaptive_detector"],
    )


def test_second_view_counts_rests_two_degrees_apart_one_by_one() -> None:
    targets, row = measured("D", lambda _: ACTIVE)
    seconds = (targets.t_ns - targets.t_ns[0]) / 1e9
    at = np.radians(np.where(seconds < 2.0, 0.0, 2.0))
    direction = np.stack([np.sin(at), np.zeros_like(at), -np.cos(at)], axis=1)
    stepped = replace(targets, direction_world=direction, valid=np.ones(len(seconds), np.bool_))

    assert 2 == second_view(stepped, row)["ivt_fixation_count"]


def test_head_that_carries_a_resting_eye_makes_no_saccade() -> None:
    targets, row = measured("D", lambda _: ACTIVE)
    seconds = (targets.t_ns - targets.t_ns[0]) / 1e9
    swept = np.radians(np.clip(80.0 * (seconds - 1.0), 0.0, 40.0))  # half a second at 80 deg/s
    carried = np.stack([np.sin(swept), np.zeros_like(swept), -np.cos(swept)], axis=1)
    still = np.broadcast_to([0.0, 0.0, -1.0], carried.shape)
    moved = replace(targets, direction_world=carried, valid=np.ones(len(seconds), np.bool_))

    assert 1 == second_view(moved, row)["adaptive_saccade_count"]
    told = second_view(replace(moved, direction_head=still), row)
    assert 0 == told["adaptive_saccade_count"]
    assert 0.1 < float(told["adaptive_pursuit_share_01"]) < 0.2  # type: ignore[arg-type]


def test_second_view_of_a_lost_trial_has_no_fixations_and_no_mean() -> None:
    measures = second_view(*measured("D", lambda _: -2))

    assert (0, None) == (measures["ivt_fixation_count"], measures["ivt_mean_fixation_ms"])
    assert (0, None) == (measures["idt_fixation_count"], measures["idt_mean_fixation_ms"])
    assert (0, 0) == (measures["adaptive_fixation_count"], measures["adaptive_saccade_count"])


def test_repeated_rows_change_nothing_but_their_count() -> None:
    targets, row = measured("D", on_between((500, 800)))
    twice = np.sort(np.append(np.arange(targets.t_ns.shape[0]), [100, 200]))
    doubled = GazeTargets(
        **{
            name: getattr(targets, name)[twice]
            for name in targets.__dataclass_fields__
            if getattr(targets, name) is not None
        }
    )
    once, again = trial_measures(targets, row), trial_measures(doubled, row)

    assert 2 == again["repeated_samples"]
    assert once["dwell_ms"] == again["dwell_ms"]
    assert second_view(targets, row) == second_view(doubled, row)


def test_dictionary_describes_every_column_and_no_other() -> None:
    targets, row = measured("AD", on_between((500, 800)))
    columns = [*trial_measures(targets, row), *second_view(targets, row), "frozen_samples"]

    assert sorted(c.name for c in LOOK_COLUMNS) == sorted(columns)
    assert all(c.unit == "ms" for c in LOOK_COLUMNS if c.name.endswith("_ms"))


def test_missing_stream_column_is_named() -> None:
    with pytest.raises(DataError, match="hit"):
        GazeTargets.from_columns({"t_sample_ns": np.empty(0, np.int64)})


def test_interrupted_trial_cannot_be_measured() -> None:
    targets, row = measured("D", lambda _: OTHER)

    with pytest.raises(DataError, match="T07"):
        trial_measures(targets, {"trial_id": "T07", "t_start_ns": row["t_start_ns"]})


def test_switch_missing_as_nan_means_no_parts() -> None:
    targets, row = measured("D", on_between((500, 800)))

    assert trial_measures(targets, {**row, "switch_ns": float("nan")})["before_dwell_ms"] is None


def test_a_role_that_nobody_has_is_refused_with_those_there_are():
    row = {"trial_id": "T01", "scene_on_ns": 0, "scene_off_ns": 9, "scene_active": 0}
    with pytest.raises(DesignError, match="nobody is 'person' in scene 'scene'; roles are: active"):
        dwell_on("person").of(TrialRecord(row, None))
    assert dwell_on("person").of(TrialRecord({"trial_id": "P1"}, None)) is None
