"""Psychometric functions: their fit, what they leave missing, and the way to a report."""

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm

from tests.study.simulated_study import simulate_and_analyse
from visavis.analysis.psychometric import NoFitError, fit_psychometric, share_right
from visavis.lab.errors import DesignError
from visavis.study.measures import aggregate_cells
from visavis.study.psychometric import Psychometric, psychometric_measures

LEVELS = np.tile(np.geomspace(0.02, 0.1, 6), 10)
SYMMETRIC = np.tile(np.linspace(-4, 6, 6), 10)


def fits(threshold, slope, lapse, *, guess=0.5, function="weibull", levels=LEVELS, count=60):
    """Return the functions of simulated people at constant levels."""
    rng = np.random.default_rng(5)
    right = share_right(levels, threshold, slope, guess, lapse, function)
    answers = rng.random((count, levels.size)) < right
    return [fit_psychometric(levels, own, function=function, guess=guess) for own in answers]


@pytest.mark.parametrize(
    ("planted", "within", "more"),
    [
        ((0.05, 3.0, 0.02), 0.05 * 0.05, {}),
        # A mean of levels has no ratio: within a tenth of the function's standard deviation.
        ((1.0, 2.0, 0.02), 0.2, {"function": "normal", "guess": 0.0, "levels": SYMMETRIC}),
    ],
    ids=["weibull", "normal"],
)
def test_a_planted_threshold_is_found_again_in_sixty_trials(planted, within, more):
    threshold, slope, lapse = planted
    found = fits(threshold, slope, lapse, **more)
    assert threshold == pytest.approx(np.median([f.threshold for f in found]), abs=within)
    inside = [f.threshold_low <= threshold <= f.threshold_high for f in found]
    assert 0.9 <= np.mean(inside) <= 1.0


def test_without_guesses_and_lapses_it_is_the_probit_model_of_statsmodels():
    rng = np.random.default_rng(1)
    levels = np.tile(np.linspace(-4, 6, 11), 200)
    right = rng.random(levels.size) < share_right(levels, 1.0, 2.0, 0, 0, "normal")
    link = sm.families.links.Probit()
    model = sm.GLM(right, sm.add_constant(levels), sm.families.Binomial(link)).fit()
    constant, rise = model.params
    fit = fit_psychometric(levels, right, guess=0.0, lapse=0.0, function="normal")
    assert -constant / rise == pytest.approx(fit.threshold, abs=0.01)
    assert 1 / rise == pytest.approx(fit.slope, rel=0.01)
    low, high = 1 / (rise + 1.96 * model.bse[1]), 1 / (rise - 1.96 * model.bse[1])
    assert (low, high) == pytest.approx((fit.slope_low, fit.slope_high), rel=0.02)


def test_lapses_and_guesses_are_estimated_where_they_are_not_given():
    levels = np.tile(np.linspace(-6, 8, 15), 100)
    share = share_right(levels, 1.0, 1.5, 0.2, 0.08, "normal")
    right = np.random.default_rng(3).random(levels.size) < share
    fit = fit_psychometric(levels, right, guess=None, function="normal")
    assert 0.2 == pytest.approx(fit.guess_01, abs=0.03)
    assert 0.08 == pytest.approx(fit.lapse_01, abs=0.03)


@pytest.mark.parametrize(
    ("levels", "right", "says"),
    [
        ([0.1] * 9, [True] * 9, "9 answers; a fit needs 10"),
        ([0.1] * 20, [True, False] * 10, "at one level, 0.1"),
        ([0.1, 0.2] * 10, [True] * 20, "all answers are right"),
        ([0.1, 0.2] * 10, [False] * 20, "all answers are wrong"),
        ([0.0, 0.2] * 10, [False, True] * 10, "levels above 0"),
        ([0.1, 0.2] * 20, [True, False, False, True] * 10, "above the levels shown"),
        ([np.nan, 0.2] * 9, [True, False] * 9, "9 answers"),
    ],
)
def test_answers_that_lead_to_no_function_say_why_and_give_no_number(levels, right, says):
    with pytest.raises(NoFitError, match=says):
        fit_psychometric(levels, right)


@pytest.mark.parametrize(
    ("keywords", "says"),
    [
        ({"name": "a b"}, "letters"),
        ({"function": "logit"}, "'weibull' or 'normal'"),
        ({"guess": 0.5, "lapse": 0.5}, "below 1"),
        ({"guess": -0.1}, "0 or more"),
    ],
)
def test_a_function_that_cannot_be_is_refused(keywords, says):
    with pytest.raises(DesignError, match=says):
        Psychometric(**{"name": "contrast", **keywords})


def trials_of(people, seed=0):
    """Return trials of people at constant levels, two sides each."""
    rng, rows = np.random.default_rng(seed), []
    for person in range(people):
        for side, threshold in (("left", 0.04), ("right", 0.06)):
            right = rng.random(LEVELS.size) < share_right(LEVELS, threshold, 3, 0.5, 0.02)
            rows += [
                {"participant": f"{person:02}", "side": side, "contrast": level, "ok": bool(r)}
                for level, r in zip(LEVELS, right, strict=True)
            ]
    return pd.DataFrame(rows)


def test_the_number_of_a_cell_is_fitted_to_all_its_trials_and_is_missing_for_single_levels():
    trials = trials_of(2)
    trials.loc[trials["participant"] == "01", "ok"] = True
    measures = psychometric_measures(Psychometric("seen", "contrast", "ok"))
    means = aggregate_cells(trials, measures, ["side"])
    own = trials[(trials["participant"] == "00") & (trials["side"] == "left")]
    assert fit_psychometric(own["contrast"], own["ok"]).threshold == pytest.approx(
        means["seen_fit_threshold"].iloc[0]
    )
    assert means["seen_fit_threshold"].isna().tolist() == [False, False, True, True]
    assert "seen_fit_threshold" not in aggregate_cells(trials, measures, ["contrast"])


STUDY = """
import numpy as np
from visavis import *
CONTRAST = Psychometric("seen", "strength", "answer_is_right")
study = Study(
    "constant", factors=[Factor("strength", [0.006, 0.015, 0.035, 0.1]), Factor("cycles", [2, 8])],
    repetitions=5, calibrate=False, measures=[*psychometric_measures(CONTRAST)],
    compare=[
        Compare("seen_fit_threshold", within="cycles", expects="8 > 2"),
        Compare("seen_fit_slope", within="strength"),
    ],
)

@study.trial
def trial(t):
    side = "left" if t.rng().random() < 0.5 else "right"
    patch = Grating(4, t.cycles, t.strength, at_deg=(-5 if side == "left" else 5, 0))
    keys = Keys("left", "right", right=side)
    yield t.show(patch, 0.2, until=keys, limit_s=3, background="grey")

@study.answer
def answer(seen, response, rng):
    patch = seen.stimuli[0]
    sees = rng.random() < 1 - np.exp(-((patch.contrast_01 / 0.01 / patch.cycles_per_deg**0.5) ** 3))
    side = "left" if patch.at_deg[0] < 0 else "right"
    return side if sees else str(rng.choice(response.options))
"""


def test_constant_stimuli_lead_to_functions_in_tables_and_report(tmp_path):
    folder = simulate_and_analyse(tmp_path / "constant.py", STUDY, participants=4)
    functions = pd.read_csv(folder / "derived" / "psychometric.csv", dtype={"participant": str})
    assert 4 * 2 + 2 == len(functions)
    of_all = functions[functions["fitted_to"] == "everybody"].set_index("cycles")
    for cycles in (2, 8):
        row = of_all.loc[cycles]
        assert row["threshold_low"] < 0.01 * cycles**0.5 < row["threshold_high"]
        assert 4 * 4 * 5 == row["trials"]
    statistics = pd.read_csv(folder / "derived" / "statistics.csv")
    by_measure = statistics.set_index("measure")
    assert by_measure.loc["seen_fit_threshold", "is_tested"]
    assert "fitted over strength" in by_measure.loc["seen_fit_slope", "why_not"]
    report = (folder / "derived" / "report.html").read_text("utf-8")
    assert "Psychometric functions of seen" in report
    assert (folder / "derived" / "figures" / "psychometric_seen.svg").exists()
