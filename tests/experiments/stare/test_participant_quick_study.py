from dataclasses import replace

import numpy as np
import pytest

from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.stare.design import (
    CONDITIONS,
    DEFAULT_PARAMETERS,
    MAX_AGENTS,
    MIN_AGENTS,
    StareParameters,
)
from visavis.experiments.stare.quick_study import quick_trials
from visavis.experiments.stare.study import experiment_of
from visavis.experiments.stare.study import study as stare
from visavis.people.observer import Observer
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study
from visavis.stimuli.scene import SceneFrame
from visavis.study.look_measures import MAIN_MEASURES

EXPERIMENT = experiment_of()


def run_study(people, seed):
    return quick_study(OpenedStudy(stare), EXPERIMENT, tracker_of, people, seed=seed)


@pytest.fixture(scope="module")
def study():
    return run_study(range(3), 3)


def test_every_trial_of_the_design_is_performed(study) -> None:
    assert len(study.trials) == 3 * 72
    counts = study.trials.groupby(["participant", "condition"]).size()
    assert set(counts) == {18}


def test_same_seed_gives_the_same_study(study) -> None:
    again = run_study([1], 3)
    before = study.trials[study.trials["participant"] == "00001"].reset_index(drop=True)
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


@pytest.mark.parametrize("agents", [MIN_AGENTS, MAX_AGENTS])
def test_the_audience_has_as_many_agents_as_were_set(agents: int) -> None:
    person = Watching(0, 3)
    plan = experiment_of(StareParameters(agents=agents, repetitions=1)).plan(0, 3)
    params = replace(DEFAULT_PARAMETERS, agents=agents)
    next(quick_trials(person, tracker_of(3, 0), plan, params=params))
    assert {agents} == person.seen


class Watching(Observer):
    """Somebody who counts the agents of what they see, and the eyes that they are told of."""

    def see(self, view: SceneFrame, t_display_ns: int) -> None:
        self.__dict__.setdefault("seen", set())
        self.seen |= {len(view.scene.agents), len(view.gaze_direction), len(view.eye_openness_01)}
        super().see(view, t_display_ns)


def test_blinks_cost_some_gaze_but_not_much(study) -> None:
    assert 0.005 < study.trials["lost_01"].mean() < 0.10


def test_contact_raises_dwell_and_fixation_count(study) -> None:
    means = study.trials.groupby("condition")[["dwell_ms", "fixation_count"]].mean()
    assert means.loc["D", "dwell_ms"] > 1.5 * means.loc["A", "dwell_ms"]
    assert means.loc["D", "fixation_count"] > 1.2 * means.loc["A", "fixation_count"]


def test_without_the_effect_measures_do_not_depend_on_the_condition() -> None:
    by_condition = {}
    for condition in CONDITIONS:
        by_condition[condition] = _one_condition(condition)
    for condition in CONDITIONS[1:]:
        np.testing.assert_array_equal(by_condition["A"], by_condition[condition])


def _one_condition(condition: str) -> np.ndarray:
    """Return the measures of somebody blind to contact whose trials all have this condition."""
    made = EXPERIMENT.plan(0, 5)
    blocks = tuple(
        replace(
            b,
            trials=tuple(
                replace(t, factors={**t.factors, "condition": condition}) for t in b.trials
            ),
        )
        for b in made.blocks
    )
    done = quick_trials(
        Observer(0, 5, effect=False),
        tracker_of(5, 0),
        replace(made, blocks=blocks),
        params=DEFAULT_PARAMETERS,
    )
    return np.array([[own[name] for name in MAIN_MEASURES] for _, own in done], dtype=float)


def test_anxiety_total_lies_on_the_scale(study) -> None:
    totals = study.people["social_anxiety_total"].tolist()
    assert all(0 <= t <= 144 for t in totals)
    assert len(set(totals)) == 3
