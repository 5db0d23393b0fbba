"""Print how often every interval that a report can print holds the truth.

    python -m benchmarks.interval_coverage [--studies 150] [--only r_rb] [--all]

A row is an interval and a kind of data: the lowest share over sizes and effects of the 95 %
intervals that hold the truth, where that was, and the mean over all. The truth is what the same
function finds in very many people. ✗ marks a share below .93 by more than chance (two standard
errors), · what has no interval. `--all` prints every size and effect.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from visavis.analysis import statistics
from visavis.analysis.statistics.agreement import cohen_kappa, icc, krippendorff_alpha
from visavis.analysis.statistics.binomial import binomial_test
from visavis.analysis.statistics.bradley_terry import bradley_terry
from visavis.analysis.statistics.clmm import Clmm, clmm
from visavis.analysis.statistics.gee import Gee, gee
from visavis.analysis.statistics.lmm import LinearMixed, linear_mixed
from visavis.analysis.statistics.results import Array, Interval

Measure = Callable[[Array], tuple[float, Interval | None]]
"""Values (people, conditions), or of groups as columns → the estimate and its interval."""
PROMISE = 0.93
TRUTH_N = 20_000
DIVIDED_N = 200_000
"""People for the truth of what is divided by an SD, which long tails make uncertain."""
SIZES = (8, 16, 40)
EFFECTS = (0.0, 0.5, 1.0, 2.0)
SLOW = 0.2
"""Share of the studies asked for that a fitted model gets."""


@dataclass(frozen=True)
class Promise:
    """An interval whose coverage is measured.

    `kinds` of data; `people` says that values of a row share a person, else columns are groups;
    `columns` how many conditions, trials or raters; `share` of the studies; `truth_n` people for
    the truth.
    """

    name: str
    measure: Measure
    kinds: tuple[str, ...] = ("normal", "skewed", "ratings")
    people: bool = True
    columns: int = 2
    share: float = 1.0
    truth_n: int = TRUTH_N
    sizes: tuple[int, ...] = SIZES
    effects: tuple[float, ...] = EFFECTS


def draw(kind: str, promise: Promise, effect: float, n: int, rng: np.random.Generator) -> Array:
    """Return values whose first column lies an effect (in SD) above the last, others between."""
    k = promise.columns
    if kind in ("trials", "skewed trials", "choices", "single ratings", "votes"):
        half = np.arange(k) < (k + 1) // 2
        latent = rng.normal(size=(n, 1)) + (effect + 0.5 * rng.normal(size=(n, 1))) * half
        if kind == "trials":
            return latent + rng.normal(size=(n, k))
        if kind == "skewed trials":
            return latent + np.exp(0.8 * rng.normal(size=(n, k)))
        if kind == "choices":
            return (rng.logistic(size=(n, k)) < 0.5 * latent).astype(float)
        if kind == "single ratings":
            return np.clip(np.round(3 + latent + rng.normal(size=(n, k))), 1, 5)
        taste = effect + 0.7 * rng.normal(size=(n, 1))
        return np.where(rng.logistic(size=(n, k)) < taste, 1.0, -1.0)
    shift = effect * np.linspace(1, 0, k) if k > 1 else np.array([effect])
    noise = rng.normal(size=(n, k))
    person = rng.normal(size=(n, 1)) * promise.people
    if kind == "skewed":
        return np.exp(0.8 * noise) + person + shift
    if kind == "categories":  # a rater names what they see three times of four, else any of three
        seen = rng.integers(0, 3, size=(n, 1))
        return np.where(rng.random((n, k)) < 0.75, seen, rng.integers(0, 3, size=(n, k))) * 1.0
    if kind == "ratings":
        return np.clip(np.round(4 + 1.2 * (noise + 0.8 * person + shift)), 1, 7)
    return noise + person + shift


def of_effect(effect: statistics.Effect | None) -> tuple[float, Interval | None]:
    """Return value and interval of an effect size."""
    return (np.nan, None) if effect is None else (effect.value, effect.interval)


def tidy(values: Array) -> dict[str, Any]:
    """Return people, conditions and values as columns."""
    person, condition = np.indices(values.shape)
    return {"s": person.ravel(), "c": condition.ravel(), "y": values.ravel()}


def paired(what: str, v: Array) -> tuple[float, Interval | None]:
    """Return an interval of two conditions of the same people."""
    if what == "r_rb":
        return of_effect(statistics.wilcoxon_signed_rank(v[:, 0], v[:, 1], method="normal").effect)
    t = statistics.paired_t(v[:, 0], v[:, 1])
    if what == "difference":
        return t.estimate, t.interval
    return of_effect(t.effect if what == "dz" else t.eta)


def grouped(what: str, v: Array) -> tuple[float, Interval | None]:
    """Return an interval of two groups."""
    if what == "r_rb":
        return of_effect(statistics.mann_whitney(v[:, 0], v[:, 1], method="normal").effect)
    t = statistics.independent_t(v[:, 0], v[:, 1], equal_variances=what == "Student")
    return (t.estimate, t.interval) if what in ("Welch", "Student") else of_effect(t.effect)


def alone(what: str, v: Array) -> tuple[float, Interval | None]:
    """Return an interval of one group, tested against zero."""
    t = statistics.one_sample_t(v[:, 0])
    return (t.estimate, t.interval) if what == "mean" else of_effect(t.effect)


def within(what: str, v: Array) -> tuple[float, Interval | None]:
    """Return an interval of several conditions of the same people."""
    frame = tidy(v)
    if what == "W":
        return of_effect(statistics.friedman(frame, "y", subject="s", within="c").effect)
    table = statistics.rm_anova(frame, "y", subject="s", within=("c",))
    if what == "η²p":
        return of_effect(table.effects[0].eta)
    pair = statistics.posthoc(table, "c", adjust="none").contrasts[0]
    return (pair.estimate, pair.interval) if what == "difference" else of_effect(pair.effect)


def aligned(what: str, v: Array) -> tuple[float, Interval | None]:
    """Return an interval of aligned ranks: four columns are 2 × 2 conditions."""
    person, condition = np.indices(v.shape)
    frame = {"s": person.ravel(), "A": (condition // 2).ravel(), "B": (condition % 2).ravel()}
    table = statistics.art_anova({**frame, "y": v.ravel()}, "y", subject="s", within=("A", "B"))
    if what == "η²p":
        return of_effect(table.effect("A").eta)
    return of_effect(statistics.art_contrasts(table, "A").contrasts[0].effect)


def several_groups(what: str, v: Array) -> tuple[float, Interval | None]:
    """Return an interval of three groups."""
    frame = tidy(v)
    if what == "ε²":
        return of_effect(statistics.kruskal_wallis(frame, "y", factor="c").effect)
    if what == "η²":
        return of_effect(statistics.oneway_anova(frame, "y", factor="c").eta)
    if what == "Welch η²p":
        return of_effect(statistics.welch_anova(frame, "y", factor="c").eta)
    if what == "dunn":
        return of_effect(statistics.dunn(frame, "y", factor="c")[0].effect)
    pair = statistics.tukey_hsd(frame, "y", factor="c").with_adjustment("none").contrasts[0]
    return (pair.estimate, pair.interval) if what == "difference" else of_effect(pair.effect)


def correlated(what: str, v: Array) -> tuple[float, Interval | None]:
    """Return the interval of a correlation of two columns that share a person."""
    made = getattr(statistics, what)(v[:, 0], v[:, 1])
    return made.r, made.interval


def single_trials(v: Array) -> dict[str, Any]:
    """Return rows of people (columns alternate between two conditions) as trials."""
    person, trial = np.indices(v.shape)
    return {"s": person.ravel(), "c": (trial >= v.shape[1] // 2).ravel() * 1, "y": v.ravel()}


def modelled(what: str, v: Array) -> tuple[float, Interval | None]:
    """Return an interval of a contrast in a model of single rows, two conditions of trials."""
    frame = single_trials(v)
    made: LinearMixed | Gee | Clmm
    if what.startswith("lmm"):
        made = linear_mixed(frame, "y", subject="s", within=("c",), random="components")
    elif what == "gee odds ratio":
        made = gee(frame, "y", subject="s", within=("c",), family="binomial")
    elif what == "gee d_total":
        made = gee(frame, "y", subject="s", within=("c",))
    else:
        made = clmm(frame, "y", subject="s", within=("c",))
    pair = made.contrasts("c", adjust="none").contrasts[0]
    if what == "lmm difference":
        return pair.estimate, pair.interval
    return of_effect(pair.effect)


def chosen(v: Array) -> tuple[float, Interval | None]:
    """Return the odds of one item among votes of people, five each."""
    person = np.repeat(np.arange(len(v)), v.shape[1])
    first = np.full(v.size, "u")
    frame = {"s": person, "a": first, "b": np.full(v.size, "v"), "y": v.ravel()}
    made = bradley_terry(frame, "y", first="a", second="b", subject="s")
    return of_effect(made.effects[0].effect)


def agreeing(v: Array) -> tuple[float, Interval | None]:
    """Return ICC2 of things rated in rows."""
    one = next(c for c in icc(v) if c.kind == "ICC2")
    return one.value, one.interval


def alike(what: str, v: Array) -> tuple[float, Interval | None]:
    """Return Cohen’s kappa, or Krippendorff’s alpha, of things in rows rated by columns."""
    coefficient, scale = what.split(" ")
    run: Any = cohen_kappa if coefficient == "κ" else krippendorff_alpha
    made = run(v, scale=scale)
    return made.value, made.interval


def equivalent(v: Array) -> tuple[float, Interval | None]:
    """Return the interval of an equivalence test, at α = .025 one of 95 %."""
    made = statistics.tost_paired(v[:, 0], v[:, 1], low=-1, high=1, alpha=0.025)
    return made.estimate, made.interval


def reliable(v: Array) -> tuple[float, Interval | None]:
    """Return Cronbach's alpha of items in columns."""
    names = [f"item {j}" for j in range(v.shape[1])]
    made = statistics.cronbach_alpha(dict(zip(names, v.T, strict=True)), names)
    return made.alpha, made.interval


def hit_share(v: Array) -> tuple[float, Interval | None]:
    """Return the share of ones in a column."""
    return of_effect(binomial_test(int((v > 0).sum()), v.size).effect)


PROMISES: Sequence[Promise] = (
    *(
        Promise(f"paired: {w}", partial(paired, w), truth_n=n)
        for w, n in (
            ("difference", TRUTH_N),
            ("dz", DIVIDED_N),
            ("η²p", DIVIDED_N),
            ("r_rb", TRUTH_N),
        )
    ),
    *(
        Promise(f"groups: {w}", partial(grouped, w), people=False, truth_n=n)
        for w, n in (
            ("Welch", TRUTH_N),
            ("Student", TRUTH_N),
            ("d", DIVIDED_N),
            ("r_rb", TRUTH_N),
        )
    ),
    *(
        Promise(
            f"one group: {w}",
            partial(alone, w),
            people=False,
            columns=1,
            effects=(-2.0, 0.0, 1.0, 2.0) if w == "d" else (0.0,),
            truth_n=DIVIDED_N if w == "d" else TRUTH_N,
        )
        for w in ("mean", "d")
    ),
    *(
        Promise(f"4 conditions: {w}", partial(within, w), columns=4, share=0.5)
        for w in ("difference", "dz", "η²p", "W")
    ),
    *(
        Promise(f"3 groups: {w}", partial(several_groups, w), columns=3, people=False, share=0.5)
        for w in ("difference", "d", "η²", "Welch η²p", "ε²", "dunn")
    ),
    *(
        Promise(f"ART 2 × 2: {w}", partial(aligned, w), columns=4, share=0.5, truth_n=4000)
        for w in ("r_rb", "η²p")
    ),
    Promise("pearson", partial(correlated, "pearson"), effects=(0.5,), truth_n=200_000),
    Promise("spearman", partial(correlated, "spearman"), effects=(0.5,), truth_n=200_000),
    Promise("ICC2, 4 raters", agreeing, columns=4, effects=(0.5, 2.0)),
    Promise("equivalence", equivalent),
    *(
        Promise(
            f"{what}, {columns} raters",
            partial(alike, what),
            (kind,),
            columns=columns,
            effects=(0.0,),
            truth_n=4000,
            share=share,
        )
        for what, columns, kind, share in (
            ("κ nominal", 2, "categories", 1.0),
            ("κ ordinal", 2, "ratings", 1.0),
            ("κ interval", 2, "ratings", 1.0),
            ("α nominal", 3, "categories", 0.5),
            ("α ordinal", 4, "ratings", 0.5),
            ("α interval", 4, "ratings", 0.5),
        )
    ),
    Promise("Cronbach's α, 4 items", reliable, columns=4, effects=(0.5,)),
    *(
        Promise(
            f"trials: {w}",
            partial(modelled, w),
            ("trials", "skewed trials"),
            share=SLOW,
            columns=8,
            truth_n=2000,
        )
        for w in ("lmm difference", "lmm d_total", "gee d_total")
    ),
    Promise(
        "choices: gee odds ratio",
        partial(modelled, "gee odds ratio"),
        ("choices",),
        share=SLOW,
        columns=8,
        truth_n=2000,
        sizes=(12, 16, 40),
        effects=(0.0, 0.5, 1.0),
    ),
    Promise(
        "ratings: clmm odds ratio",
        partial(modelled, "clmm"),
        ("single ratings",),
        share=0.1,
        columns=8,
        truth_n=800,
        sizes=(12, 24),
        effects=(0.0, 1.0),
    ),
    Promise(
        "votes: Bradley-Terry odds",
        chosen,
        ("votes",),
        share=SLOW,
        columns=5,
        truth_n=2000,
        sizes=(12, 16, 40),
        effects=(0.0, 0.5, 1.0),
    ),
    Promise("share, one choice each", hit_share, ("votes",), columns=1),
)


def held(promise: Promise, kind: str, effect: float, n: int, studies: int) -> tuple[float, int]:
    """Return the share of intervals that hold the truth, and how many intervals there were."""
    rng = np.random.default_rng(1)
    truth, _ = promise.measure(draw(kind, promise, effect, promise.truth_n, rng))
    slack = 4 / promise.truth_n  # of a truth of zero, which a share of variance finds above zero
    inside = made = 0
    for _ in range(studies):
        try:
            _, interval = promise.measure(draw(kind, promise, effect, n, rng))
        except statistics.StatisticsError:
            continue  # a report prints the reason instead
        if interval is not None:
            made += 1
            inside += interval.low - slack <= truth <= interval.high + slack
    return (inside / made if made else np.nan), made


def main() -> None:
    """Print one row per interval and kind of data."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=150)
    parser.add_argument("--only", default="")
    parser.add_argument("--all", action="store_true")
    options = parser.parse_args()
    print(f"{'interval':26} {'data':15} lowest   at            mean   ({options.studies} studies)")
    for promise in PROMISES:
        if options.only not in promise.name:
            continue
        studies = max(10, int(options.studies * promise.share))
        for kind in promise.kinds:
            rows = [
                (*held(promise, kind, effect, n, studies), n, effect)
                for n in promise.sizes
                for effect in promise.effects
            ]
            rows = [row for row in rows if row[1]]
            if not rows:
                print(f"{promise.name:26} {kind:15}    ·    no interval")
                continue
            share, made, n, effect = min(rows)
            chance = 2 * np.sqrt(PROMISE * (1 - PROMISE) / made)
            mark = " ✗" if share < PROMISE - chance else ""
            mean = float(np.mean([row[0] for row in rows]))
            where = f"n {n}, effect {effect:g}"
            print(
                f"{promise.name:26} {kind:15} {share:6.3f}   {where:16} {mean:.3f}{mark}",
                flush=True,
            )
            if options.all:
                for one, _, size, of in rows:
                    print(f"{'':42} {one:6.3f}   n {size}, effect {of:g}")


if __name__ == "__main__":
    main()
