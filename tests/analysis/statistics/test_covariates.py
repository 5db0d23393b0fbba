"""Numbers of people held constant: the ANCOVA of R's car and afex, its means those of emmeans."""

import numpy as np
import pandas as pd
import pytest

from visavis.analysis import statistics
from visavis.analysis.statistics.errors import ConstantResponse, DuplicateCell, MissingValue
from visavis.analysis.statistics_report import Question, answer
from visavis.lab.errors import UsageError


def people() -> pd.DataFrame:
    """Return 17 people in groups g (7 and 10) and h, of some age, under three methods m."""
    rng = np.random.default_rng(12)
    rows = []
    for k in range(17):
        g, h, age = "ab"[k >= 7], "xyz"[k % 3], int(rng.integers(20, 60))
        own = rng.normal() + 0.05 * age + (g == "b")
        for m in ("lineuler", "slerp", "squad"):
            y = own + rng.normal() * 0.6 + (m == "squad") * (1 + 0.02 * age)
            rows.append((f"P{k:02d}", g, h, age, m, round(y, 2)))
    return pd.DataFrame(rows, columns=["who", "g", "h", "age", "m", "y"])


def test_groups_are_compared_at_the_mean_of_a_covariate_as_car_does() -> None:
    # car::Anova(lm(y ~ g * h + age), type = 3), age centred; pairs(emmeans(m, "h"))
    means = people().groupby(["who", "g", "h", "age"], as_index=False)["y"].mean()
    table = statistics.between_anova(
        means, "y", between=("g", "h"), subject="who", covariates=("age",)
    )
    p = {e.name: e.p for e in table.effects}
    assert {"g": 0.386983, "h": 0.664655, "age": 0.032283, "g:h": 0.673829} == pytest.approx(
        p, abs=1e-6
    )
    pairs = statistics.posthoc(table, "h", adjust="none").contrasts
    assert pytest.approx([0.233, 0.903, 0.639], abs=5e-4) == [c.t for c in pairs]
    assert [10, 10, 10] == [c.df for c in pairs]


def test_conditions_are_compared_at_the_mean_of_a_covariate_as_afex_does() -> None:
    # aov_ez("who", "y", d, within = "m", between = "g", covariate = "age", factorize = FALSE)
    table = statistics.rm_anova(
        people(), "y", subject="who", within=("m",), between=("g",), covariates=("age",)
    )
    F = {e.name: e.F for e in table.effects}
    assert {
        "g": 1.11413,
        "m": 95.26743,
        "g:m": 1.07539,
        "age": 8.11589,
        "age:m": 0.74672,
    } == pytest.approx(F, abs=5e-6)
    sphericity = table.effect("m").sphericity
    assert sphericity is not None
    assert (0.87499123, 0.88888196) == pytest.approx((sphericity.W, sphericity.gg), abs=1e-8)
    pairs = statistics.posthoc(table, "m", adjust="none").contrasts
    assert pytest.approx([-0.345, -12.943, -13.380], abs=5e-4) == [c.t for c in pairs]
    simple = statistics.simple_effects(table, "g", "m", adjust="none")
    assert pytest.approx([-0.579, -1.377, -1.167], abs=5e-4) == [f.contrasts[0].t for f in simple]


def test_slopes_that_differ_between_groups_are_told() -> None:
    frame = people()
    frame["y"] += frame["age"] * (frame["g"] == "b") * 0.5
    table = statistics.rm_anova(
        frame, "y", subject="who", within=("m",), between=("g",), covariates=("age",)
    )
    assert any("depends on age differently in the groups" in n for n in table.provenance.notes)
    assert "age held constant" in table.provenance.test


def test_a_covariate_is_one_number_of_a_person() -> None:
    frame = people()
    asked = {"subject": "who", "within": ("m",), "covariates": ("age",)}
    with pytest.raises(DuplicateCell, match="several values of age"):
        statistics.rm_anova(frame.assign(age=range(len(frame))), "y", **asked)  # type: ignore[arg-type]  # columns
    with pytest.raises(ConstantResponse, match="explains nothing"):
        statistics.rm_anova(frame.assign(age=3), "y", **asked)  # type: ignore[arg-type]  # columns


def test_a_report_leaves_out_who_has_no_covariate_only_where_it_may() -> None:
    frame = people()
    frame["age"] = frame["age"].astype(float)
    frame.loc[frame["who"] == "P03", "age"] = None
    asked = {"dv": "y", "within": ("m",), "subject": "who", "covariates": ("age",)}
    with pytest.raises(MissingValue, match="age is missing"):
        answer(frame, Question("rm", **asked))  # type: ignore[arg-type]  # keywords
    outcome = answer(frame, Question("rm", missing="listwise", **asked))  # type: ignore[arg-type]  # keywords
    assert "left out: 1 without age" in outcome.notes
    assert outcome.data is not None
    assert 16 == outcome.data["who"].nunique()
    assert {"m", "age", "age:m"} == {row["term"] for row in outcome.rows}
    assert not [row for row in outcome.contrasts if "age" in str(row["family"])]


def test_other_tests_hold_nothing_constant() -> None:
    with pytest.raises(UsageError, match="covariates goes with rm, anova"):
        Question("art", dv="y", within=("m",), subject="who", covariates=("age",))


@pytest.mark.parametrize(
    ("covariates", "said"),
    [
        (("age", "months"), "months follows from g, age"),
        (("of_group",), "of_group follows from g"),
    ],
)
def test_a_covariate_that_follows_from_the_others_is_refused_by_name(
    covariates: tuple[str, ...], said: str
) -> None:
    frame = people().assign(months=lambda f: 12 * f.age + 1)
    frame["of_group"] = frame.g.map({"a": 20.0, "b": 30.0})
    means = frame.groupby(["who", "g", "age", "months", "of_group"], as_index=False)["y"].mean()
    with pytest.raises(ConstantResponse, match=said):
        statistics.between_anova(means, "y", between=("g",), subject="who", covariates=covariates)
