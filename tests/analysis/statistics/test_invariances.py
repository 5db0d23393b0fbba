"""F and p do not depend on row order, names, units or the kind of labels."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analysis.statistics.designs import Frame, mixed_frame, rows, within_frame
from visavis.analysis import statistics
from visavis.analysis.statistics.anova import Anova

SEEDS = st.integers(0, 10_000)


def tables(frame: Frame, dv: str = "y", a: str = "A", b: str = "B") -> list[Anova]:
    design = {"subject": "subject", "within": (a, b)}
    return [
        statistics.art_anova(frame, dv, **design),
        statistics.art_anova(frame, dv, error="pooled", **design),
        statistics.art_anova(frame, dv, error="mixed", **design),
        statistics.art_anova(frame, dv, transform="int", **design),
        statistics.rm_anova(frame, dv, **design),
        statistics.mixed_anova(frame, dv, **design),
    ]


def figures(found: list[Anova]) -> list[float]:
    return [value for table in found for e in table.effects for value in (e.F, e.p, e.df2)]


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_shuffled_rows_change_nothing(seed: int) -> None:
    frame = within_frame(seed)
    order = np.random.default_rng(seed).permutation(frame["y"].size)
    assert figures(tables(frame)) == pytest.approx(
        figures(tables(rows(frame, order))), rel=1e-6, abs=1e-12
    )


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_units_of_the_response_change_nothing(seed: int) -> None:
    frame = within_frame(seed)
    frame["y"] = np.round(frame["y"], 3)
    scaled = {**frame, "y": 3 * frame["y"] + 7}
    strict, loose = slice(0, 2), slice(2, None)
    for part, rel in ((strict, 1e-9), (loose, 1e-6)):
        assert figures(tables(frame)[part]) == pytest.approx(
            figures(tables(scaled)[part]), rel=rel, abs=1e-12
        )


@pytest.mark.parametrize("factor", [1e-12, 1e-9, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e5])
def test_ranks_that_are_aligned_do_not_depend_on_the_scale(factor: float, offset: float) -> None:
    frame = within_frame(5)
    frame["y"] = np.round(frame["y"], 1)  # with ties
    moved = {**frame, "y": (frame["y"] + offset) * factor}
    assert figures(tables(frame)[:3]) == pytest.approx(figures(tables(moved)[:3]), rel=1e-5)
    plain, other = (
        statistics.art_contrasts(
            statistics.art_anova(f, "y", subject="subject", within=("A", "B")), "B"
        )
        for f in (frame, moved)
    )
    effects = [[c.effect.value for c in made.contrasts if c.effect] for made in (plain, other)]
    assert effects[0] == pytest.approx(effects[1], abs=1e-9)


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_renamed_levels_and_columns_change_nothing(seed: int) -> None:
    frame = within_frame(seed)
    names = {"b0": "z", "b1": "c", "b2": "m"}  # another order when sorted
    renamed = {
        "subject": np.array([int(s[1:]) * 7 for s in frame["subject"]]),
        "look": np.array([{"a0": "2", "a1": "1"}[v] for v in frame["A"]]),
        "way": np.array([names[v] for v in frame["B"]]),
        "score": frame["y"],
    }
    assert figures(tables(frame)) == pytest.approx(
        figures(tables(renamed, "score", "look", "way")), rel=1e-6, abs=1e-12
    )


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_contrasts_follow_their_levels_through_renaming(seed: int) -> None:
    frame = within_frame(seed)
    names = {"b0": "z", "b1": "c", "b2": "m"}
    renamed = {**frame, "B": np.array([names[v] for v in frame["B"]])}
    design = {"subject": "subject", "within": ("A", "B")}
    one = statistics.art_contrasts(statistics.art_anova(frame, "y", **design), "B")
    other = statistics.art_contrasts(statistics.art_anova(renamed, "y", **design), "B")
    for first, second in (("b0", "b1"), ("b0", "b2"), ("b1", "b2")):
        a, b = one.contrast(first, second), other.contrast(names[first], names[second])
        assert (a.estimate, a.p_adjusted) == pytest.approx((b.estimate, b.p_adjusted))


def test_a_pandas_frame_gives_the_same_as_a_mapping() -> None:
    frame = mixed_frame(3)
    table = pd.DataFrame(frame)
    table["B"] = pd.Categorical(table["B"], categories=["b2", "b0", "b1"])
    design = {"subject": "subject", "within": ("B",), "between": ("G",)}
    one, other = (statistics.rm_anova(f, "y", **design) for f in (frame, table))
    assert figures([one]) == pytest.approx(figures([other]))
    assert ("b2", "b0", "b1") == other.design.factor("B").levels


def test_balanced_random_intercept_equals_the_pooled_error() -> None:
    frame = within_frame(5)
    design = {"subject": "subject", "within": ("A", "B")}
    pooled = statistics.art_anova(frame, "y", error="pooled", **design)
    mixed = statistics.art_anova(frame, "y", error="mixed", random="intercept", **design)
    assert [e.F for e in pooled.effects] == pytest.approx([e.F for e in mixed.effects], rel=1e-6)
    assert [e.df2 for e in pooled.effects] == pytest.approx([e.df2 for e in mixed.effects])
