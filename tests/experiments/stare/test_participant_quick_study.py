import numpy as np
import pytest

from benchmarks.simulated_tracker import tracker_of
from experiments.stare.design import CONDITIONS, StareParameters
from experiments.stare.quick_study import anxiety_total, run_study
from visavis.looks import MAIN_MEASURES
from visavis.observer import Observer


@pytest.fixture(scope="module")
def study():
    return run_study(tracker_of, seed=3, participants=range(3))


def test_every_trial_of_the_design_is_performed(study) -> None:
    assert len(study.trials) == 3 * 72
    counts = study.trials.groupby(["participant", "condition"]).size()
    assert set(counts) == {18}


def test_same_seed_gives_the_same_study(study) -> None:
    again = run_study(tracker_of, seed=3, participants=[1])
    before = study.trials[study.trials["participant"] == "001"].reset_index(drop=True)
    assert before.equals(again.trials)


def test_fixation_times_are_missing_when_there_was_no_fixation(study) -> None:
    none = study.trials["fixation_count"] == 0
    assert none.any()
    assert study.trials.loc[none, "first_fixation_time_ms"].isna().all()
    assert study.trials.loc[~none, "first_fixation_time_ms"].notna().all()


def test_gaze_changes_in_the_dynamic_conditions_only_and_by_half_time(study) -> None:
    changes = study.trials.groupby("condition")["switch_ms"]
    assert changes.count().to_dict() == {"A": 0, "AD": 54, "D": 0, "DA": 54}
    assert study.trials["switch_ms"].max() <= 8000 + 2 * 1000 / 90
    assert study.trials["switch_ms"].min() > 0


def test_blinks_cost_some_gaze_but_not_much(study) -> None:
    assert 0.005 < study.trials["lost_01"].mean() < 0.10


def test_contact_raises_dwell_and_fixation_count(study) -> None:
    means = study.trials.groupby("condition")[["dwell_ms", "fixation_count"]].mean()
    assert means.loc["D", "dwell_ms"] > 1.5 * means.loc["A", "dwell_ms"]
    assert means.loc["D", "fixation_count"] > 1.2 * means.loc["A", "fixation_count"]


def test_without_the_effect_measures_do_not_depend_on_the_condition() -> None:
    by_condition = {}
    for condition in CONDITIONS:
        study = _one_condition(condition)
        by_condition[condition] = study.trials[list(MAIN_MEASURES)].to_numpy()
    for condition in CONDITIONS[1:]:
        np.testing.assert_array_equal(by_condition["A"], by_condition[condition])


def _one_condition(condition: str):
    """Simulate a study in which every trial has this condition, places unchanged."""
    import experiments.stare.quick_study as quick

    original = quick.plan_session

    def plan(index: int, seed: int, *, params: StareParameters):
        from dataclasses import replace

        made = original(index, seed, params=params)
        blocks = tuple(
            replace(
                b,
                trials=tuple(
                    replace(t, factors={**t.factors, "condition": condition}) for t in b.trials
                ),
            )
            for b in made.blocks
        )
        return replace(made, blocks=blocks)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(quick, "plan_session", plan)
        return run_study(tracker_of, seed=5, participants=[0], effect=False)


def test_anxiety_total_lies_on_the_scale() -> None:
    totals = [anxiety_total(Observer(i, 1)) for i in range(20)]
    assert all(0 <= t <= 144 for t in totals)
    assert len(set(totals)) > 10
