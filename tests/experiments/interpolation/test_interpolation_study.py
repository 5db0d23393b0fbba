"""The study of interpolated gestures: its motions, its raters, and what the source prints."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from visavis.analysis.report import Table
from visavis.analysis.statistics import oneway_anova, tukey_hsd
from visavis.analysis.statistics.results import Array
from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.interpolation import published
from visavis.experiments.interpolation.gestures import (
    GESTURES,
    KEYS,
    METHODS,
    keys_of,
    motion_of,
    seconds_of,
    source_of,
)
from visavis.experiments.interpolation.sections import subset_table
from visavis.experiments.interpolation.study import ERROR_SD, PERSON_SD, naturalness_of, study
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study
from visavis.stimuli.motion.clip import placed_joints
from visavis.stimuli.motion.interpolation import Method

MAX_KEY_ERROR_M = 1e-9
MAX_OFF_M = 0.15


def test_two_printed_means_cannot_come_from_whole_numbers() -> None:
    assert (
        ("female", "slerp", "2.8414"),
        ("metaphoric", "squad", "3.2989"),
    ) == published.impossible_means()


def test_one_spread_explains_the_printed_p_values() -> None:
    floor_of_r = "2e-16"
    spread = [published.pooled_sd(s) for s in published.SUBSETS if s.p != floor_of_r]
    assert pytest.approx(1.05, abs=0.15) == np.array(spread)


@pytest.mark.parametrize("gesture", GESTURES)
def test_every_method_passes_through_the_same_key_poses(gesture: str) -> None:
    source, keys = source_of(gesture), keys_of(gesture)
    assert KEYS == len(keys)
    t_s = source.frame_times_s[list(keys)]
    expected = placed_joints(source, t_s).position_m
    for method in METHODS:
        found = placed_joints(motion_of(gesture, method), t_s).position_m
        assert float(np.abs(found - expected).max()) < MAX_KEY_ERROR_M, method


@pytest.mark.parametrize("gesture", GESTURES)
def test_no_method_strays_from_slerp_as_angles_taken_pose_by_pose_would(gesture: str) -> None:
    t_s = np.arange(0.0, seconds_of(gesture), 1 / 60)
    slerp = placed_joints(motion_of(gesture, "slerp"), t_s).position_m
    other = placed_joints(motion_of(gesture, "lineuler"), t_s).position_m
    assert float(np.linalg.norm(other - slerp, axis=-1).max()) < MAX_OFF_M


@pytest.fixture(scope="module")
def judged() -> pd.DataFrame:
    opened = OpenedStudy(study)
    return quick_study(opened, opened.experiment({}), tracker_of, range(97), seed=3).trials


def rated(gesture: str) -> tuple[Array, Array]:
    """Return mean and standard deviation of ratings of a gesture by method, as raters expect."""
    seconds = round(seconds_of(gesture), 3)
    felt = np.array([naturalness_of(motion_of(gesture, method), seconds) for method in METHODS])
    below = stats.norm.cdf(
        (np.arange(1.5, 5.0)[:, None] - felt) / float(np.hypot(PERSON_SD, ERROR_SD))
    )
    shares = np.diff(np.vstack([np.zeros_like(felt), below, np.ones_like(felt)]), axis=0)
    levels = np.arange(1, 6)[:, None]
    mean = (shares * levels).sum(axis=0)
    return mean, np.sqrt((shares * (levels - mean) ** 2).sum(axis=0))


@pytest.mark.parametrize("gesture", GESTURES)
def test_simulated_raters_expect_what_is_printed_of_every_gesture(gesture: str) -> None:
    (printed,) = (s for s in published.SUBSETS if s.gesture == gesture)
    means = np.array([float(mean) for mean in printed.means])
    found, sd = rated(gesture)
    assert pytest.approx(means, abs=0.2) == found
    assert means[2] - means[:2].max() == pytest.approx(found[2] - found[:2].max(), abs=0.15)
    assert published.pooled_sd(printed) == pytest.approx(sd.mean(), abs=0.035)


def test_simulated_raters_give_means_near_the_printed_ones(judged: pd.DataFrame) -> None:
    means = judged.groupby("method")["naturalness"].mean()
    printed = dict(zip(METHODS, map(float, published.SUBSETS[1].means), strict=True))
    assert {m: pytest.approx(v, abs=0.2) for m, v in printed.items()} == dict(means)
    assert pytest.approx(1.03, abs=0.1) == judged.groupby("method")["naturalness"].std().mean()


def test_raters_see_the_motion_and_not_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    swapped: dict[str, Method] = {"lineuler": "squad", "slerp": "slerp", "squad": "lineuler"}
    monkeypatch.setattr(
        "visavis.experiments.interpolation.study.motion_of", lambda g, m: motion_of(g, swapped[m])
    )
    opened = OpenedStudy(study)
    rows = quick_study(opened, opened.experiment({}), tracker_of, range(97), seed=3).trials
    means = rows.groupby("method")["naturalness"].mean()
    printed = dict(zip(METHODS, map(float, published.SUBSETS[1].means), strict=True))
    assert {m: pytest.approx(printed[swapped[m]], abs=0.2) for m in METHODS} == dict(means)


def test_the_source_s_analysis_finds_squad_above_both_and_no_more(judged: pd.DataFrame) -> None:
    assert oneway_anova(judged, "naturalness", factor="method", levels=METHODS).p < 1e-9
    pairs = tukey_hsd(judged, "naturalness", factor="method", levels=METHODS)
    found = {frozenset(c.label.split(" − ")): c.p_adjusted for c in pairs.contrasts}
    assert found[frozenset(("squad", "slerp"))] < 0.05
    assert found[frozenset(("squad", "lineuler"))] < 0.05
    assert found[frozenset(("slerp", "lineuler"))] > 0.05


def ratings(gap: dict[str, float]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return ratings and people: novice men and experienced women, by how far Squad is above."""
    rows, people = [], []
    rng = np.random.default_rng(4)
    for k in range(24):
        kind = "novice" if k % 2 else "experienced"
        people.append(
            {
                "participant": f"P{k}",
                "gender": 2 if k % 2 else 1,
                "animation_experience": 1 if k % 2 else 4,
            }
        )
        for gesture in GESTURES:
            for method in METHODS:
                above = gap[kind] if method == "squad" else 0.0
                rows.append(
                    {
                        "participant": f"P{k}",
                        "gesture": gesture,
                        "method": method,
                        "naturalness": 3.0 + above + 0.5 * rng.standard_normal(),
                    }
                )
    return pd.DataFrame(rows), pd.DataFrame(people)


def test_experience_gender_and_gesture_are_analysed_as_one_family_beside_what_is_printed() -> None:
    rows, people = ratings({"novice": 0.0, "experienced": 1.0})
    (table,) = subset_table(rows, people)
    assert isinstance(table, Table)
    of = {str(row[0]): row for row in table.rows}
    assert {"main", "novice", "experienced", "male", "female", *GESTURES} == set(of)
    assert ("12", "12", "24") == (of["novice"][1], of["experienced"][1], of["beat"][1])
    assert "< .001" == of["experienced"][5] == of["female"][5]
    assert not str(of["novice"][5]).startswith("<")
    assert "1.13e-11" == of["female"][-1]


def test_groups_that_nobody_named_have_no_row_and_nobody_is_guessed_into_one() -> None:
    rows, people = ratings({"novice": 1.0, "experienced": 1.0})
    (table,) = subset_table(rows, people[["participant"]])
    assert isinstance(table, Table)
    assert {"main", *GESTURES} == {str(row[0]) for row in table.rows}


def test_who_works_with_animation_tells_the_methods_further_apart(judged: pd.DataFrame) -> None:
    opened = OpenedStudy(study)
    experiment = opened.experiment({})
    works = {
        name: opened.participant(k, 3, effect=True, experiment=experiment).answer(
            "animation_experience", "", ["none", "tried", "studied", "work"]
        )
        == "work"
        for k, name in enumerate(dict.fromkeys(judged["participant"]))
    }
    means = judged.groupby([judged["participant"].map(works), "method"])["naturalness"].mean()
    gap = means.unstack()["squad"] - means.unstack()["lineuler"]
    assert 0.25 < gap[True] - gap[False] < 1.0  # printed: 1.25 and 0.69
    assert 0.1 < np.mean(list(works.values())) < 0.4
