import numpy as np
import pandas as pd
import pytest

from visavis.experiments.stare.comparisons import (
    ALL_MEASURES,
    ANXIETY_TESTS,
    CONDITION_TESTS,
    DWELL,
    FIXATION_COUNT,
    MEASURES,
)
from visavis.experiments.stare.conclusions import RULE, STARED_AT, conclude
from visavis.experiments.stare.design import CONDITIONS
from visavis.results.family_tests import compare, correlate, count_agreement

PAIRS = (("A", "D"), ("A", "AD"), ("A", "DA"))


def skewed(n):
    """Differences that Shapiro-Wilk rejects at n = 8 and above: one far from the others."""
    return np.append(np.linspace(1.0, 2.0, n - 1), 5000.0)


def made_tests(difference, *, sign_of_count=1.0):
    n = len(difference)
    rng = np.random.default_rng(4)
    base = rng.normal(500, 50, n)
    frames = []
    for condition in ("A", "D", "AD", "DA"):
        lifted = base + (0 if condition == "A" else difference)
        count = base + (0 if condition == "A" else sign_of_count * difference)
        frame = pd.DataFrame({"participant": [f"S{i}" for i in range(n)], "condition": condition})
        for measure in MEASURES:
            frame[measure.column] = count if measure == FIXATION_COUNT else lifted
        frames.append(frame)
    wide = pd.concat(frames, ignore_index=True).pivot(index="participant", columns="condition")
    return [
        compare(wide[m.column], m, pair, CONDITION_TESTS, n_tests=30)
        for pair in PAIRS
        for m in (DWELL, FIXATION_COUNT)
    ]


def test_exact_signed_rank_of_eight_cannot_reach_the_threshold():
    tests = made_tests(skewed(8))

    assert not any(t.outcome.is_parametric for t in tests)
    assert tests[0].outcome.p == pytest.approx(2 / 2**8)
    assert [t.can_reach for t in tests] == [False] * 6
    assert conclude(tests, ())[0].headline == (
        "Stare-in-the-crowd effect: undecided: n = 8 cannot reach the threshold"
    )


def test_exact_signed_rank_of_eleven_reaches_the_threshold():
    tests = made_tests(skewed(11))

    assert tests[0].can_reach is True
    assert conclude(tests, ())[0].status == "found"


def test_unreachable_test_neither_agrees_nor_disagrees():
    assert str(count_agreement(made_tests(skewed(8))[:1])) == "0 of 1 (1 undecided)"


def test_the_number_of_pairs_that_were_ranked_is_told():
    difference = skewed(16)
    difference[:5] = 0.0
    (test, *_) = made_tests(difference)

    assert not test.outcome.is_parametric
    assert "n = 16, V = 0.0, z = −2.93, 11 ranked" in test.sentence()


def test_undecided_by_number_still_counts_as_tested():
    conclusion = conclude(made_tests(skewed(8)), ())[0]

    assert conclusion.status == "undecided"
    assert conclusion.is_found is False


def test_measures_that_differ_in_opposite_directions_are_mixed():
    difference = np.random.default_rng(2).normal(300, 20, 12)
    conclusion = conclude(made_tests(difference, sign_of_count=-1.0), ())[0]

    assert conclusion.answer.startswith("mixed (more dwell time, less fixation count: ")


def test_less_looking_at_directed_gaze_is_reversed():
    difference = np.random.default_rng(2).normal(-300, 20, 12)

    conclusion = conclude(made_tests(difference), ())[0]
    assert "reversed" == conclusion.status
    assert conclusion.answer == (
        "significant, but the other way round (dwell time, directed minus averted: −299 ms, "
        "95% CI [−313, −285]; "
        "fixation count, directed minus averted: −299.00, 95% CI [−312.87, −285.13])"
    )


def test_conclusion_rests_on_dwell_time_and_fixation_count():
    conclusion = conclude(made_tests(np.random.default_rng(2).normal(300, 20, 12)), ())[0]

    assert [e.split()[0] for e in conclusion.evidence] == ["Dwell", "Fixation"]
    assert all("averted minus directed" in e for e in conclusion.evidence)


def correlations(order, n):
    scores = pd.Series(np.arange(n, dtype=float), index=[f"S{i}" for i in range(n)])
    rows = [
        {"participant": f"S{i}", "condition": c, **{m.column: v for m in MEASURES}}
        for c in ("A", "D", "AD", "DA")
        for i, v in enumerate(order(c))
    ]
    return correlate(ANXIETY_TESTS, pd.DataFrame(rows), scores, ALL_MEASURES, CONDITIONS)


def test_rising_dwell_time_with_anxiety_is_reversed_and_both_is_mixed():
    up, down = np.arange(8.0), np.arange(8.0)[::-1]
    rising = conclude(made_tests(skewed(8)), correlations(lambda _: up, 8))[-1]
    both = conclude(made_tests(skewed(8)), correlations(lambda c: up if c == "AD" else down, 8))[-1]

    assert "reversed" == rising.status
    assert rising.answer.startswith("significant, but the other way round (D rs = 1.00")
    assert both.answer.startswith("mixed")
    assert len(both.evidence) == len(STARED_AT)


@pytest.mark.parametrize(
    ("ranks", "holds", "expected"),
    [
        (
            [7, 4, 6, 5, 3, 0, 2, 1],
            False,
            "not significant with n = 8 (D rs = .40, 95% CI [−.61, .92]; AD rs = −.86, "
            "95% CI [−.99, .00]; DA rs = .40, 95% CI [−.61, .92])",
        ),
        (
            [6, 7, 5, 4, 3, 2, 0, 1],
            True,
            "found in 1 of 3 conditions (AD rs = −.95, 95% CI [−1.00, −.49])",
        ),
    ],
)
def test_only_correlations_that_stand_after_correction_make_the_headline(ranks, holds, expected):
    unrelated = np.array([3.0, 0, 5, 1, 7, 4, 2, 6])
    coefficients = correlations(lambda c: np.array(ranks, float) if c == "AD" else unrelated, 8)
    (with_ad,) = [c for c in coefficients if c.measure == DWELL and c.level == "AD"]
    assert (True, holds) == (with_ad.is_significant_alone, with_ad.is_significant)
    assert expected == conclude(made_tests(skewed(8)), coefficients)[-1].answer


def test_four_participants_cannot_decide_a_correlation():
    coefficients = correlations(lambda _: np.array([2.0, 1.0, 4.0, 3.0]), 4)

    assert coefficients[0].can_reach is False
    assert conclude(made_tests(skewed(8)), coefficients)[-1].answer == (
        "undecided: n = 4 cannot reach the threshold"
    )


@pytest.mark.parametrize(
    "word", ["the other way round", "mixed", "social anxiety", "undecided", "partly"]
)
def test_rule_names_every_answer(word):
    assert word in RULE
