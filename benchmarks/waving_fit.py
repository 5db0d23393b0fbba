"""Fit the constants of the simulated judge of the waving study to the published values, anew.

    python -m benchmarks.waving_fit [--minutes 5] [--keep FILE | --seen FILE]
    python -m benchmarks.waving_fit --try reach_power=0 [--try acuity_sd=0.55 ...] [--seen FILE]

Run it when meshes, poses or the office changed and with them what can be seen of the 54 waves. It
renders that (three minutes on two cores; waves once rendered are kept; `--keep` writes it for
`tests/experiments/waving/test_participant_spread.py`, `--seen` reads it instead), starts from the
constants in use, and lets `FREE` of `visavis.experiments.waving.judgement.Population` evolve
(CMA-ES) over simulated studies of `PEOPLE` people, with the same random numbers for every
candidate, until all `TARGETS` hold with a margin: over other studies, over those of the test, and,
unless `--seen` was given, every row of `benchmarks.waving_participants`. Prints every target and
the constants, ready to paste; exits with 1 where `--minutes` were over before. Constants in use
that hold are left.

`--try` searches nothing: it prints the targets with the constants in use, and with one changed.
"""

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import special
from scipy.stats import f as f_distribution
from scipy.stats import rankdata, skew

from benchmarks.waving_participants import (
    MEAN_LIMIT,
    SD_LIMIT,
    SHARE_LIMITS,
    print_rows,
    study_rows,
)
from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.waving.clips import DIRECTIONS, PLACES, TECHNIQUES
from visavis.experiments.waving.judgement import (
    DEFAULT_POPULATION,
    Population,
    lapse_share,
    noise_deg,
)
from visavis.experiments.waving.quick_study import STIMULI, evidence_for
from visavis.experiments.waving.study import COMPARISON, MEAN_ACCURACY, study
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector
from visavis.results.power import KitPower
from visavis.results.printed_orders import MIN_HOLDS_01, printed_orders_of
from visavis.running.quick import quick_study
from visavis.running.sessions.runners import on_this_machine
from visavis.stimuli.scenes.office import neighbour
from visavis.study.expectations import orders_of
from visavis.study.experiment import StudyExperiment

FIT_SEED, FRESH_SEED, CHECK_SEED = 20_230_000, 30_000_000, 50_000
"""Of studies searched over, of those a find is held against, and of those of the test."""
PEOPLE, STUDIES, CHECK_STUDIES, FRESH_STUDIES = 16, 300, 200, 600
ORDERS = {
    order.name: order
    for order in printed_orders_of(StudyExperiment(study))
    if order.measure == "is_right" and not order.not_reproduced
}
"""The orders of accuracy that the source states and simulated studies must show, by name."""
TERMS = ("technique", "direction", "technique:direction")
PRINTED = KitPower("waving", tracker_of, quick_study).printed_tests["is_right:technique"]
PRINTED_DZ = PRINTED.dz
"""Mean over SD of people's differences between techniques, as the printed F implies."""
CANDIDATES, STEP = 12, 0.15
"""Of a generation, and their first spread about its middle (of logarithms)."""
FREE = (
    *(f"blur_deg.{i}" for i in range(4)),
    *(f"looseness_deg.{i}" for i in range(4)),
    "sharpness",
    "reach_power",
    "least_reach_01",
    "self_bias",
    "acuity_sd",
    "lapse_01",
    "lapse_sd",
)
"""What is searched, on a logarithmic scale."""
MOST = np.log([0.95 if name.endswith("_01") else np.inf for name in FREE])


@dataclass(frozen=True)
class Target:
    """What a value of `Expected.values` may be; a fit keeps `margin` from the limits."""

    name: str
    least: float
    most: float
    margin: float

    def miss(self, value: float) -> float:
        """Return how near a value is: 0 from a margin within the limits on, 1 on a limit."""
        return max(0.0, self.least - value + self.margin, value - self.most + self.margin) / (
            self.margin
        )


def _about(name: str, wanted: float, within: float, margin: float) -> Target:
    return Target(name, wanted - within, wanted + within, margin)


TARGETS = (
    *(_about(f"accuracy {t}", MEAN_ACCURACY[t][0], MEAN_LIMIT / 2, 0.02) for t in TECHNIQUES),
    *(_about(f"SD {t}", MEAN_ACCURACY[t][1], SD_LIMIT, 0.02) for t in TECHNIQUES),
    *(_about(f"SD over cells {t}", MEAN_ACCURACY[t][1], SD_LIMIT, 0.01) for t in TECHNIQUES),
    _about("power of technique", PRINTED.power(PEOPLE, COMPARISON.alpha), 0.08, 0.05),
    Target("power of direction", SHARE_LIMITS["is_right", "direction"][1], math.inf, 0.05),
    Target(
        "power of technique:direction",
        -math.inf,
        SHARE_LIMITS["is_right", "technique:direction"][1],
        0.03,
    ),
    _about("difference of techniques, mean over SD", PRINTED_DZ, 0.1, 0.04),
    _about("difference of techniques, skewness", 0.0, 0.5, 0.1),
    _about("people with whom it is reversed", float(special.ndtr(-PRINTED_DZ)), 0.06, 0.01),
    *(Target(name, MIN_HOLDS_01, math.inf, 0.03) for name in ORDERS),
)
"""What the published values ask for: limits of the benchmark and of the test."""


@dataclass(frozen=True, eq=False)
class Waves:
    """What can be seen of the waves (s, ...) and the right answers, and random numbers for the
    people of all studies: acuity, lapses and leaning (p, 3), readings (p, s, 4), whether a wave is
    attended to (p, s), and the place guessed where it is not (p, s).
    """

    pixels: Vector
    pointing_deg: Vector
    bearing_deg: Vector
    reach_01: Vector
    own: Vector
    target: Vector
    cell: Vector
    people: Vector
    readings: Vector
    attention: Vector
    guesses: npt.NDArray[np.int64]


def seen_of_waves(processes: int = 2) -> dict[str, Vector]:
    """Return what can be seen of every wave (54, ...): rendered, or read where that was done."""
    by_wave: dict[tuple[str, ...], list[int]] = {}
    for number, (technique, direction, clerk, place) in enumerate(STIMULI):
        wave = (technique, clerk, neighbour(place, direction).name)
        by_wave.setdefault(wave, []).append(number)
    jobs = sorted(by_wave.values(), key=lambda job: job[0], reverse=True)  # warped ones first
    for _ in on_this_machine(_render, jobs, processes):
        pass
    seen = [evidence_for(s) for s in STIMULI]
    names = ("pixels", "pointing_deg", "bearing_deg", "reach_01")
    return {name: np.array([getattr(e, name) for e in seen]) for name in names}


def _render(numbers: Sequence[int]) -> None:
    for number in numbers:
        evidence_for(STIMULI[number])


def waves_of(seen: Mapping[str, Vector], studies: int = STUDIES, seed: int = FIT_SEED) -> Waves:
    """Return what `seen_of_waves` returned (or a file of `--seen` holds) and random numbers for
    studies of 16 people.
    """
    rng = np.random.default_rng(seed)
    n, waves = studies * PEOPLE, len(STIMULI)
    return Waves(
        pixels=seen["pixels"],
        pointing_deg=seen["pointing_deg"],
        bearing_deg=seen["bearing_deg"],
        reach_01=seen["reach_01"],
        own=np.array([PLACES.index(s[3]) for s in STIMULI]),
        target=np.array([PLACES.index(neighbour(s[3], s[1]).name) for s in STIMULI]),
        cell=np.array([TECHNIQUES.index(s[0]) * 3 + DIRECTIONS.index(s[1]) for s in STIMULI]),
        people=rng.standard_normal((n, 3)),
        readings=rng.standard_normal((n, waves, 4)),
        attention=rng.random((n, waves)),
        guesses=rng.integers(len(PLACES), size=(n, waves)),
    )


def population_of(x: Vector) -> Population:
    """Return the population of a point of the search (logarithms of `FREE`)."""
    given = (float(f"{value:.12g}") for value in np.exp(np.minimum(x, MOST)))
    values = dict(zip(FREE, given, strict=True))
    four = {
        name: tuple(values.pop(f"{name}.{i}") for i in range(4))
        for name in ("blur_deg", "looseness_deg")
    }
    return replace(DEFAULT_POPULATION, **four, **values)  # type: ignore[arg-type]  # named floats


def point_of(population: Population) -> Vector:
    """Return the point of the search at a population."""
    rows = []
    for name in FREE:
        field, _, index = name.partition(".")
        value = getattr(population, field)
        rows.append(value[int(index)] if index else value)
    point: Vector = np.log(np.array(rows))
    return point


def understood(waves: Waves, population: Population) -> Vector:
    """Return whether each person understands each wave (p, s), as `judge` decides it.

    What `worth_of` sums over cues is multiplied out, and left out where every place has it.
    """
    q, places = population, waves.bearing_deg
    blur = np.exp(q.acuity_sd * waves.people[:, 0])[:, None]
    noise = noise_deg(waves.pixels, 1.0, q)
    read = (waves.pointing_deg / noise**2).sum(axis=-1)
    read = read + blur * np.einsum("psc,sc->ps", waves.readings, 1 / noise)
    fit = read[..., None] * places - 0.5 * places**2 * (noise**-2).sum(axis=-1)[:, None]
    worth = fit / blur[..., None] ** 2
    worth += q.reach_power * np.log(np.maximum(waves.reach_01, q.least_reach_01))
    bias = q.self_bias + q.self_bias_sd * waves.people[:, 2]
    worth += bias[:, None, None] * np.eye(len(PLACES))[waves.own]
    lapses = waves.attention < np.asarray(lapse_share(q, waves.people[:, 1]))[:, None]
    right: Vector = np.where(lapses, waves.guesses, worth.argmax(axis=-1)) == waves.target
    return right


def art_p(shares: Vector) -> Vector:
    """Return p (3, k) of technique, direction and interaction, by ART, of k studies (k, n, 2, 3).

    What `visavis.analysis.statistics.art_anova` without a correction says of each, for all at once.
    """
    n = shares.shape[1]
    mean = shares.mean(axis=1, keepdims=True)
    whole, a, b = (mean.mean(axis=axes, keepdims=True) for axes in ((2, 3), 3, 2))
    level, own_a, own_b = np.ones((1, 1)), np.array([[-1, 1]]), np.array([[-1, 1, 0], [-1, -1, 2]])
    p = []
    for effect, of_a, of_b in (
        (a - whole, own_a, np.repeat(level, 3, 1)),
        (b - whole, np.repeat(level, 2, 1), own_b),
        (mean - a - b + whole, own_a, own_b),
    ):
        aligned = (shares - mean + effect).round(8)
        ranks = rankdata(aligned.reshape(len(shares), -1), axis=1).reshape(shares.shape)
        of_a, of_b = (c / np.linalg.norm(c, axis=1, keepdims=True) for c in (of_a, of_b))
        scores = np.einsum("knab,ia,jb->knij", ranks, of_a, of_b).reshape(len(shares), n, -1)
        q, middle = scores.shape[2], scores.mean(axis=1)
        error = ((scores - middle[:, None]) ** 2).sum(axis=(1, 2)) / (q * (n - 1))
        p.append(f_distribution.sf(n * (middle**2).sum(axis=1) / q / error, q, q * (n - 1)))
    return np.array(p)


@dataclass(frozen=True)
class Expected:
    """What studies of 16 people come to on average: accuracy (2, 3), SDs between people over a
    technique's mean and over its cells (2,), shares of studies in which technique, direction and
    interaction are significant, and what warping does to people: mean over SD of the differences
    between techniques, their skewness, and the share of people with whom they are reversed; and in
    which share of studies each printed order of accuracy holds.
    """

    accuracy: Vector
    sd_people: Vector
    sd_cells: Vector
    power: tuple[float, float, float]
    gain_dz: float
    gain_skew: float
    reversed_01: float
    orders: dict[str, float]

    @property
    def values(self) -> dict[str, float]:
        """By the names of `TARGETS`."""
        return {
            **{f"accuracy {t}": float(self.accuracy[i].mean()) for i, t in enumerate(TECHNIQUES)},
            **{f"SD {t}": float(self.sd_people[i]) for i, t in enumerate(TECHNIQUES)},
            **{f"SD over cells {t}": float(self.sd_cells[i]) for i, t in enumerate(TECHNIQUES)},
            **{f"power of {term}": p for term, p in zip(TERMS, self.power, strict=True)},
            "difference of techniques, mean over SD": self.gain_dz,
            "difference of techniques, skewness": self.gain_skew,
            "people with whom it is reversed": self.reversed_01,
            **self.orders,
        }

    @property
    def misses(self) -> Vector:
        """What `Target.miss` says of each of `TARGETS`."""
        values = self.values
        return np.array([target.miss(values[target.name]) for target in TARGETS])


def expected(waves: Waves, population: Population) -> Expected:
    """Return what studies with a population come to: simulated and tested, 16 people each."""
    right = understood(waves, population)
    cells = np.stack([right[:, waves.cell == c].mean(axis=1) for c in range(6)], axis=1)
    shares = cells.reshape(-1, PEOPLE, 2, 3)
    means = shares.mean(axis=3)
    gain = means[:, :, 1] - means[:, :, 0]
    technique, direction, interaction = (art_p(shares) < COMPARISON.alpha).mean(axis=1).tolist()
    by_cell = shares.transpose(0, 2, 1, 3).reshape(len(shares), 2, -1)
    return Expected(
        shares.mean(axis=(0, 1)),
        np.sqrt(means.var(axis=1, ddof=1).mean(axis=0)),
        np.sqrt(by_cell.var(axis=2, ddof=1).mean(axis=0)),
        (technique, direction, interaction),
        float(gain.mean() / np.sqrt(gain.var(axis=1, ddof=1).mean())),
        float(skew(gain.ravel())),
        float((gain < 0).mean() + (gain == 0).mean() / 2),
        shares_of_orders(shares),
    )


def shares_of_orders(shares: Vector) -> dict[str, float]:
    """Return in which share of studies (k, n, 2, 3) each printed order of accuracy holds."""
    found = {}
    for name, order in ORDERS.items():
        means = shares.mean(axis=1)
        if "direction" in order.only:
            means = means[:, :, [DIRECTIONS.index(str(order.only["direction"]))]]
        levels, axis = (TECHNIQUES, 2) if order.factor == "technique" else (DIRECTIONS, 1)
        of_level = dict(zip(levels, means.mean(axis=axis).T, strict=True))
        pairs = orders_of(order.order, name)[0].pairs
        holds = [of_level[greater] > of_level[less] for greater, less in pairs]
        found[name] = float(np.all(holds, axis=0).mean())
    return found


def evolved(
    loss: Callable[[Vector], float], start: Vector, rng: np.random.Generator
) -> Iterator[Vector]:
    """Yield the middle of every generation from a start (n,): CMA-ES as Hansen's tutorial has it
    (arXiv 1604.00772), with its usual constants.
    """
    n, parents = len(start), CANDIDATES // 2
    weights = np.log(parents + 0.5) - np.log(np.arange(parents) + 1)
    weights /= weights.sum()
    mass = 1 / (weights**2).sum()
    of_length, of_path = (mass + 2) / (n + mass + 5), (4 + mass / n) / (n + 4 + 2 * mass / n)
    of_one = 2 / ((n + 1.3) ** 2 + mass)
    of_all = min(1 - of_one, 2 * (mass - 2 + 1 / mass) / ((n + 2) ** 2 + mass))
    usual = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))
    middle, spread, covariance = start, STEP, np.eye(n)
    length_path, path = np.zeros(n), np.zeros(n)
    with ThreadPoolExecutor(2) as threads:
        for generation in count(1):
            variances, axes = np.linalg.eigh(covariance)
            steps = rng.standard_normal((CANDIDATES, n)) * np.sqrt(variances) @ axes.T
            losses = list(threads.map(loss, middle + spread * steps))
            best = steps[np.argsort(losses)[:parents]]
            step = weights @ best
            middle = middle + spread * step
            yield middle
            round_step = axes @ (axes.T @ step / np.sqrt(variances))
            length_path = (1 - of_length) * length_path
            length_path += np.sqrt(of_length * (2 - of_length) * mass) * round_step
            length = np.linalg.norm(length_path) / usual
            is_settled = length < (1.4 + 2 / (n + 1)) * np.sqrt(
                1 - (1 - of_length) ** (2 * generation)
            )
            path = (1 - of_path) * path
            path += is_settled * np.sqrt(of_path * (2 - of_path) * mass) * step
            covariance = (1 - of_one - of_all) * covariance + of_one * np.outer(path, path)
            covariance += of_all * (best.T * weights) @ best
            spread *= float(np.exp(of_length / (1 + of_length) * (length - 1)))


def rounded(x: Vector) -> Vector:
    """Return the point at which constants have three digits."""
    point: Vector = np.log([float(f"{value:.3g}") for value in np.exp(np.minimum(x, MOST))])
    return point


def fitted(
    seen: Mapping[str, Vector],
    start: Vector,
    minutes: float,
    also_holds: Callable[[Population], bool] = lambda population: True,
) -> tuple[Vector, bool]:
    """Return the first point from a start on at which everything holds, and whether any did
    within some minutes; otherwise the last one tried.
    """
    clock = SystemClock()
    until_ns = clock.now_ns() + int(minutes * 60 * NS_PER_S)
    best = start
    for turn in count():
        if _holds(seen, population_of(best), turn) and also_holds(population_of(best)):
            return best, True
        # Other studies every time, and more of them: what held by luck must hold again.
        waves = waves_of(seen, min(STUDIES * (turn + 1), FRESH_STUDIES), FIT_SEED + turn)
        pulled_to = best

        def misses(x: Vector, waves: Waves = waves) -> Vector:
            return expected(waves, population_of(x)).misses

        def loss(x: Vector, pulled_to: Vector = pulled_to) -> float:
            far = float(((x - pulled_to) ** 2).sum())
            return float((misses(x) ** 2).sum()) + 0.1 * far

        for middle in evolved(loss, best, np.random.default_rng(FIT_SEED + turn)):
            best = rounded(middle)
            missed = misses(best)
            if clock.now_ns() > until_ns:
                return best, False
            if (missed <= 0.5).all():
                break
    raise AssertionError


def _holds(seen: Mapping[str, Vector], population: Population, turn: int) -> bool:
    """Return whether targets hold over studies not searched over and over those of the test."""
    fresh = waves_of(seen, FRESH_STUDIES, FRESH_SEED + turn)
    tested = waves_of(seen, CHECK_STUDIES, CHECK_SEED)
    return all((expected(w, population).misses <= 1).all() for w in (fresh, tested))


def varied(text: str) -> Population:
    """Return the constants in use with one of them changed, as "reach_power=0"."""
    name, _, number = text.partition("=")
    if not isinstance(getattr(DEFAULT_POPULATION, name, None), float):
        raise UsageError(f"{text!r} changes no number of the population; write reach_power=0")
    try:
        value = float(number)
    except ValueError:
        raise UsageError(f"{text!r} gives no number; write {name}=0.5") from None
    return replace(DEFAULT_POPULATION, **{name: value})  # type: ignore[arg-type]  # a number


def _print_targets(seen: Mapping[str, Vector], populations: Mapping[str, Population]) -> None:
    waves = waves_of(seen, FRESH_STUDIES, FRESH_SEED - 1)
    found = {name: expected(waves, population).values for name, population in populations.items()}
    print(f"{f'{FRESH_STUDIES} studies':<42}{'least':>8}{'most':>8}", end="")
    print("".join(f"{name:>18}" for name in found))
    for t in TARGETS:
        print(f"{t.name:<42}{t.least:>8.3f}{t.most:>8.3f}", end="")
        for values in found.values():
            value = values[t.name]
            print(f"{value:>10.3f} {'holds' if t.miss(value) <= 1 else 'MISSES':<7}", end="")
        print()


def source_lines(population: Population) -> list[str]:
    """Return the constants searched as `visavis.experiments.waving.judgement` writes them."""
    names = dict.fromkeys(name.partition(".")[0] for name in FREE)
    notes = Population.__annotations__
    of_four = "tuple[float, float, float, float]"
    return [
        f"    {name}: {of_four if 'tuple' in str(notes[name]) else 'float'} = "
        f"{getattr(population, name)}"
        for name in names
    ]


def main(arguments: Sequence[str]) -> int:
    """Fit and print, or compare what was asked for; exit with 1 where nothing holds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=5.0, help="of searching, at most")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="write what is seen of the waves")
    parser.add_argument("--seen", type=Path, metavar="FILE", help="read what --keep wrote")
    parser.add_argument("--try", dest="tried", action="append", default=[], metavar="NAME=VALUE")
    given = parser.parse_args(arguments)
    seen = dict(np.load(given.seen)) if given.seen else seen_of_waves()
    if given.keep:
        np.savez_compressed(given.keep, allow_pickle=False, **seen)
    if given.tried:
        tried = {text: varied(text) for text in given.tried}
        _print_targets(seen, {"in use": DEFAULT_POPULATION, **tried})
        return 0

    def benchmark_holds(population: Population) -> bool:
        rows = study_rows(range(100), PEOPLE, population)
        print_rows(rows)
        print()
        return all(row.get("holds", True) for row in rows)

    start = point_of(DEFAULT_POPULATION)
    also = () if given.seen else (benchmark_holds,)
    x, holds = fitted(seen, start, given.minutes, *also)
    found = population_of(x)
    _print_targets(seen, {"in use": DEFAULT_POPULATION, "found": found})
    if not holds:
        print("\nnothing that holds was found in time; the last tried:")
    elif x is start:
        print("\nthe constants in use hold:")
    print("\n" + "\n".join(source_lines(found)))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
