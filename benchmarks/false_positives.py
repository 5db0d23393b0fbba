"""Print how often each test finds what is not there: ``python -m benchmarks.false_positives``.

One row per kind of data and null effect, one column per test; `--studies N` simulated studies each
(1000 take about half an hour of one core). A rate counts as held when its 95 % interval touches .03
to .07; `!` marks one that is not, `w` one not held whose false findings mostly carry a warning that
the reader is shown, `c` one below .03. `--json` for programs, `--only WORD` for rows of that name.
"""

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from visavis.analysis import statistics
from visavis.analysis.statistics.anova import anova_of_design
from visavis.analysis.statistics.clmm import clmm
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.gee import Family, gee
from visavis.analysis.statistics.lmm import linear_mixed
from visavis.analysis.statistics.nonlinear_scales import nonlinear_scale_interactions
from visavis.analysis.statistics.power_estimates import proportion_interval
from visavis.analysis.statistics.results import Array
from visavis.analysis.statistics_report.prepare import uneven_changes, uneven_groups

ALPHA = 0.05
HELD = (0.03, 0.07)
N = 16
COMPARED_ONLY = frozenset({"intercept", "clmm ratio"})
"""Tests that no command and no study takes by itself; they stand beside the one that is taken."""
MIXED_SHARE = 10
"""A linear mixed model of trials takes a hundred times as long as a t test; it runs once in ten."""
Frame = dict[str, Any]
Tested = tuple[float, Sequence[str]]
"""p of the null effect, and the warnings printed with it."""
Test = Callable[[Frame, str], Tested]

NO_A, NO_B = np.zeros((2, 1)), np.zeros((1, 3))
A_EFFECT, B_EFFECT = np.array([[0.0], [1.2]]), np.array([[0.0, 0.8, 1.6]])


@dataclass(frozen=True)
class Situation:
    """A kind of data: `make` returns a study in which `null` has no effect."""

    name: str
    null: str
    make: Callable[[np.random.Generator], Frame]
    tests: Mapping[str, Test]


# ---- data ----


def people(rng: np.random.Generator, effects: Array, *, differ: float = 0.0) -> Array:
    """Return latent scores of 16 people in 2 × 3 cells; `differ` is the SD of their own effects."""
    z = rng.normal(size=(N, 2, 3)) + rng.normal(size=(N, 1, 1)) + effects
    if differ:
        z = z + rng.normal(0, differ, (N, 2, 1)) + rng.normal(0, differ, (N, 1, 3))
    return z


def tidy(y: Array) -> Frame:
    """Return cells (people, 2, 3) or trials (people, 2, 3, n) as a tidy frame."""
    place = np.indices(y.shape)
    return {"s": place[0].ravel(), "A": place[1].ravel(), "B": place[2].ravel(), "y": y.ravel()}


def rating(z: Array) -> Array:
    """Return ratings from 1 to 9, a fifth to a half of them 9."""
    return np.clip(np.round(6.5 + 1.3 * z), 1, 9)


def share(z: Array, rng: np.random.Generator) -> Array:
    """Return shares of nine trials."""
    return rng.binomial(9, 1 / (1 + np.exp(-(1 + z)))) / 9


def spread_apart(z: Array, rng: np.random.Generator) -> Array:
    """Return scores that spread three times as far in one condition of each factor."""
    y = z.copy()
    y[:, 1] += rng.normal(0, 2, (N, 3))
    y[:, :, 2] += rng.normal(0, 3, (N, 1))
    return y


def with_holes(frame: Frame, rng: np.random.Generator, n: int = 6) -> Frame:
    """Return a frame without some cells, never all of a person's."""
    kept = np.sort(rng.permutation(frame["y"].size)[n:])
    return {k: v[kept] for k, v in frame.items()}


def trials_of(z: Array, rng: np.random.Generator, n: int = 6) -> Array:
    """Return trials scattered around cells."""
    return z[..., None] + rng.normal(0, 1, (*z.shape, n))


def groups(
    rng: np.random.Generator,
    sizes: Sequence[int],
    sds: Sequence[float],
    of: Callable[[Array], Array],
) -> Frame:
    """Return independent groups of equal mean before `of` bends the scale."""
    z = np.concatenate([rng.normal(0, sd, n) for n, sd in zip(sizes, sds, strict=True)])
    return {"g": np.repeat(np.arange(len(sizes)), sizes), "y": of(z)}


# ---- tests ----


def anova(frame: Frame, null: str, **options: Any) -> Tested:
    """Repeated-measures ANOVA."""
    made = statistics.rm_anova(frame, "y", subject="s", within=("A", "B"), **options)
    return made.effect(null).p_used, bent(made, null)


def bent(made: statistics.Anova, null: str) -> list[str]:
    """Return the warnings that the report adds to an ANOVA about one effect."""
    notes = nonlinear_scale_interactions(made.design, made.effects, ALPHA)
    return [n for n in notes if n.startswith(f"{null}: ")]


def art(frame: Frame, null: str, **options: Any) -> Tested:
    """Aligned rank transform, as shipped or with options; notes that name another term are no
    warning of this one.
    """
    made = statistics.art_anova(frame, "y", subject="s", within=("A", "B"), **options)
    notes = [n for n in made.provenance.notes if ": " not in n or n.startswith(f"{null}: ")]
    return made.effect(null).p_used, notes


def normal_scores(frame: Frame, null: str) -> Tested:
    """Inverse-normal ranks."""
    return art(frame, null, transform="int")


def uncorrected_art(frame: Frame, null: str) -> Tested:
    """ART as ARTool computes it, without a correction for sphericity."""
    return art(frame, null, correction="none")


def intercept_alone(frame: Frame, null: str) -> Tested:
    """Mixed model with one pooled error, for comparison."""
    made = statistics.mixed_anova(frame, "y", subject="s", within=("A", "B"), random="intercept")
    return made.effect(null).p, ()


def mixed(frame: Frame, null: str) -> Tested:
    """Mixed model of cells in which people differ in every effect."""
    made = statistics.mixed_anova(frame, "y", subject="s", within=("A", "B"))
    uneven_spread = False
    if made.design.is_complete:
        sphericity = anova_of_design(made.design, subject="s").effect(null).sphericity
        uneven_spread = sphericity is not None and (sphericity.p is None or sphericity.p < ALPHA)
    return made.effect(null).p, [*bent(made, null), *(["not spherical"] if uneven_spread else [])]


def mixed_art(frame: Frame, null: str) -> Tested:
    """ART with missing cells."""
    return art(frame, null, missing="mixed")


def listwise(frame: Frame, null: str) -> Tested:
    """Repeated-measures ANOVA of the people who have all cells."""
    return anova(frame, null, missing="listwise")


def trial_model(frame: Frame, null: str) -> Tested:
    """Linear mixed model of single trials, maximal."""
    made = linear_mixed(frame, "y", subject="s", within=("A", "B"))
    return made.effect(null).p, ()


def equations(family: Family) -> Test:
    """Estimating equations of single trials."""

    def test(frame: Frame, null: str) -> Tested:
        made = gee(frame, "y", subject="s", within=("A", "B"), family=family)
        return made.effect(null).p, ()

    return test


def cumulative(frame: Frame, null: str) -> Tested:
    """Cumulative link mixed model of single ratings."""
    return clmm(frame, "y", subject="s", within=("A", "B")).effect(null).p, ()


def likelihood_ratio(frame: Frame, null: str) -> Tested:
    """The same model's likelihood ratio, which takes people for alike in their effects."""
    return clmm(frame, "y", subject="s", within=("A", "B")).effect(null).chi2_p, ()


def averaged(frame: Frame, factor: str) -> Array:
    """Return means by person and level of one factor, (people, k)."""
    k = int(frame[factor].max()) + 1
    code = frame["s"] * k + frame[factor]
    return (np.bincount(code, frame["y"]) / np.bincount(code)).reshape(-1, k)


def decided_pair(frame: Frame, null: str) -> Tested:
    """The decision path of pairs: Shapiro-Wilk, then paired t or Wilcoxon."""
    x = averaged(frame, null)
    return statistics.compare_paired(x[:, 0], x[:, 1]).p, ()


def paired_t(frame: Frame, null: str) -> Tested:
    """Paired t test."""
    x = averaged(frame, null)
    return statistics.paired_t(x[:, 0], x[:, 1]).p, ()


def wilcoxon(frame: Frame, null: str) -> Tested:
    """Wilcoxon's signed-rank test."""
    x = averaged(frame, null)
    return statistics.wilcoxon_signed_rank(x[:, 0], x[:, 1]).p, ()


def long(x: Array, name: str) -> Frame:
    """Return means by person and level as a tidy frame."""
    place = np.indices(x.shape)
    return {"s": place[0].ravel(), name: place[1].ravel(), "y": x.ravel()}


def friedman(frame: Frame, null: str) -> Tested:
    """Friedman's test."""
    table = long(averaged(frame, null), null)
    return statistics.friedman(table, "y", subject="s", within=null).p, ()


def decided_conditions(frame: Frame, null: str) -> Tested:
    """The decision path of three conditions: Shapiro-Wilk, then ANOVA or Friedman."""
    table = long(averaged(frame, null), null)
    made = statistics.compare_conditions(table, "y", subject="s", within=null)
    return made.p, made.provenance.notes


def two(frame: Frame) -> tuple[Array, Array]:
    """Return the two groups."""
    return frame["y"][frame["g"] == 0], frame["y"][frame["g"] == 1]


def uneven(frame: Frame) -> Sequence[str]:
    """Return the warning that the report adds where spreads and sizes of groups differ."""
    design = statistics.read_design(frame, "y", subject=None, between=("g",))
    return uneven_groups(design, "Welch's")


def welch_t(frame: Frame, null: str) -> Tested:
    """Welch's t test."""
    return statistics.independent_t(*two(frame), equal_variances=False).p, ()


def student_t(frame: Frame, null: str) -> Tested:
    """Student's t test, for comparison."""
    return statistics.independent_t(*two(frame)).p, uneven(frame)


def mann_whitney(frame: Frame, null: str) -> Tested:
    """Mann-Whitney test."""
    return statistics.mann_whitney(*two(frame)).p, uneven(frame)


def classic_anova(frame: Frame, null: str) -> Tested:
    """One-way ANOVA, for comparison."""
    return statistics.oneway_anova(frame, "y", factor="g").p, uneven(frame)


def welch_anova(frame: Frame, null: str) -> Tested:
    """Welch's ANOVA."""
    return statistics.welch_anova(frame, "y", factor="g").p, ()


def kruskal(frame: Frame, null: str) -> Tested:
    """Kruskal-Wallis test."""
    return statistics.kruskal_wallis(frame, "y", factor="g").p, uneven(frame)


def correlated(frame: Frame, null: str) -> Tested:
    """Spearman's correlation of a measure with a score."""
    return statistics.spearman(frame["x"], frame["y"]).p, ()


def grouped_anova(frame: Frame, null: str) -> Tested:
    """Mixed ANOVA of groups over conditions."""
    made = statistics.rm_anova(frame, "y", subject="s", within=("c",), between=("g",))
    return made.effect(null).p_used, uneven_changes(made.design)


# ---- situations ----

FACTORIAL: Mapping[str, Test] = {
    "rm": anova,
    "art": art,
    "art uncorrected": uncorrected_art,
    "int": normal_scores,
    "mixed": mixed,
}
PAIRS: Mapping[str, Test] = {"paired": decided_pair, "t": paired_t, "wilcoxon": wilcoxon}
CONDITIONS: Mapping[str, Test] = {"conditions": decided_conditions, "friedman": friedman}
TRIALS: Mapping[str, Test] = {"lmm": trial_model, "gee": equations("gaussian")}
TWO_GROUPS: Mapping[str, Test] = {"t": welch_t, "student": student_t, "mannwhitney": mann_whitney}
SCORES: Mapping[str, Test] = {"spearman": correlated}
GROUPED: Mapping[str, Test] = {"rm": grouped_anova}
MORE_GROUPS: Mapping[str, Test] = {"welch": welch_anova, "anova": classic_anova, "kruskal": kruskal}


def within(
    name: str,
    bend: Callable[[Array, np.random.Generator], Array],
    more: Mapping[str, Test] | None = None,
    **how: float,
) -> list[Situation]:
    """Return a kind of within data with A, B and A:B null in turn, the other effects strong."""
    effects = {"A": NO_A + B_EFFECT, "B": A_EFFECT + NO_B, "A:B": A_EFFECT + B_EFFECT}
    own = {"A": PAIRS, "B": CONDITIONS, "A:B": {}}

    def maker(effect: Array) -> Callable[[np.random.Generator], Frame]:
        return lambda rng: tidy(bend(people(rng, effect, **how), rng))

    return [
        Situation(name, t, maker(e), {**FACTORIAL, **own[t], **(more or {})})
        for t, e in effects.items()
    ]


def situations() -> list[Situation]:
    """Return all rows of the table."""

    def holed(rng: np.random.Generator) -> Frame:
        return with_holes(tidy(people(rng, NO_A + B_EFFECT, differ=1.0)), rng)

    def trial(rng: np.random.Generator) -> Frame:
        return tidy(trials_of(people(rng, NO_A + B_EFFECT, differ=0.7), rng))

    def choice(rng: np.random.Generator) -> Frame:
        z = trials_of(people(rng, NO_A + B_EFFECT - 0.8, differ=0.5), rng, 8)
        return tidy((rng.random(z.shape) < 1 / (1 + np.exp(-z))).astype(float))

    def ratings(rng: np.random.Generator) -> Frame:
        z = people(rng, NO_A + B_EFFECT, differ=0.7)
        return tidy(rating(trials_of(z, rng, 3)))

    def scores(bend: Callable[[Array], Array], n: int) -> Callable[[np.random.Generator], Frame]:
        return lambda rng: {
            "x": np.round(46 + 21 * rng.normal(size=n)),
            "y": bend(rng.normal(size=n)),
        }

    def over_conditions(
        sizes: tuple[int, int], sds: tuple[float, float]
    ) -> Callable[[np.random.Generator], Frame]:
        g = np.repeat([0, 1], sizes)

        def make(rng: np.random.Generator) -> Frame:
            y = rng.normal(size=(g.size, 3)) * np.array(sds)[g][:, None]
            y = y + rng.normal(size=(g.size, 1)) + np.array([0.0, 0.8, 1.6])
            frame = tidy(y[:, :, None])
            return {"s": frame["s"], "c": frame["A"], "g": g[frame["s"]], "y": frame["y"]}

        return make

    same: Callable[[Array], Array] = np.asarray
    return [
        *within("normal", lambda z, rng: z),
        *within("lognormal", lambda z, rng: np.exp(z)),
        *within("rating at its ceiling", lambda z, rng: rating(z), {"clmm": cumulative}),
        *within("share of 9 trials", share),
        *within("people differ", lambda z, rng: z, differ=1.0),
        *within("spread differs", spread_apart),
        Situation(
            "missing cells, people differ",
            "A",
            holed,
            {"mixed": mixed, "rm": listwise, "art": mixed_art, "intercept": intercept_alone},
        ),
        Situation("single trials, people differ", "A", trial, TRIALS),
        Situation("single choices, people differ", "A", choice, {"gee": equations("binomial")}),
        Situation(
            "single ratings, people differ",
            "A",
            ratings,
            {"clmm": cumulative, "clmm ratio": likelihood_ratio},
        ),
        Situation(
            "groups of 6 and 18, SD 3 and 1",
            "g",
            lambda rng: groups(rng, (6, 18), (3, 1), same),
            TWO_GROUPS,
        ),
        Situation(
            "groups of 8 and 24, ratings",
            "g",
            lambda rng: groups(rng, (8, 24), (1, 1), rating),
            TWO_GROUPS,
        ),
        Situation(
            "groups of 10 and 10, lognormal",
            "g",
            lambda rng: groups(rng, (10, 10), (1, 1), np.exp),
            TWO_GROUPS,
        ),
        Situation(
            "groups of 6, 10, 18, SD 3, 2, 1",
            "g",
            lambda rng: groups(rng, (6, 10, 18), (3, 2, 1), same),
            MORE_GROUPS,
        ),
        Situation("score of 30 people, normal", "r", scores(same, 30), SCORES),
        Situation("score of 30 people, lognormal", "r", scores(np.exp, 30), SCORES),
        Situation("score of 9 people, ratings", "r", scores(rating, 9), SCORES),
        Situation(
            "groups of 12 and 12 over conditions", "c:g", over_conditions((12, 12), (1, 1)), GROUPED
        ),
        Situation(
            "groups of 8 and 23 over conditions", "c:g", over_conditions((8, 23), (1, 1)), GROUPED
        ),
        Situation("the same, SD 3 and 1", "c:g", over_conditions((8, 23), (3, 1)), GROUPED),
    ]


# ---- the table ----


@dataclass(frozen=True)
class Rate:
    """How often one test found a null effect, and how many of these findings carried a warning."""

    situation: str
    null: str
    test: str
    rate: float
    low: float
    high: float
    warned: float
    studies: int
    refused: int

    @property
    def mark(self) -> str:
        """Nothing when held, 'c' when below, 'w' when most findings are warned of, else '!'."""
        if self.test in COMPARED_ONLY or (self.low <= HELD[1] and self.high >= HELD[0]):
            return ""
        if self.rate < HELD[0]:
            return "c"
        return "w" if self.warned >= 0.5 else "!"


def measure(situation: Situation, n_studies: int, seed: int) -> list[Rate]:
    """Simulate the studies of one row and run its tests on each."""
    rng = np.random.default_rng(seed)
    counts = {name: [0, 0, 0, 0] for name in situation.tests}
    for i in range(n_studies):
        frame = situation.make(rng)
        for name, test in situation.tests.items():
            if name == "lmm" and i % MIXED_SHARE:
                continue
            count = counts[name]
            try:
                p, warnings = test(frame, situation.null)
            except StatisticsError:
                count[3] += 1
                continue
            count[0] += 1
            if p < ALPHA:
                count[1] += 1
                count[2] += bool(warnings)
    rates = []
    for name, (done, hits, warned, refused) in counts.items():
        interval = proportion_interval(hits, max(done, 1))
        rates.append(
            Rate(
                situation.name,
                situation.null,
                name,
                hits / max(done, 1),
                interval.low,
                interval.high,
                warned / max(hits, 1),
                done,
                refused,
            )
        )
    return rates


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=400)
    parser.add_argument("--only", default="")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rates = []
    for seed, situation in enumerate(situations()):
        if options.only not in situation.name:
            continue
        row = measure(situation, options.studies, seed)
        rates += row
        if not options.json:
            cells = "  ".join(f"{r.test} {f'{r.rate:.3f}'.lstrip('0')}{r.mark}" for r in row)
            print(f"{situation.name:32} {situation.null:4} {cells}", flush=True)
    if options.json:
        print(json.dumps([{**r.__dict__, "mark": r.mark} for r in rates], indent=1))
        return
    loose = [r for r in rates if r.mark == "!"]
    print(
        f"{len(rates)} rates of {options.studies} studies; {len(loose)} outside .03 to .07 without"
    )
    print(
        "a warning: "
        + ("; ".join(f"{r.test} on {r.situation} ({r.null})" for r in loose) or "none")
    )


if __name__ == "__main__":
    main()
