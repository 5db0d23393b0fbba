"""The study of matching: its plan is the source's, its tables and tests are computed as printed."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.matching.interfaces import (
    INTERFACES,
    MIDDLE,
    PLACES,
    TARGETS,
    chosen_places,
    live_of,
    near,
    slider_names,
    target_shares,
)
from visavis.experiments.matching.outcomes import outcomes_of
from visavis.experiments.matching.published import ALL, GUESS, TIME
from visavis.experiments.matching.sections import printed_p
from visavis.experiments.matching.study import study
from visavis.lab.errors import LabError
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study
from visavis.stimuli.motion.synthesis.pose_distance import (
    MATCH_M,
    POSES,
    Likeness,
    compared_joints,
)

LEVELS = {"target": TARGETS, "interface": INTERFACES}


def plan(index: int, **settings: Any) -> list[tuple[str, str, str]]:
    """Return target, phase and interface of every trial that counts, in order."""
    made = OpenedStudy(study).experiment(settings)
    keys = ("target", "phase", "interface")
    trials = (t for t in made.plan(index, 1).trials if not t.is_practice)
    a = [tuple(str(t.factors[k]) for k in keys) for t in trials]
    return [(x[0], x[1], x[2]) for x in a]


def test_each_target_is_guessed_with_all_interfaces_before_any_is_adjusted() -> None:
    for index in range(6):
        trials = plan(index)
        assert len(trials) == 30
        for k in range(0, 30, 6):
            block = trials[k : k + 6]
            assert len({target for target, _, _ in block}) == 1
            assert [phase for _, phase, _ in block] == ["guess"] * 3 + ["adjust"] * 3
            assert [i for _, _, i in block[:3]] == [i for _, _, i in block[3:]]
    firsts = [plan(index)[3][2] for index in range(6)]
    assert {firsts.count(i) for i in INTERFACES} == {2}


def test_the_printed_order_is_offered() -> None:
    assert [i for _, _, i in plan(4, order="fixed")[3:6]] == ["weights", "adjectives", "features"]


def test_targets_are_those_that_the_rule_chooses() -> None:
    assert np.array_equal(chosen_places(), np.array(list(PLACES.values())))
    examples = live_of("adjectives").examples
    joints = compared_joints(examples.skeleton)
    assert len(joints) == 20
    for target in TARGETS:
        likeness = Likeness(examples, target_shares(target), POSES, joints)
        for interface in INTERFACES:
            live = live_of(interface)
            begun = live.shares([MIDDLE] * live.slider_count)
            assert likeness.exact_m(begun) > MATCH_M, (target, interface)
    assert near("one", 0.06).within_m == 0.06


def test_interfaces_have_four_four_and_27_sliders() -> None:
    assert [len(slider_names(i)) for i in INTERFACES] == [27, 4, 4]
    for interface in INTERFACES:
        assert live_of(interface).slider_count == len(slider_names(interface))


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    opened = OpenedStudy(study)
    return quick_study(opened, opened.experiment({}), tracker_of, range(4), seed=3).trials


def test_adjusting_begins_at_the_guess_and_is_left_out_after_a_match(rows: pd.DataFrame) -> None:
    guesses = rows[rows["phase"] == "guess"]
    adjusted = rows[rows["phase"] == "adjust"]
    keys = ["participant", "target", "interface"]
    both = guesses.merge(adjusted, on=keys, suffixes=("", "_after"))
    assert len(both) == 4 * 15
    at_once = both["is_guessed"].astype(bool)
    assert 0 < at_once.sum() < len(both)
    assert (both.loc[at_once, "time_s_after"] == 0).all()
    assert (both.loc[at_once, "guess_m"] < MATCH_M).all()
    assert both.loc[~at_once, "mould_ended_by_after"].isin(["near", "limit"]).all()
    matched = adjusted["is_matched"].astype(bool)
    assert (adjusted.loc[matched, "distance_m"] < MATCH_M).all()
    assert (adjusted.loc[~matched, "time_s"] == 300.0).all()
    own = adjusted[~matched & (adjusted["interface"] == "weights")]
    assert (own["distance_m"] >= MATCH_M).all()
    assert guesses["mould_ended_by"].isin(["button"]).all()


def test_four_sliders_lead_there_sooner_than_27(rows: pd.DataFrame) -> None:
    outcomes = outcomes_of(rows, LEVELS)
    for test in outcomes.tests("time_s"):
        if "weights" in (test.first, test.second) and test.target == ALL:
            assert test.n == 20
            assert test.p_exact < 0.001
            assert test.better != "weights"
    assert outcomes.saved("adjectives", ALL)[1] > 0
    assert 1 - outcomes.values("is_matched", "weights", ALL).mean() >= 0.6


def test_tests_are_wilcoxons_by_both_methods_beside_the_printed_p() -> None:
    rng = np.random.default_rng(1)
    made = [
        {
            "participant": f"p{k}",
            "target": target,
            "phase": "guess",
            "interface": interface,
            "guess_m": 0.05 + 0.02 * INTERFACES.index(interface) + 0.03 * rng.random(),
        }
        for k in range(13)
        for target in TARGETS
        for interface in INTERFACES
    ]
    frame = pd.DataFrame(made)
    tests = outcomes_of(frame, LEVELS).tests("guess_m")
    assert [t.n for t in tests] == [13, 13, 13, 13, 13, 65] * 3
    # All 13 differences of a sign: exactly 2 / 2^13; the normal approximation without correction.
    frame.loc[frame["interface"] == "features", "guess_m"] += 0.1
    apart = outcomes_of(frame, LEVELS).test("guess_m", "adjectives", "features", "one")
    assert apart.better == "adjectives"
    assert apart.p_exact == pytest.approx(2 / 2**13)
    assert apart.p_normal == pytest.approx(0.00147, abs=1e-5)
    assert printed_p(apart) == GUESS["adjectives", "features"][0] == 0.382
    assert TIME["adjectives", "weights"][-1] == 0.0
    # An interface that nobody has is no pair; what is equal has no p.
    two = outcomes_of(frame, {"target": TARGETS, "interface": INTERFACES[:2]})
    assert {(t.first, t.second) for t in two.tests("guess_m")} == {("adjectives", "weights")}
    frame["guess_m"] = 0.05
    assert np.isnan(
        outcomes_of(frame, LEVELS).test("guess_m", "adjectives", "weights", ALL).p_exact
    )


@pytest.mark.parametrize(
    ("name", "value"), [("start", 1.5), ("start", -0.1), ("within_m", 0.0), ("limit_s", 1.0)]
)
def test_settings_that_cannot_be_are_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(LabError, match=f"matching: {name} is {value:g}; give a number"):
        OpenedStudy(study).experiment({name: value})
