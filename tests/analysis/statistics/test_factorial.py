"""Rules of the factorial tests beyond the reference values."""

import numpy as np
import pytest
from scipy import stats

from tests.analysis.statistics.designs import mixed_frame, within_frame
from visavis.analysis import statistics
from visavis.analysis.statistics.anova import Correction
from visavis.analysis.statistics.design import read_design
from visavis.analysis.statistics.errors import UnknownMethod
from visavis.analysis.statistics.gee import gee
from visavis.analysis.statistics.strata import Strata

WITHIN = {"subject": "subject", "within": ("A", "B")}
MIXED = {"subject": "subject", "within": ("B",), "between": ("G",)}


def test_two_level_rm_anova_is_the_squared_paired_t() -> None:
    frame = within_frame(2)
    cells = frame["y"].reshape(8, 2, 3).mean(axis=2)
    t = statistics.paired_t(cells[:, 0], cells[:, 1])
    effect = statistics.rm_anova(frame, "y", **WITHIN).effect("A")
    assert (t.t**2, t.p) == pytest.approx((effect.F, effect.p))
    assert effect.sphericity is None


def test_between_effect_of_subject_means_is_a_one_way_anova() -> None:
    frame = mixed_frame(3, (5, 7))
    means = frame["y"].reshape(12, 3).mean(axis=1)
    expected = stats.f_oneway(means[:5], means[5:])
    effect = statistics.rm_anova(frame, "y", **MIXED).effect("G")
    assert (expected.statistic, expected.pvalue) == pytest.approx((effect.F, effect.p))


def test_unequal_groups_are_said_in_the_provenance() -> None:
    assert () == statistics.rm_anova(mixed_frame(3, (6, 6)), "y", **MIXED).provenance.notes
    notes = statistics.rm_anova(mixed_frame(3, (5, 7)), "y", **MIXED).provenance.notes
    assert "unweighted group means" in notes[0]


def test_sphericity_option_decides_what_is_reported() -> None:
    frame = within_frame(4, 10)
    plain = statistics.rm_anova(frame, "y", correction="none", **WITHIN).effect("B")
    gg = statistics.rm_anova(frame, "y", correction="gg", **WITHIN).effect("B")
    assert gg.sphericity is not None
    assert (plain.p, plain.p) == (plain.p_used, gg.p)
    assert gg.sphericity.p_gg == gg.p_used
    assert gg.df2 * gg.sphericity.gg == pytest.approx(gg.df2_used)


def test_aligned_ranks_are_corrected_for_sphericity_unless_told_not_to() -> None:
    frame = within_frame(4, 10)
    usual = statistics.art_anova(frame, "y", **WITHIN).effect("B")
    plain = statistics.art_anova(frame, "y", correction="none", **WITHIN).effect("B")
    assert usual.sphericity is not None
    assert usual.sphericity.gg < 1
    assert usual.sphericity.p_gg == usual.p_used
    assert (plain.p, plain.p) == (plain.p_used, usual.p)


def test_sphericity_without_enough_subjects_has_epsilon_but_no_mauchly() -> None:
    frame = within_frame(4, 4, (1, 6))
    del frame["A"]
    effect = statistics.rm_anova(frame, "y", subject="subject", within=("B",)).effects[0]
    assert effect.sphericity is not None
    assert effect.sphericity.W is None
    assert 0.2 <= effect.sphericity.gg <= 1
    assert "Greenhouse-Geisser" == effect.correction


def test_balanced_alignment_is_clean_and_unequal_groups_are_warned_of() -> None:
    balanced = statistics.art_anova(mixed_frame(5, (6, 6)), "y", **MIXED)
    unequal = statistics.art_anova(mixed_frame(5, (4, 8)), "y", **MIXED)
    assert balanced.check is not None
    assert unequal.check is not None
    assert balanced.check.is_clean
    assert not unequal.check.is_clean
    assert any("alignment is approximate" in n for n in unequal.provenance.notes)


def test_skewed_response_brings_the_warning_and_the_second_opinion() -> None:
    frame = within_frame(6, 16)
    assert not any(
        "skewed" in n for n in statistics.art_anova(frame, "y", **WITHIN).provenance.notes
    )
    frame["y"] = np.exp(2 * frame["y"])
    table = statistics.art_anova(frame, "y", **WITHIN)
    assert table.residual_skewness > 1
    assert any("transform='int'" in n for n in table.provenance.notes)
    beside = statistics.art_anova(frame, "y", transform="int", **WITHIN)
    assert table.second_opinion is not None
    assert {e.name: e.p_used for e in beside.effects} == pytest.approx(dict(table.second_opinion))


def test_disagreeing_transforms_are_said() -> None:
    frame = within_frame(6, 16)
    table = statistics.art_anova(frame, "y", **WITHIN)
    assert table.second_opinion is not None
    p = {e.name: (e.p, table.second_opinion[e.name]) for e in table.effects}
    name, (a, b) = max(p.items(), key=lambda item: abs(item[1][0] - item[1][1]))
    between = statistics.art_anova(frame, "y", alpha=(a + b) / 2, **WITHIN)
    assert any(n.startswith(f"{name}: ") for n in between.provenance.notes)


def test_art_of_one_factor_ranks_the_response() -> None:
    frame = within_frame(7, 8, (1, 3))
    del frame["A"]
    table = statistics.art_anova(frame, "y", subject="subject", within=("B",))
    assert table.ranks is not None
    assert stats.rankdata(frame["y"]) == pytest.approx(table.ranks["B"])


def test_between_within_contrasts_take_the_mixed_model_by_themselves() -> None:
    table = statistics.art_anova(mixed_frame(8), "y", **MIXED)
    assert "REML" in statistics.art_contrasts(table, "G:B").provenance.error_term
    with pytest.raises(UnknownMethod, match="mixed"):
        statistics.art_contrasts(table, "G:B", error="strata")


def test_tukey_of_double_differences_is_refused() -> None:
    table = statistics.art_anova(within_frame(8), "y", **WITHIN)
    with pytest.raises(UnknownMethod, match="double differences"):
        statistics.art_interaction_contrasts(table, "A:B", adjust="tukey")


def test_contrasts_on_normal_scores_are_refused_as_art_c() -> None:
    table = statistics.art_anova(within_frame(8), "y", transform="int", **WITHIN)
    with pytest.raises(Exception, match="ART-C"):
        statistics.art_contrasts(table, "A")


def test_posthocs_name_their_error_and_differ() -> None:
    table = statistics.rm_anova(within_frame(9, 10), "y", **WITHIN)
    pair, pooled = (
        statistics.posthoc(table, "B", error=e, adjust="tukey") for e in ("per_pair", "pooled")
    )
    assert (9, 18) == (pair.contrasts[0].df, pooled.contrasts[0].df)
    assert pair.contrasts[0].p_adjusted != pytest.approx(pooled.contrasts[0].p_adjusted)
    assert "pooled" in pooled.provenance.error_term
    assert "Tukey, 3 contrasts" == pooled.provenance.correction


def test_contrast_turns_round_with_its_levels() -> None:
    table = statistics.rm_anova(within_frame(9, 10), "y", **WITHIN)
    contrasts = statistics.posthoc(table, "B")
    there, back = contrasts.contrast("b0", "b1"), contrasts.contrast("b1", "b0")
    assert (there.estimate, there.t) == (-back.estimate, -back.t)
    assert there.interval is not None
    assert back.interval is not None
    assert (there.interval.low, there.interval.high) == (-back.interval.high, -back.interval.low)


def test_studentized_range_equals_scipy() -> None:
    q = np.array([0.5, 2.0, 3.5, 5.0])
    for k, df in ((3, 5), (4, 30), (6, 75)):
        expected = stats.studentized_range.sf(q, k, df)
        assert expected == pytest.approx(statistics.studentized_range_sf(q, k, df), abs=1e-10)
    quantile = statistics.studentized_range_quantile(0.95, 3, 20)
    assert 0.05 == pytest.approx(float(statistics.studentized_range_sf(quantile, 3, 20)))


def test_friedman_of_identical_orders_has_full_concordance() -> None:
    frame = {"s": np.repeat(np.arange(5), 3), "c": np.tile(["a", "b", "c"], 5)}
    frame["y"] = np.tile([1.0, 2.0, 3.0], 5) + frame["s"]
    result = statistics.friedman(frame, "y", subject="s", within="c")
    assert 1.0 == pytest.approx(result.kendall_w)
    assert (1.0, 2.0, 3.0) == result.mean_ranks
    assert 0.0 == result.p_f


def test_cell_means_average_repetitions() -> None:
    trials = {"s": [1, 1, 1, 2, 2, 2], "c": list("aabaab"), "y": [1.0, 3.0, 5.0, 2.0, 4.0, 6.0]}
    means = statistics.cell_means(trials, "y", by=("s", "c"))
    assert [1, 1, 2, 2] == means["s"]
    assert ["a", "b", "a", "b"] == means["c"]
    assert [2.0, 5.0, 3.0, 6.0] == list(means["y"])


def test_epsilon_squared_is_eta_squared_of_the_ranks() -> None:
    rng = np.random.default_rng(2)
    y, g = rng.permutation(30) + 1.0, np.repeat(["a", "b", "c"], (6, 10, 14))
    y[g == "c"] += 0.5 * (y[g == "c"] > 15)  # still no ties
    ranks = np.argsort(np.argsort(y)) + 1.0
    of_ranks = statistics.oneway_anova({"y": ranks, "g": g}, "y", factor="g")
    outcome = statistics.kruskal_wallis({"y": y, "g": g}, "y", factor="g")

    assert of_ranks.eta is not None
    assert of_ranks.eta.value == pytest.approx(outcome.epsilon2)
    assert outcome.effect.interval is not None


def test_kendalls_w_is_partial_eta_squared_of_the_ranks() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal((0.0, 0.3, 0.9, 0.2), 1.0, (9, 4))
    ranks = np.argsort(np.argsort(values, axis=1), axis=1) + 1.0
    s, c = np.repeat(np.arange(9), 4), np.tile(np.arange(4), 9)
    of_ranks = statistics.rm_anova(
        {"s": s, "c": c, "y": ranks.ravel()}, "y", subject="s", within=("c",)
    ).effect("c")
    outcome = statistics.friedman(
        {"s": s, "c": c, "y": values.ravel()}, "y", subject="s", within="c"
    )

    assert of_ranks.eta.value == pytest.approx(outcome.kendall_w)
    assert outcome.effect.interval is not None


def test_conditions_follow_the_path_to_anova_or_friedman() -> None:
    frame = within_frame(12, 12, (1, 3))
    normal = statistics.compare_conditions(frame, "y", subject="subject", within="B")
    assert normal.is_parametric
    assert "spherical" in normal.path()
    skewed = {**frame, "y": np.exp(6 * frame["y"])}
    ranked = statistics.compare_conditions(
        skewed, "y", subject="subject", within="B", always_posthoc=True
    )
    assert not ranked.is_parametric
    assert 3 == sum(step.question.startswith("Post-hoc") for step in ranked.steps)
    assert "no, Friedman" in ranked.path()


def test_anova_prints_one_sentence_per_effect() -> None:
    table = statistics.rm_anova(within_frame(2), "y", **WITHIN)
    lines = str(table).splitlines()
    assert 4 == len(lines)
    assert lines[1].startswith("A: F(1, 7) = ")
    assert "A × B: F(" in lines[3]
    assert ["A", "B", "A:B"] == [row["term"] for row in table.rows()]


def of_groups(sizes: tuple[int, ...] = (5, 9, 14)) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(9)
    g = np.repeat(["a", "b", "c"][: len(sizes)], sizes)
    return {"g": g, "y": rng.normal(0, 2, size=len(g)) + (g == "b")}


def test_contrasts_by_separate_variances_have_the_effect_of_their_two_groups() -> None:
    frame = of_groups()
    a, b = (frame["y"][frame["g"] == name] for name in "ab")
    expected = statistics.independent_t(a, b).effect
    row = statistics.games_howell(frame, "y", factor="g").contrast("a", "b").row()
    outcome = [row[name] for name in ("effect_size", "effect_ci_low", "effect_ci_high")]
    assert [expected.value, expected.interval.low, expected.interval.high] == pytest.approx(outcome)
    assert "d" == row["effect"]
    pair = statistics.dunn(frame, "y", factor="g")[0]
    assert statistics.mann_whitney(a, b).effect == pair.effect
    assert pair.effect.interval.low < pair.effect.value < pair.effect.interval.high


def test_a_contrast_turned_round_turns_a_difference_and_inverts_a_ratio() -> None:
    rng = np.random.default_rng(2)
    n = 200
    frame = {"s": np.repeat(np.arange(20), 10), "c": np.tile(["x", "z"], n // 2)}
    frame["y"] = (rng.random(n) < np.where(frame["c"] == "x", 0.3, 0.7)).astype(float)
    model = gee(frame, "y", subject="s", within=("c",), family="binomial")
    there, back = (model.contrasts("c").contrast(*pair) for pair in (("x", "z"), ("z", "x")))
    assert 1 == pytest.approx(there.effect.value * back.effect.value)
    assert 1 == pytest.approx(there.effect.interval.low * back.effect.interval.high)
    assert 0 < back.effect.interval.low < back.effect.value


@pytest.mark.parametrize(
    "frame", [within_frame(5), mixed_frame(5, (5, 7)), mixed_frame(5, (4,) * 3)]
)
def test_f_of_all_terms_at_once_is_f_of_each(frame: dict[str, np.ndarray]) -> None:
    design = read_design(frame, "y", **(MIXED if "G" in frame else WITHIN))
    strata = Strata(design, "subject")
    tables = [design.table(values) for values in (design.y, np.exp(design.y), 0 * design.y)]
    each = [[strata.test(table, term) for table in tables] for term in design.terms]
    expected = [
        [(s.ss / s.df1) / (s.ss_error / s.df2) if s.ss else 0.0 for s in row] for row in each
    ]
    np.testing.assert_allclose(strata.f_of_terms(tables), expected, rtol=1e-10)


def test_an_effect_without_error_has_an_infinite_f_in_the_check() -> None:
    frame = within_frame(5)
    frame["y"] = 1.0 * (frame["A"] == "a1")
    design = read_design(frame, "y", **WITHIN)
    assert [[np.inf], [0], [0]] == Strata(design, "subject").f_of_terms(
        [design.table(design.y)]
    ).tolist()


@pytest.mark.parametrize("correction", ["none", "gg", "hf", "mauchly"])
def test_the_second_opinion_is_p_of_the_other_transform(correction: Correction) -> None:
    frame = within_frame(4, 10, (2, 4))
    art = statistics.art_anova(frame, "y", correction=correction, **WITHIN)
    scores = statistics.art_anova(frame, "y", correction=correction, transform="int", **WITHIN)
    assert {e.name: e.p_used for e in scores.effects} == art.second_opinion
    assert {e.name: e.p_used for e in art.effects} == scores.second_opinion
