"""Agreement of raters and counts against chance: rules that hold for any data."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy import stats

from visavis.analysis.statistics import errors
from visavis.analysis.statistics.agreement import cohen_kappa, icc, krippendorff_alpha
from visavis.analysis.statistics.binomial import binomial_test, sign_test, sign_test_of_one

RATINGS = arrays.arrays(
    np.int64, st.tuples(st.integers(4, 12), st.integers(2, 4)), elements=st.integers(1, 5)
)


@pytest.mark.parametrize("scale", ["nominal", "ordinal", "interval", "ratio"])
def test_raters_who_agree_throughout_have_one(scale: str) -> None:
    column = np.array([1.0, 2, 3, 5, 2, 1])
    table = np.column_stack([column, column, column])
    assert 1.0 == pytest.approx(krippendorff_alpha(table, scale=scale).value)
    if scale != "ratio":
        assert 1.0 == pytest.approx(cohen_kappa(table[:, :2], scale=scale).value)
    assert [1.0] * 6 == pytest.approx([one.value for one in icc(table)])


@settings(max_examples=40, deadline=None)
@given(RATINGS, st.integers(0, 1000))
def test_the_order_of_raters_and_things_means_nothing(table: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    mixed = rng.permutation(rng.permutation(table, axis=0), axis=1)
    for scale in ("nominal", "ordinal", "interval", "ratio"):
        try:
            first = krippendorff_alpha(table, scale=scale).value
        except errors.ConstantResponse:
            return
        assert first == pytest.approx(krippendorff_alpha(mixed, scale=scale).value, abs=1e-9)
        assert first <= 1.0


@settings(max_examples=40, deadline=None)
@given(RATINGS)
def test_quadratic_kappa_of_twos_is_alpha_but_for_small_samples(table: np.ndarray) -> None:
    two = np.tile(table[:, :2], (400, 1))
    two = np.concatenate([two, two[:, ::-1]])
    try:
        kappa = cohen_kappa(two, scale="interval").value
        alpha = krippendorff_alpha(two, scale="interval").value
    except errors.ConstantResponse:
        return
    assert kappa == pytest.approx(alpha, abs=0.01)


def test_levels_of_raters_count_against_agreement_but_not_consistency() -> None:
    column = np.array([1.0, 4, 2, 6, 3, 5])
    by_kind = {one.kind: one for one in icc(np.column_stack([column, column + 3]))}
    assert 1.0 == pytest.approx(by_kind["ICC3"].value)
    assert by_kind["ICC2"].value < 0.6


def test_an_interval_of_alpha_holds_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(2)
    truth, hits = 0.5, 0
    for _ in range(60):  # interval alpha of one-way effects is their intraclass correlation
        table = rng.normal(0, 1, (60, 1)) + rng.normal(0, 1, (60, 3))
        ends = krippendorff_alpha(np.round(table, 1), scale="interval").interval
        hits += ends.low <= truth <= ends.high
    assert hits >= 50


def test_what_cannot_be_compared_is_refused() -> None:
    gaps = np.array([[1.0, 2], [np.nan, 3], [2, 2]])
    with pytest.raises(errors.MissingValue, match="row 2"):
        icc(gaps)
    with pytest.raises(errors.ConstantResponse):
        krippendorff_alpha(np.ones((4, 2)), scale="nominal")
    with pytest.raises(errors.TooFewSubjects):
        krippendorff_alpha(np.array([[1.0, np.nan], [np.nan, 2]]), scale="nominal")
    with pytest.raises(errors.TooFewLevels, match="two raters"):
        cohen_kappa(np.ones((4, 3)))
    with pytest.raises(errors.ConstantResponse, match="equal in all"):
        sign_test([1.0, 2, 3], [1.0, 2, 3])


def test_equal_pairs_are_left_out_and_told() -> None:
    result = sign_test([1.0, 2, 3, 4], [0.0, 2, 1, 9])
    assert (2, 3) == (result.hits, result.n)
    assert ("1 of 4 equal, left out",) == result.provenance.notes
    assert result.p == binomial_test(2, 3).p
    assert 3 == sign_test_of_one([0.3 - 0.1, 0.9, 0.7, 0.8], mu=0.2).hits


def test_the_bound_at_the_end_of_an_interval_has_its_tail() -> None:
    rng = np.random.default_rng(2)
    table = rng.normal(0, 1, (15, 1)) + rng.normal(0, 1, (15, 4))
    for kind in ("ICC1", "ICC3", "ICC1k", "ICC3k"):
        low = next(one for one in icc(table) if one.kind == kind).by_f.low
        (one,) = (o for o in icc(table, above=low) if o.kind == kind)
        assert 0.025 == pytest.approx(one.p_above, abs=1e-9)
    for one in icc(table):
        assert one.p == pytest.approx(one.p_above)
    two = np.round(table[:, :2])
    low = cohen_kappa(two, scale="interval").interval.low
    assert 0.025 == pytest.approx(cohen_kappa(two, scale="interval", above=low).p_above)
    low = krippendorff_alpha(table, scale="interval").interval.low
    found = krippendorff_alpha(table, scale="interval", above=low).p_above
    assert 0.025 == pytest.approx(found, abs=0.001)


def test_agreement_at_the_bound_is_found_above_it_as_often_as_it_may() -> None:
    rng = np.random.default_rng(3)
    found = dict.fromkeys(("ICC1", "ICC2", "ICC3", "ICC2k"), 0)
    studies = 400
    for _ in range(studies):
        table = rng.normal(0, 1, (12, 1)) + rng.normal(0, 0.7, (1, 6)) + rng.normal(0, 1, (12, 6))
        alone = rng.normal(0, 1, (12, 1)) + rng.normal(0, 1, (12, 6))
        single = 1 / (1 + 0.49 + 1)
        true = {"ICC1": 0.5, "ICC2": single, "ICC3": 0.5, "ICC2k": 6 * single / (1 + 5 * single)}
        for kind, bound in true.items():
            result = icc(alone if kind == "ICC1" else table, above=bound)
            found[kind] += next(one for one in result if one.kind == kind).p_above < 0.05
    for count in found.values():
        assert 0.02 < count / studies < 0.08
    with pytest.raises(errors.UnknownMethod, match="below 1"):
        icc(table, above=1.0)


def test_kappa_without_each_thing_is_that_of_the_others() -> None:
    rng = np.random.default_rng(4)
    good = rng.integers(0, 4, 14)
    table = np.clip(np.column_stack([good, good + rng.integers(-1, 2, 14)]), 0, 3).astype(float)
    for scale in ("nominal", "ordinal", "interval"):
        result = cohen_kappa(table, scale=scale)
        each = np.arctanh(
            [cohen_kappa(np.delete(table, i, 0), scale=scale).value for i in range(14)]
        )
        error = np.sqrt(13 / 14 * ((each - each.mean()) ** 2).sum())
        reach = stats.t.ppf(0.975, 13) * error
        ends = np.tanh(np.arctanh(result.value) + reach * np.array([-1, 1]))
        assert pytest.approx(ends) == (result.interval.low, result.interval.high)


def test_raters_who_always_agree_are_not_certain_to() -> None:
    few, many = np.array([[1.0, 1], [2, 2], [3, 3], [1, 1]]), np.tile([[1.0, 1], [2, 2]], (40, 1))
    for run in (cohen_kappa, krippendorff_alpha):
        wide, narrow = (run(table, scale="nominal").interval for table in (few, many))
        assert 1.0 == wide.high == narrow.high
        assert wide.low < 0.2 < 0.85 < narrow.low
        assert 0.025 == pytest.approx(run(many, scale="nominal", above=narrow.low).p_above)


@pytest.mark.parametrize("measure", [cohen_kappa, krippendorff_alpha])
def test_each_further_disagreement_lowers_the_interval_a_little(measure) -> None:  # type: ignore[no-untyped-def]  # either coefficient
    ratings = np.repeat(np.arange(400)[:, None] % 2, 2, axis=1).astype(float)
    lows = []
    for _ in range(3):
        lows.append(measure(ratings, scale="nominal", above=0.8).interval.low)
        ratings[len(lows), 1] = 1 - ratings[len(lows), 1]
    assert lows == sorted(lows, reverse=True)
    assert lows[1] > 0.95
