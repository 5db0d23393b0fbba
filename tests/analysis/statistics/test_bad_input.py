"""Bad data end in a named error that points to the row or cell; never in a NaN table."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.analysis.statistics.designs import Frame, changed, mixed_frame, rows, within_frame
from visavis.analysis import statistics
from visavis.analysis.statistics import errors
from visavis.lab.errors import DataError

DESIGN = {"subject": "subject", "within": ("A", "B")}
MIXED = {"subject": "subject", "within": ("B",), "between": ("G",)}
FRAME = within_frame(1)
GROUPS = mixed_frame(2)
CELL = "subject S01, A a0, B b1"
EMPTY_CELL = rows(FRAME, np.flatnonzero(~((FRAME["A"] == "a0") & (FRAME["B"] == "b1"))))

CASES: list[tuple[Frame, dict[str, Any], type[errors.StatisticsError], str]] = [
    (changed(FRAME, "y", 7, float("nan")), DESIGN, errors.MissingValue, f"{CELL} (row 8)"),
    (changed(FRAME, "y", 7, None), DESIGN, errors.MissingValue, f"{CELL} (row 8)"),
    (rows(FRAME, np.delete(np.arange(48), 7)), DESIGN, errors.MissingCell, f"{CELL} (no row)"),
    (rows(FRAME, np.r_[0:48, 7]), DESIGN, errors.DuplicateCell, f"{CELL} has 2 rows (8, 49)"),
    ({**FRAME, "A": np.full(48, "one")}, DESIGN, errors.TooFewLevels, "A has one level only (one)"),
    (rows(FRAME, np.arange(12)), DESIGN, errors.TooFewSubjects, "2 subjects"),
    ({**FRAME, "y": np.full(48, 3.0)}, DESIGN, errors.ConstantResponse, "y is 3 in all 48 rows"),
    (changed(FRAME, "y", 7, "high"), DESIGN, errors.NotNumeric, f"'high' in row 8 ({CELL})"),
    ({**FRAME, "y": [f"{v}" for v in FRAME["y"]]}, DESIGN, errors.NotNumeric, "from text to"),
    (changed(FRAME, "y", 7, np.inf), DESIGN, errors.InfiniteValue, f"row 8 ({CELL})"),
    (changed(FRAME, "A", 7, None), DESIGN, errors.MissingValue, "A is missing in row 8"),
    (changed(FRAME, "B", 7, float("nan")), DESIGN, errors.MissingValue, "B is missing in row 8"),
    ({**FRAME, "y": FRAME["y"][:-1]}, DESIGN, errors.UnequalLength, "y: 47"),
    (FRAME, {**DESIGN, "within": ("A", "Bb")}, errors.UnknownColumn, "did you mean 'B'"),
    (FRAME, {**DESIGN, "levels": {"A": ["a0"]}}, errors.TooFewLevels, "'a1' in row 4"),
    (changed(GROUPS, "G", 1, "g1"), MIXED, errors.SubjectInTwoGroups, "S00 is G g0 in row 1"),
    (mixed_frame(2, (1, 7)), MIXED, errors.TooFewSubjects, "group G g0"),
    ({**GROUPS, "y": np.repeat(np.arange(12.0), 3)}, MIXED, errors.ConstantResponse, "effect of B"),
]


@pytest.mark.parametrize("test", [statistics.art_anova, statistics.rm_anova])
@pytest.mark.parametrize(("frame", "design", "kind", "text"), CASES, ids=[c[3] for c in CASES])
def test_bad_frame_is_a_named_error_that_points_to_it(
    test: Callable[..., object],
    frame: Frame,
    design: dict[str, Any],
    kind: type[errors.StatisticsError],
    text: str,
) -> None:
    with pytest.raises(kind) as caught:
        test(frame, "y", **design)
    assert text in str(caught.value)
    assert isinstance(caught.value, DataError)


def test_missing_cells_are_all_named_at_once() -> None:
    with pytest.raises(errors.MissingCell, match=r"missing in 2 cells: subject S00.*subject S01"):
        statistics.rm_anova(rows(FRAME, np.delete(np.arange(48), [2, 8])), "y", **DESIGN)


def test_listwise_says_who_was_dropped() -> None:
    table = statistics.art_anova(changed(FRAME, "y", 7, None), "y", missing="listwise", **DESIGN)
    assert ("subject S01 (incomplete)",) == table.provenance.dropped
    assert 7 == table.provenance.n
    assert "subject S01 (incomplete)" == table.rows()[0]["dropped"]


def test_mixed_keeps_the_rows_that_are_there_and_says_so() -> None:
    table = statistics.art_anova(changed(FRAME, "y", 7, None), "y", missing="mixed", **DESIGN)
    assert 47 == table.design.y.size
    assert "Kenward-Roger" in table.provenance.error_term
    assert (f"{CELL} (missing)",) == table.provenance.dropped


def test_mixed_model_refuses_a_cell_nobody_has() -> None:
    with pytest.raises(errors.MissingCell, match="A a0, B b1"):
        statistics.mixed_anova(EMPTY_CELL, "y", **DESIGN)


def test_mixed_model_refuses_data_without_noise() -> None:
    flat = {**GROUPS, "y": np.repeat(np.arange(12.0), 3)}
    with pytest.raises(errors.ConstantResponse):
        statistics.mixed_anova(flat, "y", **MIXED)


PAIRED: list[Callable[..., object]] = [
    statistics.paired_t,
    statistics.wilcoxon_signed_rank,
    statistics.spearman,
    statistics.compare_paired,
]
GOOD = [1.0, 2.0, 3.0, 5.0]


@pytest.mark.parametrize("test", PAIRED)
@pytest.mark.parametrize(
    ("y", "kind", "text"),
    [
        ([1.0, np.nan, 3.0, 4.0], errors.MissingValue, "row 2"),
        ([1.0, 2.0, np.inf, 4.0], errors.InfiniteValue, "row 3"),
        ([1.0, 2.0, 3.0, "b"], errors.NotNumeric, "'b' in row 4"),
        ([1.0, 2.0, 3.0], errors.UnequalLength, "4 rows"),
    ],
)
def test_bad_pairs_are_named_errors(
    test: Callable[..., object], y: list[object], kind: type[Exception], text: str
) -> None:
    with pytest.raises(kind, match=text):
        test(GOOD, y)


@pytest.mark.parametrize("test", PAIRED)
def test_fewer_than_three_pairs_are_refused(test: Callable[..., object]) -> None:
    with pytest.raises(errors.TooFewSubjects):
        test([1.0, 2.0], [2.0, 1.0])


@pytest.mark.parametrize(
    "test", [statistics.paired_t, statistics.wilcoxon_signed_rank, statistics.compare_paired]
)
def test_pairs_without_a_difference_are_refused(test: Callable[..., object]) -> None:
    with pytest.raises(errors.ConstantResponse):
        test(GOOD, GOOD)


def test_two_sample_tests_refuse_one_value_throughout() -> None:
    for test in (statistics.independent_t, statistics.mann_whitney):
        with pytest.raises(errors.ConstantResponse):
            test([1.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: statistics.art_anova(FRAME, "y", error="none", **DESIGN), "none"),
        (lambda: statistics.art_anova(FRAME, "y", transform="log", **DESIGN), "log"),
        (lambda: statistics.rm_anova(FRAME, "y", correction="box", **DESIGN), "box"),
        (lambda: statistics.rm_anova(FRAME, "y", missing="mixed", **DESIGN), "mixed_anova"),
        (lambda: statistics.rm_anova(FRAME, "y", missing="drop", **DESIGN), "drop"),
        (lambda: statistics.adjust_p([0.1], "sidak"), "sidak"),
        (lambda: statistics.wilcoxon_signed_rank(GOOD, method="best"), "best"),
        (lambda: statistics.wilcoxon_signed_rank(GOOD, zeros="keep"), "keep"),
        (lambda: statistics.rm_anova(FRAME, "y", **DESIGN).effect("C"), "C"),
    ],
)
def test_unknown_options_are_named(call: Callable[[], object], argument: str) -> None:
    with pytest.raises(errors.UnknownMethod, match=argument):
        call()
