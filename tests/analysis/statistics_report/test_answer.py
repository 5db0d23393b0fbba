"""A question asked of a frame: an outcome without files, printing or the command line."""

import re
import subprocess
import sys
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from visavis.analysis.statistics import describe, rm_anova
from visavis.analysis.statistics_report import Question, answer
from visavis.lab.errors import DataError, LabError, UsageError

RM = Question("rm", dv="y", within=("A",), subject="s")


def people(n: int = 12, trials: int = 1, seed: int = 3) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    frame = pd.DataFrame(
        [(s, a, t) for s in range(n) for a in ("low", "mid", "high") for t in range(trials)],
        columns=["s", "A", "trial"],
    )
    level = frame["A"].map({"low": 0.0, "mid": 0.5, "high": 1.4})
    frame["y"] = level + rng.normal(size=n)[frame["s"]] + rng.normal(size=len(frame))
    frame["hit"] = rng.random(len(frame)) < 1 / (1 + np.exp(-frame["y"]))
    return frame


CODE = """
import sys
import visavis.analysis.statistics_report
heavy = ("cli", "typer", "rich", "statsmodels")
print([name for name in heavy if name in sys.modules])
"""


def test_the_engine_needs_no_command_line_and_waits_with_statsmodels() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=False)
    assert "[]" == done.stdout.strip(), done.stderr


def test_a_frame_is_answered_with_the_numbers_of_the_library(
    capsys: pytest.CaptureFixture[str],
) -> None:
    frame = people()
    expected = rm_anova(frame, "y", subject="s", within=("A",)).effect("A")
    outcome = answer(frame, RM)
    assert expected.p_used == pytest.approx(outcome.p("A"))
    assert expected.F == pytest.approx(outcome.row()["F"])
    assert ("", "") == capsys.readouterr()


def test_categories_keep_their_order() -> None:
    frame = people()
    frame["A"] = pd.Categorical(frame["A"], ["low", "mid", "high", "never"], ordered=True)
    assert ["low", "mid", "high"] == [c["A"] for c in answer(frame, RM).cells]
    turned = Question(
        "rm", dv="y", within=("A",), subject="s", levels={"A": ["mid", "high", "low"]}
    )
    assert ["mid", "high", "low"] == [c["A"] for c in answer(frame, turned).cells]


def test_a_row_is_found_by_its_term_in_any_order() -> None:
    frame = people(trials=2)
    question = Question("rm", dv="y", within=("A", "trial"), subject="s")
    outcome = answer(frame, question)
    assert outcome.row("A:trial") == outcome.row("trial:A")
    with pytest.raises(UsageError, match="there are A, trial, A:trial"):
        outcome.p("B")
    pairs = answer(frame, Question("t", dv="y", within=("A",), subject="s"))
    assert pairs.row("low:high")["p_adjusted"] == pairs.p("high:low")


def test_simulated_rows_mark_the_outcome_and_mixtures_are_refused() -> None:
    assert answer(people().assign(is_simulated=True), RM).is_simulated
    mixed = people().assign(is_simulated=[True] + [False] * 35)
    with pytest.raises(DataError, match="the pilot mixes simulated and real"):
        answer(mixed, RM, name="the pilot")


@pytest.mark.parametrize("test", ["lmm", "gee"])
def test_models_take_single_trials_and_describe_people(test: str) -> None:
    frame = people(trials=6)
    outcome = answer(frame, Question(test, dv="y", within=("A",), subject="s"))
    assert any("216 rows of 12 subjects" in note for note in outcome.notes)
    assert [12, 12, 12] == [c["n"] for c in outcome.cells]
    means = frame.groupby(["s", "A"], as_index=False)["y"].mean()
    expected = {c.labels["A"]: c.sd for c in describe(means, "y", factors=["A"])}
    assert expected == pytest.approx({c["A"]: c["sd"] for c in outcome.cells})
    assert {"A"} == {c["family"] for c in outcome.contrasts}
    assert 3 == len(outcome.samples[0].conditions)


def test_true_and_false_are_choices() -> None:
    question = Question("gee", dv="hit", within=("A",), subject="s", family="binomial")
    outcome = answer(people(trials=8), question)
    assert "odds ratio" in outcome.contrast_sentences[0]
    assert any("exchangeable" in sentence for sentence in outcome.sentences)


def test_trials_lost_are_refused_or_left_out_as_asked() -> None:
    frame = people(trials=6)
    frame.loc[[0, 40], "y"] = np.nan
    with pytest.raises(DataError, match=r"row 1 \(subject 0, A low\) and 1 more rows"):
        answer(frame, Question("lmm", dv="y", within=("A",), subject="s"))
    kept = answer(frame, Question("lmm", dv="y", within=("A",), subject="s", missing="mixed"))
    assert any("214 rows of 12 subjects" in note for note in kept.notes)


def test_people_differ_in_a_rating_model_as_asked() -> None:
    frame = people(trials=6)
    frame["y"] = np.clip(np.round(frame["y"] + 2), 1, 5)
    request = Question("clmm", dv="y", within=("A",), subject="s")
    plain, slopes = (answer(frame, replace(request, random=r)) for r in ("", "A"))
    assert plain.rows == answer(frame, replace(request, random="intercept")).rows
    assert "random intercept and slopes of A per s, correlated" in slopes.sentences[0]
    assert slopes.row("A")["chi2"] != pytest.approx(plain.row("A")["chi2"], rel=1e-3)
    assert slopes.rows == answer(frame, replace(request, random="maximal")).rows
    fine = answer(frame, replace(request, random="A", nodes=7))
    assert slopes.row("A")["chi2"] == pytest.approx(fine.row("A")["chi2"], rel=0.1)
    assert slopes.row("A")["chi2"] != fine.row("A")["chi2"]


def test_how_people_differ_is_never_asked_in_vain() -> None:
    with pytest.raises(UsageError, match="random goes with lmm, clmm, bradleyterry, not with gee"):
        Question("gee", random="maximal")
    with pytest.raises(UsageError, match="nodes goes with clmm, bradleyterry, not with lmm"):
        Question("lmm", nodes=9)
    assert 9 == Question("bradleyterry", nodes=9).model.nodes
    with pytest.raises(DataError, match="no factor 'all'"):
        answer(
            people().assign(y=np.tile([1, 2], 18)),
            Question("clmm", dv="y", within=("A",), subject="s", random="all"),
        )


def test_a_test_nobody_knows_is_answered_with_the_nearest() -> None:
    with pytest.raises(UsageError, match="did you mean lmm"):
        answer(people(), Question("lm", dv="y"))
    with pytest.raises(UsageError, match="alpha lies between 0 and 1"):
        Question("rm", alpha=5)


# ---- the data told are the data tested ----


@pytest.mark.parametrize("test", ["rm", "art", "friedman", "conditions", "t", "wilcoxon", "lmm"])
def test_cells_are_those_of_the_people_tested(test: str) -> None:
    frame = people()
    outlier = frame["s"] == 4
    frame.loc[outlier, "y"] += 100
    holed = frame[~(outlier & (frame["A"] == "mid"))]
    question = Question(test, dv="y", within=("A",), subject="s", missing="listwise")
    outcome = answer(holed, question)
    expected = describe(frame[~outlier], "y", factors=["A"])
    assert {c.labels["A"]: (11, c.mean) for c in expected} == {
        c["A"]: (c["n"], pytest.approx(c["mean"])) for c in outcome.cells
    }
    assert any("left out: subject 4" in note for note in outcome.notes)


@pytest.mark.parametrize("test", ["rm", "art", "friedman", "conditions", "t", "wilcoxon"])
def test_whom_listwise_leaves_out_changes_no_number_figure_or_sentence(test: str) -> None:
    frame = people()
    outlier = frame["s"] == 4
    frame.loc[outlier, "y"] += 100
    holed = frame[~(outlier & (frame["A"] == "mid"))]
    question = Question(test, dv="y", within=("A",), subject="s", always_posthoc=True)
    expected = answer(frame[~outlier], question)
    result = answer(holed, replace(question, missing="listwise"))
    told_apart = {"dropped", "notes"}  # who was left out stands there
    for known, row in zip(
        (*expected.rows, *expected.contrasts), (*result.rows, *result.contrasts), strict=True
    ):
        assert {k: v for k, v in known.items() if k not in told_apart} == {
            k: v for k, v in row.items() if k not in told_apart
        }
    assert expected.sentences + expected.contrast_sentences == (
        result.sentences + result.contrast_sentences
    )
    assert expected.path == result.path
    assert 1 <= len(expected.samples) == len(result.samples)
    for sample, kept in zip(result.samples, expected.samples, strict=True):
        assert {k: v.tolist() for k, v in kept.conditions.items()} == {
            k: v.tolist() for k, v in sample.conditions.items()
        }
    assert result.data is not None
    assert sorted({*range(12)} - {4}) == sorted({int(s) for s in result.data["s"]})


@pytest.mark.parametrize("groups_differ", [True, False])
def test_kruskal_wallis_goes_on_to_dunns_pairs_where_it_should(groups_differ: bool) -> None:
    """By hand from mean ranks of tied values; adjusted by Holm."""
    groups = {"a": [1.0, 2, 2, 3, 4], "b": [2.0, 3, 3, 4, 5, 6], "c": [5.0, 6, 6, 7, 8, 8, 9]}
    if not groups_differ:
        groups["c"] = [1.0, 2, 3, 4, 5, 3, 2]
    frame = pd.DataFrame([(g, y) for g, ys in groups.items() for y in ys], columns=["g", "y"])
    question = Question("kruskal", dv="y", between=("g",))
    outcome = answer(frame, question)
    assert groups_differ == (outcome.p() < 0.05)
    if not groups_differ:
        assert () == outcome.contrasts
        outcome = answer(frame, replace(question, always_posthoc=True))
    rank = frame["y"].rank()
    n = len(frame)
    ties = sum(k**3 - k for k in frame["y"].value_counts())
    spread = n * (n + 1) / 12 - ties / (12 * (n - 1))
    mean, size = rank.groupby(frame["g"]).mean(), frame.groupby("g").size()
    pairs = [("a", "b"), ("a", "c"), ("b", "c")]
    z = [(mean[a] - mean[b]) / np.sqrt(spread * (1 / size[a] + 1 / size[b])) for a, b in pairs]
    p = 2 * stats.norm.sf(np.abs(z))
    assert pairs == [(c["level_1"], c["level_2"]) for c in outcome.contrasts]
    assert list(z) == pytest.approx([c["z"] for c in outcome.contrasts])
    assert multipletests(p, method="holm")[1].tolist() == pytest.approx(
        [c["p_adjusted"] for c in outcome.contrasts]
    )
    assert 3 == sum("(Holm)" in said for said in outcome.contrast_sentences)


def test_a_verdict_that_hangs_on_people_with_missing_cells_is_told() -> None:
    """Person 0 alone makes the effect; without one of its cells listwise leaves it out."""
    rng = np.random.default_rng(1)
    frame = pd.DataFrame(
        [(s, a, b) for s in range(9) for a in "xy" for b in "pqr"], columns=["s", "A", "B"]
    )
    own = rng.normal(size=9)
    frame["y"] = rng.normal(size=54) + (frame["A"] == "y") * (0.55 + 0.2 * own[frame["s"]])
    frame.loc[(frame["s"] < 3) & (frame["A"] == "y"), "y"] += 1.2
    holed = frame[~((frame["s"] < 3) & (frame["A"] == "x") & (frame["B"] == "q"))]
    question = Question("mixed", dv="y", within=("A", "B"), subject="s", missing="mixed")
    outcome = answer(holed, question)
    listwise = answer(holed, replace(question, test="rm", missing="listwise"))
    assert outcome.p("A") < 0.05 <= listwise.p("A")
    assert any(n.startswith("A: p") and "of the 6 people" in n for n in outcome.notes)
    assert any("effects of A and B" in sentence for sentence in outcome.sentences)


def test_a_t_test_adds_equivalence_and_a_bayes_factor_when_asked() -> None:
    frame = people()
    frame = frame[frame["A"] != "high"]
    plain = Question("t", dv="y", within=("A",), subject="s")
    more = replace(plain, bayes=True, low=-0.5, high=0.5)
    outcome = answer(frame, more)
    equivalence = answer(frame, replace(plain, test="tost", low=-0.5, high=0.5))
    assert answer(frame, plain).p() == outcome.p()
    assert equivalence.p() == outcome.row()["p_equivalence"]
    assert "BF₁₀ = " in outcome.sentences[0]
    assert equivalence.sentences[0] == outcome.sentences[1]
    assert any("Cauchy prior" in note for note in outcome.notes)
    with pytest.raises(DataError, match="two conditions"):
        answer(people(), more)


def test_a_mixed_model_of_cells_names_errors_that_are_not_spherical() -> None:
    frame = people(n=20)
    question = Question("mixed", dv="y", within=("A",), subject="s")
    assert not any("not spherical" in n for n in answer(frame, question).notes)
    own = np.random.default_rng(5).normal(0, 4, 20)
    frame.loc[frame["A"] == "high", "y"] += own[frame.loc[frame["A"] == "high", "s"]]
    assert any(n.startswith("A: people's") for n in answer(frame, question).notes)


@pytest.mark.parametrize("test", ["mannwhitney", "kruskal", "anova", "t"])
def test_groups_that_spread_unequally_bring_a_warning_where_spread_is_pooled(test: str) -> None:
    rng = np.random.default_rng(4)
    frame = pd.DataFrame({"g": ["few"] * 6 + ["many"] * 18, "y": rng.normal(size=24)})
    question = Question(test, dv="y", between=("g",), equal_variances=test == "t")
    assert not any("SD is" in note for note in answer(frame, question).notes)
    frame.loc[:5, "y"] *= 5
    assert any(n.startswith("SD is") and "6 and" in n for n in answer(frame, question).notes)
    welch = Question("t", dv="y", between=("g",))
    assert not any("SD is" in note for note in answer(frame, welch).notes)


@pytest.mark.parametrize("test", ["rm", "art", "mixed"])
def test_groups_whose_changes_spread_unequally_bring_a_warning_about_pooling_them(
    test: str,
) -> None:
    rng = np.random.default_rng(4)
    s, c = np.repeat(np.arange(24), 3), np.tile([0, 1, 2], 24)
    frame = pd.DataFrame({"s": s, "c": c, "g": np.where(s < 6, "few", "many")})
    frame["y"] = rng.normal(size=72) + rng.normal(0, 5, 24)[s]
    question = Question(test, dv="y", within=("c",), between=("g",), subject="s")
    assert not any("differences between" in note for note in answer(frame, question).notes)
    few = frame["s"] < 6
    frame.loc[few, "y"] += rng.normal(0, 4, 18)
    told = [n for n in answer(frame, question).notes if "differences between conditions" in n]
    assert 1 == len(told)
    assert "in a group of 6 and" in told[0]


def test_aligned_ranks_are_corrected_for_sphericity_unless_asked_otherwise() -> None:
    question = Question("art", dv="y", within=("A",), subject="s")
    corrected = answer(people(), question)
    assert "Greenhouse-Geisser" == corrected.row()["sphericity_correction"]
    assert corrected.row()["p_gg"] == corrected.p() > corrected.row()["p"]
    assert corrected.row()["p"] == answer(people(), replace(question, correction="none")).p()


def test_options_of_another_test_are_refused_and_not_passed_over() -> None:
    with pytest.raises(UsageError, match=r"a Bayes factor stands beside the tests .*, not art"):
        Question("art", dv="y", within=("A",), subject="s", bayes=True)
    with pytest.raises(UsageError, match="bounds of equivalence"):
        Question("wilcoxon", dv="y", within=("A",), subject="s", low=-1.0)


def test_contrasts_in_ranks_say_so_and_how_far_the_means_differ() -> None:
    frame = people(trials=2).rename(columns={"trial": "B"})
    request = Question("art", dv="y", within=("A", "B"), subject="s")
    outcome = answer(frame, request)
    of_a = next(said for said in outcome.contrast_sentences if said.startswith("ART-C of A ("))
    means = frame.groupby("A")["y"].mean()
    assert "Estimates and SE are in aligned ranks, not in the unit of y" in of_a
    assert f"low − mid {means['low'] - means['mid']:.2f}".replace("-", "−") in of_a


DWELL = Question(
    "paired",
    dv="dwell_ms",
    within=("gaze",),
    subject="participant",
    levels={"gaze": ("averted", "directed")},
    level_words={"directed": "at the participant"},
)


def test_sentences_call_levels_as_asked_and_rows_keep_their_names() -> None:
    rng = np.random.default_rng(3)
    people = [f"p{i}" for i in range(9)]
    frame = pd.DataFrame(
        [(p, c, rng.normal(c == "directed", 0.4)) for p in people for c in ("averted", "directed")],
        columns=["participant", "gaze", "dwell_ms"],
    )
    question = DWELL

    result = answer(frame, question)

    assert all("averted" in said and "directed" not in said for said in result.sentences)
    assert all("at the participant" in said for said in result.sentences)
    assert "averted − at the participant" in result.path[0]
    assert ("averted", "directed") == (result.rows[0]["first"], result.rows[0]["second"])
    assert result.data is not None
    assert ["averted", "directed"] == list(result.data["gaze"].cat.categories)
    assert [["averted", "directed"]] == [list(s.conditions) for s in result.samples]
    plain = answer(frame, replace(question, level_words={}))
    assert plain.rows == result.rows
    assert plain.cells == result.cells
    assert question == result.question


def test_what_cannot_be_tested_is_told_with_levels_as_they_are_called() -> None:
    frame = pd.DataFrame(
        [(p, c, float(p)) for p in range(4) for c in ("averted", "directed")],
        columns=["participant", "gaze", "dwell_ms"],
    )
    question = replace(DWELL, test="t")

    with pytest.raises(LabError, match="averted minus at the participant is 0 in all 4 pairs"):
        answer(frame, question)


def test_a_mean_difference_has_the_unit_and_the_decimals_of_the_data() -> None:
    dwell_ms = {"averted": [500.0, 512, 480, 530], "directed": [990.0, 1050, 1020, 960]}
    frame = pd.DataFrame(
        [(i, c, v) for c, values in dwell_ms.items() for i, v in enumerate(values)],
        columns=["participant", "gaze", "dwell_ms"],
    )
    question = Question(
        "paired",
        dv="dwell_ms",
        within=("gaze",),
        subject="participant",
        levels={"gaze": ("averted", "directed")},
        measured_in="ms",
    )

    said = answer(frame, question).sentences[0]

    assert said.startswith(
        "averted and directed differ (means 506 ms and 1005 ms): paired t test of averted "
        "− directed, t(3)"
    )
    assert re.search(r"mean difference −500 ms, 95% CI \[−\d+, −\d+\] ms", said)


def test_a_question_takes_keywords_flat_and_has_them_in_parts():
    question = Question("tost", dv="y", low=-1.0, high=1.0, alpha=0.01, measured_in="ms")

    assert (-1.0, 1.0, "raw") == (
        question.reference.low,
        question.reference.high,
        question.reference.unit,
    )
    assert (0.01, "ms") == (question.decision.alpha, question.wording.measured_in)
    assert question == replace(question, test="tost")
    assert 0.1 == replace(question, decision=replace(question.decision, alpha=0.1)).decision.alpha
    with pytest.raises(FrozenInstanceError):
        question.test = "t"
    with pytest.raises(TypeError, match="'alfa'; did you mean 'alpha'"):
        Question("t", alfa=0.01)


def test_equivalence_beside_students_t_is_students() -> None:
    frame = pd.DataFrame(
        {"person": f"{group}{i}", "group": group, "y": i * spread}
        for group, spread, n in (("a", 1.0, 6), ("b", 3.0, 12))
        for i in range(n)
    )
    question = Question("t", dv="y", between=("group",), subject="person", low=-9.0, high=9.0)
    for equal, name, df in ((True, "Student", 16), (False, "Welch", None)):
        outcome = answer(frame, replace(question, equal_variances=equal))
        alone = answer(frame, replace(question, test="tost", equal_variances=equal))
        assert alone.rows[0]["p"] == outcome.rows[0]["p_equivalence"]
        assert f"equivalence, independent t ({name})" == alone.rows[0]["test"]
        assert df is None or df == alone.rows[0]["df"]
        assert f"(two one-sided tests, {name})" in outcome.sentences[-1]
