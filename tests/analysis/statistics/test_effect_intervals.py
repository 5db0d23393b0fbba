"""Effect sizes of models' terms and of contrasts, against other programs and closed forms."""

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from scipy import optimize, stats

from tests.analysis.statistics.designs import Frame, mixed_frame, rows, within_frame
from visavis.analysis import statistics
from visavis.analysis.statistics.art import aligned_columns, aligned_ranks
from visavis.analysis.statistics.art_contrasts import join_factors
from visavis.analysis.statistics.bradley_terry import bradley_terry
from visavis.analysis.statistics.clmm import clmm
from visavis.analysis.statistics.contrasts import Contrasts
from visavis.analysis.statistics.gee import gee
from visavis.analysis.statistics.lmm import linear_mixed
from visavis.analysis.statistics.results import Effect

TWO = {"subject": "subject", "within": ("A", "B")}


def ends(effect: Effect | None) -> list[float]:
    """Return value, low and high of an effect that has an interval."""
    assert effect is not None
    assert effect.interval is not None
    return [effect.value, effect.interval.low, effect.interval.high]


def noncentral(t: float, df: float, scale: float) -> list[float]:
    """Return t and the bounds of its noncentrality, times a scale, from SciPy's distribution."""

    def bound(q: float) -> float:
        return float(optimize.brentq(lambda nc: stats.nct.cdf(t, df, nc) - q, t - 6, t + 6))

    return [t * scale, bound(0.975) * scale, bound(0.025) * scale]


def trials() -> Frame:
    """Return 14 people with six trials in each of two conditions, who differ in the effect."""
    rng = np.random.default_rng(13)
    person, is_z = np.repeat(np.arange(14), 12), np.tile(np.repeat([False, True], 6), 14)
    y = rng.normal(size=168) + rng.normal(size=14)[person]
    y += (0.4 + 0.8 * rng.normal(size=14)[person]) * is_z
    return {"s": person, "A": np.where(is_z, "z", "x"), "y": y}


@pytest.mark.usefixtures("normal_tails")
def test_a_contrast_of_a_mixed_model_is_d_by_the_total_sd_that_lme4_finds() -> None:
    """R: `lmer(y ~ A + (1 + A | s))`, sum coded; SD from VarCorr and sigma, bounds from pt."""
    result = linear_mixed(trials(), "y", subject="s", within=("A",))
    assert "maximal" == result.random
    (pair,) = result.contrasts("A").contrasts
    assert [-0.20562920, -0.60085683, 0.19712512] == pytest.approx(ends(pair.effect), abs=2e-5)
    assert "d_total = −0.21, 95% CI [−0.60, 0.20]" in pair.sentence()


@pytest.mark.usefixtures("normal_tails")
def test_components_of_variance_add_up_to_the_total_sd() -> None:
    result = linear_mixed(within_frame(1, 12), "y", random="components", **TWO)
    assert result.model is not None
    sd = np.sqrt(sum(result.model.parameters.values()))
    for pair in result.contrasts("B").contrasts:
        assert noncentral(pair.t, pair.df, pair.se / sd) == pytest.approx(
            ends(pair.effect), abs=1e-6
        )


@pytest.mark.usefixtures("normal_tails")
def test_scores_in_estimating_equations_have_d_by_the_pooled_sd_of_their_conditions() -> None:
    frame = within_frame(2, 12, (2, 2))
    frame = rows(frame, frame["B"] == "b0")
    result = gee(frame, "y", subject="subject", within=("A",))
    x, z = (frame["y"][frame["A"] == level] for level in ("a0", "a1"))
    sd = np.sqrt((x.var(ddof=1) + z.var(ddof=1)) / 2)
    (effect,) = result.effects
    (pair,) = result.contrasts("A").contrasts
    assert noncentral(pair.t, 11, pair.se / sd) == pytest.approx(ends(effect.effect), abs=1e-6)
    assert (x.mean() - z.mean()) / sd == pytest.approx(ends(pair.effect)[0])
    assert pair.effect == effect.effect


@pytest.mark.parametrize("family", ["binomial", "poisson"])
def test_a_term_of_one_df_has_the_ratio_that_treatment_coding_gives(family: str) -> None:
    """The interaction's coefficient in treatment coding is the log of the ratio of ratios."""
    frame = within_frame(5, 16, (2, 2))
    frame["y"] = (
        np.round(np.clip(frame["y"] + 2, 0, 8))
        if family == "poisson"
        else (np.asarray(frame["y"]) > 0.5).astype(float)
    )
    result = gee(frame, "y", family=family, **TWO)
    a, b = (frame["A"] == "a0").astype(float), (frame["B"] == "b0").astype(float)
    fit = sm.GEE(
        frame["y"],
        np.column_stack([np.ones(64), a, b, a * b]),
        groups=frame["subject"],
        family=getattr(sm.families, family.title())(),
        cov_struct=sm.cov_struct.Exchangeable(),
    ).fit(cov_type="bias_reduced", ctol=1e-10, maxiter=200, ddof_scale=0)
    reach = stats.t.ppf(0.975, 15) * fit.bse[3]
    expected = np.exp([fit.params[3], fit.params[3] - reach, fit.params[3] + reach])
    effect = result.effect("A:B")
    assert ends(effect.effect) == pytest.approx(expected, rel=1e-5)
    ratio = {"binomial": "odds ratios", "poisson": "rate ratios"}[family]
    assert f"ratio of {ratio} = " in effect.sentence()
    assert effect.sentence().endswith("(a0 − a1, b0 − b1)")
    (pair,) = result.contrasts("A").contrasts
    assert result.effect("A").effect == pair.effect
    assert "a0 − a1" == result.effect("A").row()["contrast"]


def test_terms_of_several_df_say_that_they_have_no_effect_size() -> None:
    frame = within_frame(1, 12)
    frame["r"] = np.clip(np.round(np.asarray(frame["y"]) + 2.6), 1, 5)
    for result in (gee(frame, "y", **TWO), clmm(frame, "r", **TWO)):
        several = result.effect("B")
        assert several.effect is None
        assert "no effect size for 2 df together" in several.sentence()
        assert several.row()["effect_size"] is None
        assert "no effect size" not in result.effect("A").sentence()


def test_an_interaction_of_ratings_has_the_ratio_of_odds_ratios_that_r_finds() -> None:
    """R: `exp(coef(clmm(factor(r) ~ A * B + (1 | subject), nAGQ = 15))["Aa1:Bb1"])`."""
    frame = within_frame(1, 12, (2, 2))
    frame["r"] = np.clip(np.round(np.asarray(frame["y"]) + 2.6), 1, 5)
    effect = clmm(frame, "r", **TWO).effect("A:B")
    assert 0.291552 == pytest.approx(ends(effect.effect)[0], rel=1e-4)
    assert f"ratio of odds ratios = 0.29, {effect.effect.interval} (a0 − a1" in effect.sentence()


def test_the_odds_of_groups_who_answered_once_have_the_interval_of_their_counts() -> None:
    counts = np.array([[12, 8], [5, 15], [9, 11], [4, 16]])
    y = np.concatenate([np.repeat([0.0, 1.0], pair) for pair in counts])
    frame = {"g": np.repeat(["a", "b"], 40), "h": np.tile(np.repeat(["u", "v"], 20), 2), "y": y}
    logs = np.log(counts[:, 1] / counts[:, 0])
    estimate = float(logs @ [1, -1, -1, 1])
    reach = stats.t.ppf(0.975, 76) * np.sqrt((1 / counts).sum() * 80 / 76)
    expected = np.exp([estimate, estimate - reach, estimate + reach])
    effect = clmm(frame, "y", between=("g", "h")).effect("g:h")
    assert expected == pytest.approx(ends(effect.effect), rel=1e-5)


def test_two_items_have_the_odds_of_their_counts_also_turned_round() -> None:
    vote = np.repeat([1.0, -1.0], [21, 9])
    frame = {
        "who": [f"S{i}" for i in range(30)],
        "first": ["u"] * 30,
        "second": ["v"] * 30,
        "y": vote,
    }
    result = bradley_terry(frame, "y", first="first", second="second", subject="who")
    reach = stats.t.ppf(0.975, 29) * np.sqrt((1 / 21 + 1 / 9) * 30 / 29)
    expected = 21 / 9 * np.exp([0, -reach, reach])
    assert expected == pytest.approx(ends(result.effects[0].effect), rel=1e-5)
    assert "odds = 2.33" in result.effects[0].sentence()
    assert "(u − v)" in result.effects[0].sentence()
    back = result.contrasts().contrast("v", "u")
    assert 1 / expected[[0, 2, 1]] == pytest.approx(ends(back.effect), rel=1e-5)


def test_groups_of_choosers_have_the_ratio_of_their_odds() -> None:
    vote = np.repeat([1.0, -1.0, 1.0, -1.0], [16, 9, 10, 15])
    frame = {
        "who": [f"S{i}" for i in range(50)],
        "first": ["u"] * 50,
        "second": ["v"] * 50,
        "y": vote,
        "g": ["a"] * 25 + ["b"] * 25,
    }
    result = bradley_terry(frame, "y", first="first", second="second", subject="who", between="g")
    reach = stats.t.ppf(0.975, 48) * np.sqrt((1 / 16 + 1 / 9 + 1 / 10 + 1 / 15) * 50 / 48)
    expected = 16 / 9 * 15 / 10 * np.exp([0, -reach, reach])
    assert expected == pytest.approx(ends(result.effects[1].effect), rel=1e-5)
    assert "(u − v, a − b)" in result.effects[1].sentence()


def matched(differences: np.ndarray) -> float:
    """Return (W+ − W−) / (W+ + W−) of SciPy's ranks."""
    d = np.round(differences[np.abs(differences) > 1e-9], 9)
    ranks = stats.rankdata(np.abs(d))
    return float((np.sign(d) * ranks).sum() / ranks.sum())


def aligned_means(frame: Frame, factor: str) -> pd.DataFrame:
    """Return people's mean aligned ranks by level."""
    art = statistics.art_anova(frame, "y", **TWO)
    assert art.ranks is not None
    table = pd.DataFrame({**frame, "rank": art.ranks[factor]})
    return table.pivot_table(index="subject", columns=factor, values="rank")


def of(result: Contrasts, *pairs: tuple[str, str]) -> Effect | None:
    """Return the effect of the contrast of these pairs."""
    return next(c.effect for c in result.contrasts if c.pairs == pairs)


def test_a_contrast_of_aligned_ranks_has_the_rank_biserial_of_peoples_mean_ranks() -> None:
    frame = within_frame(4, 13)
    result = statistics.art_contrasts(statistics.art_anova(frame, "y", **TWO), "B")
    means = aligned_means(frame, "B")
    for pair in result.contrasts:
        ((a, b),) = pair.pairs
        assert matched((means[a] - means[b]).to_numpy()) == pytest.approx(ends(pair.effect)[0])
        beside = statistics.wilcoxon_signed_rank(means[a].round(8), means[b].round(8))
        assert ends(beside.effect) == pytest.approx(ends(pair.effect))
        assert f"r_rb = {beside.effect.value:.2f}".replace("-", "−") in pair.sentence()


def test_a_double_difference_of_aligned_ranks_has_the_rank_biserial_of_people() -> None:
    frame = within_frame(4, 13)
    art = statistics.art_anova(frame, "y", **TWO)
    result = statistics.art_interaction_contrasts(art, "A:B")
    assert art.ranks is not None
    table = pd.DataFrame({**frame, "rank": art.ranks["A:B"]})
    cells = table.pivot_table(index="subject", columns=["A", "B"], values="rank")
    double = cells["a0", "b0"] - cells["a1", "b0"] - cells["a0", "b2"] + cells["a1", "b2"]
    effect_size = of(result, ("a0", "a1"), ("b0", "b2"))
    assert matched(double.to_numpy()) == pytest.approx(ends(effect_size)[0])


def test_aligned_ranks_of_groups_have_the_rank_biserial_of_two_groups() -> None:
    frame = mixed_frame(3, (6, 8))
    art = statistics.art_anova(frame, "y", subject="subject", within=("B",), between=("G",))
    assert art.ranks is not None
    table = pd.DataFrame({**frame, "main": art.ranks["G"], "both": art.ranks["G:B"]})
    means = table.groupby(["G", "subject"])["main"].mean().round(8)
    U = stats.mannwhitneyu(means["g0"], means["g1"]).statistic
    contrasts = statistics.art_contrasts(art, "G")
    assert 2 * U / 48 - 1 == pytest.approx(ends(contrasts.contrasts[0].effect)[0])
    cells = table.pivot_table(index=["G", "subject"], columns="B", values="both")
    change = (cells["b0"] - cells["b1"]).round(8)
    U = stats.mannwhitneyu(change["g0"], change["g1"]).statistic
    double = of(statistics.art_interaction_contrasts(art, "G:B"), ("g0", "g1"), ("b0", "b1"))
    assert 2 * U / 48 - 1 == pytest.approx(ends(double)[0])


def test_joined_cells_are_matched_within_a_group_and_apart_between_groups() -> None:
    frame = mixed_frame(3, (6, 8))
    art = statistics.art_anova(frame, "y", subject="subject", within=("B",), between=("G",))
    result = statistics.art_contrasts(art, "G:B")
    people = {c.label: c.effect for c in result.contrasts}
    assert 15 == len(people)
    assert art.aligned is not None
    joint = join_factors(art.design, ("G", "B"))
    ranks = aligned_ranks(aligned_columns(joint)["G:B"], joint.y)
    cells = pd.DataFrame({**frame, "rank": ranks}).pivot_table(
        index=["G", "subject"], columns="B", values="rank"
    )
    apart = statistics.mann_whitney(cells.loc["g0", "b0"], cells.loc["g1", "b2"]).effect
    assert apart == people["g0,b0 − g1,b2"]
    matched = statistics.wilcoxon_signed_rank(cells.loc["g1", "b0"], cells.loc["g1", "b2"]).effect
    assert matched == people["g1,b0 − g1,b2"]


def test_people_without_a_cell_are_compared_where_they_have_both_levels() -> None:
    frame = within_frame(4, 13)
    kept = rows(frame, np.delete(np.arange(78), 1))  # person 0 without a0, b1
    art = statistics.art_anova(kept, "y", subject="subject", within=("A", "B"), missing="mixed")
    assert art.ranks is not None
    table = pd.DataFrame({**kept, "rank": art.ranks["B"]})
    cells = table.pivot_table(index="subject", columns=["B", "A"], values="rank")
    per_cell = pd.DataFrame({a: cells["b0", a] - cells["b1", a] for a in ("a0", "a1")})
    effect_size = of(statistics.art_contrasts(art, "B"), ("b0", "b1"))
    assert matched(per_cell.mean(axis=1).round(8).to_numpy()) == pytest.approx(ends(effect_size)[0])


def test_double_differences_of_groups_and_groups_of_two_say_that_they_have_no_effect_size() -> None:
    rng = np.random.default_rng(1)
    frame = {"g": np.repeat(["a", "b"], 8), "h": np.tile(["u", "v"], 8), "y": rng.normal(size=16)}
    art = statistics.art_anova(frame, "y", between=("g", "h"))
    (double,) = statistics.art_interaction_contrasts(art, "g:h").contrasts
    assert double.effect is None
    assert double.sentence().endswith(", no effect size")
    small = mixed_frame(1, (2, 6))
    art = statistics.art_anova(small, "y", subject="subject", within=("B",), between=("G",))
    (pair,) = statistics.art_contrasts(art, "G").contrasts
    assert pair.effect is None


@pytest.mark.usefixtures("normal_tails")
def test_contrasts_beside_groups_have_dz_by_the_spread_within_groups() -> None:
    frame = pd.DataFrame(mixed_frame(3, (6, 8)))
    result = statistics.posthoc(
        statistics.rm_anova(frame, "y", subject="subject", within=("B",), between=("G",)), "B"
    )
    wide = frame.pivot_table(index=["G", "subject"], columns="B", values="y")
    change = wide["b0"] - wide["b1"]
    groups = change.groupby("G")
    sd = np.sqrt((groups.var() * (groups.size() - 1)).sum() / 12)
    value = groups.mean().mean() / sd
    scale = np.sqrt(1 / 6 + 1 / 8) / 2
    pair = result.contrast("b0", "b1")
    assert noncentral(value / scale, 12, scale) == pytest.approx(ends(pair.effect), abs=1e-6)
