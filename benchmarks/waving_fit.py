"""Fit the constants of the simulated judge of the waving study to the published values.

    python -m benchmarks.waving_fit [--starts 3] [--rounds 60] [--check 40] [--seen FILE] [--json]
    python -m benchmarks.waving_fit --try reach_power=0 [--try acuity_sd=0.55 ...] [--check 40]

Searches `FREE` of `experiments.waving.judgement.Population` by differential evolution, each start
from another seed, over simulated studies: what can be seen of the 54 waves is rendered, then
`PEOPLE` people in each of `STUDIES` studies read every wave, with the same random numbers for
every candidate, and every study is tested as the report tests it. The loss sums what `loss_terms`
names. Prints the constants of the best start, their spread between starts, what they give, and the
loss of the constants in use; `--starts 0` does the last alone, `--seen` keeps what was rendered.
`--check` runs the best and those in use through the real analysis, over studies of seeds from
`CHECK_SEED` on. `--try` searches nothing: it runs the constants in use, and these with one number
changed.

How the constants in use came about: docs/waving.md tells it.

`--starts 1 --rounds 3 --check 0` is a short run. The search starts from the constants in use: run
again it says whether better ones are near.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import f as f_distribution
from scipy.stats import rankdata, skew

from benchmarks.waving_quick import quick_analysis, quick_study
from cli.quick_tracker import tracker_of
from experiments.waving.clips import TECHNIQUES
from experiments.waving.judgement import (
    DEFAULT_POPULATION,
    Population,
    lapse_share,
    noise_deg,
    worth_of,
)
from experiments.waving.quick_study import STIMULI, evidence_for
from experiments.waving.study import COMPARED, DIRECTIONS, MEAN_ACCURACY, PLACES
from lab.errors import UsageError
from lab.geometry import Vector
from stimuli.scenes.office import neighbour
from visavis.power import KitPower

FIT_SEED, CHECK_SEED = 20_230_000, 50_000
PEOPLE, STUDIES = 16, 240
TERMS = ("technique", "direction", "technique:direction")
PRINTED = KitPower("waving", tracker_of).printed["is_right:technique"]
PRINTED_DZ = PRINTED.dz
"""Mean over SD of people's differences between techniques, as the printed F implies."""
SD_WITHIN = 0.02
"""Means are wanted within about this, SDs between people within one and a half times it."""
SPAN = 3.0
"""How many times smaller or larger than at the start a constant may become."""
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


def seen_of_waves() -> dict[str, Vector]:
    """Return what can be seen of every wave (54, ...): rendered, or read where that was done."""
    seen = [evidence_for(s) for s in STIMULI]
    names = ("pixels", "pointing_deg", "bearing_deg", "reach_01")
    return {name: np.array([getattr(e, name) for e in seen]) for name in names}


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
    values = dict(zip(FREE, map(float, np.exp(x)), strict=True))
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
    """Return whether each person understands each wave (p, s), as `judge` decides it."""
    q = population
    blur = np.exp(q.acuity_sd * waves.people[:, 0])
    noise = noise_deg(waves.pixels[None], blur[:, None, None], q)
    read = waves.pointing_deg + noise * waves.readings
    worth = worth_of(read, noise, waves.bearing_deg[None], waves.reach_01[None], q)
    bias = q.self_bias + q.self_bias_sd * waves.people[:, 2]
    worth = worth + bias[:, None, None] * np.eye(len(PLACES))[waves.own]
    lapses = waves.attention < np.asarray(lapse_share(q, waves.people[:, 1]))[:, None]
    right: Vector = np.where(lapses, waves.guesses, worth.argmax(axis=-1)) == waves.target
    return right


def art_p(shares: Vector) -> Vector:
    """Return p (3, k) of technique, direction and interaction, by ART, of k studies (k, n, 2, 3).

    What `analysis.statistics.art_anova` without a correction says of each, for all at once.
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
    between techniques, their skewness, and the share of people with whom they are reversed.
    """

    accuracy: Vector
    sd_people: Vector
    sd_cells: Vector
    power: tuple[float, float, float]
    gain_dz: float
    gain_skew: float
    reversed_01: float


def expected(waves: Waves, population: Population) -> Expected:
    """Return what studies with a population come to: simulated and tested, 16 people each."""
    right = understood(waves, population)
    cells = np.stack([right[:, waves.cell == c].mean(axis=1) for c in range(6)], axis=1)
    shares = cells.reshape(-1, PEOPLE, 2, 3)
    means = shares.mean(axis=3)
    gain = means[:, :, 1] - means[:, :, 0]
    technique, direction, interaction = (art_p(shares) < COMPARED.alpha).mean(axis=1).tolist()
    by_cell = shares.transpose(0, 2, 1, 3).reshape(len(shares), 2, -1)
    return Expected(
        shares.mean(axis=(0, 1)),
        np.sqrt(means.var(axis=1, ddof=1).mean(axis=0)),
        np.sqrt(by_cell.var(axis=2, ddof=1).mean(axis=0)),
        (technique, direction, interaction),
        float(gain.mean() / np.sqrt(gain.var(axis=1, ddof=1).mean())),
        float(skew(gain.ravel())),
        float((gain < 0).mean() + (gain == 0).mean() / 2),
    )


def loss_terms(found: Expected, x: Vector, start: Vector) -> dict[str, float]:
    """Return the parts of the loss; each is about 1 where a wish is missed by its tolerance."""
    means = found.accuracy.mean(axis=1)
    wanted = np.array([MEAN_ACCURACY[t] for t in TECHNIQUES])
    power = found.power
    oneself, left, right = found.accuracy.mean(axis=0)
    return {
        "means": float((((means - wanted[:, 0]) / SD_WITHIN) ** 2).sum()),
        "SD between people": float(
            (((found.sd_people - wanted[:, 1]) / (1.5 * SD_WITHIN)) ** 2).sum()
        ),
        "difference of techniques": ((found.gain_dz - PRINTED_DZ) / 0.05) ** 2,
        "power of technique": ((power[0] - PRINTED.power(PEOPLE, COMPARED.alpha)) / 0.05) ** 2,
        "skewed differences": (max(0.0, abs(found.gain_skew) - 0.3) / 0.1) ** 2,
        "power of direction": (max(0.0, 0.98 - power[1]) / 0.02) ** 2,
        "interaction beyond chance": (max(0.0, power[2] - 0.07) / 0.02) ** 2,
        "right is lowest": (max(0.0, float(right - min(oneself, left)) + 0.05) / 0.02) ** 2,
        "oneself like left": (max(0.0, abs(float(oneself - left)) - 0.05) / 0.05) ** 2,
        "distance from the start": 0.1 * float(((x - start) ** 2).sum()),
    }


def loss_of(x: Vector, waves: Waves, start: Vector) -> float:
    """Return the loss at a point of the search."""
    return sum(loss_terms(expected(waves, population_of(x)), x, start).values())


def fitted(waves: Waves, start: Vector, seed: int, rounds: int, size: int = 3) -> Vector:
    """Search from one seed and return the best point."""
    # Shares end below 1.
    most = np.log([0.95 if name.endswith("_01") else np.inf for name in FREE])
    bounds = Bounds(start - np.log(SPAN), np.minimum(start + np.log(SPAN), most))
    found = differential_evolution(
        loss_of,
        bounds,
        args=(waves, start),
        maxiter=rounds,
        popsize=size,
        tol=1e-6,
        x0=start,
        rng=np.random.default_rng(seed),
        polish=False,
    )
    best: Vector = found.x
    return best


def checked(population: Population, studies: int, people: int = 16) -> dict[str, float]:
    """Return means, SDs and shares of significant effects over simulated studies."""
    values: dict[str, list[float]] = {}
    for seed in range(CHECK_SEED, CHECK_SEED + studies):
        analysis = quick_analysis(quick_study(people, seed, population=population))
        table = analysis.cell_means()
        for technique in TECHNIQUES:
            chosen = table[table["technique"] == technique]
            each = chosen.groupby("participant")["is_right"].mean()
            values.setdefault(f"accuracy {technique}", []).append(float(each.mean()))
            values.setdefault(f"SD {technique}", []).append(float(each.std(ddof=1)))
        for term in analysis.findings[0].terms:
            values.setdefault(f"{term.name} significant", []).append(float(term.is_significant))
    return {name: float(np.mean(v)) for name, v in values.items()}


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


def _print_variants(tried: Sequence[str], studies: int, *, as_json: bool) -> int:
    variants = {"in use": DEFAULT_POPULATION, **{text: varied(text) for text in tried}}
    outcomes = {name: checked(population, studies) for name, population in variants.items()}
    if as_json:
        print(json.dumps(outcomes, indent=1))
        return 0
    print(f"{f'{studies} studies':<40}" + "".join(f"{name:>18}" for name in outcomes))
    for key in outcomes["in use"]:
        print(f"{key:<40}" + "".join(f"{found[key]:>18.3f}" for found in outcomes.values()))
    return 0


def main(arguments: Sequence[str]) -> int:
    """Fit, print, and check what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=3)
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--check", type=int, default=40)
    parser.add_argument("--seen", type=Path, metavar="FILE", help="keep what is seen of the waves")
    parser.add_argument("--try", dest="tried", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    if given.tried:
        return _print_variants(given.tried, given.check, as_json=given.json)
    seen, start = seen_of_waves(), point_of(DEFAULT_POPULATION)
    if given.seen:
        np.savez_compressed(given.seen, allow_pickle=False, **seen)
    waves = waves_of(seen)
    points = [fitted(waves, start, FIT_SEED + 1 + k, given.rounds) for k in range(given.starts)]
    points.sort(key=lambda x: loss_of(x, waves, start))
    logs = np.array(points or [start])
    rows: list[dict[str, object]] = [
        {
            "constant": name,
            "fitted": float(np.exp(logs[0, i])),
            "lowest": float(np.exp(logs[:, i].min())),
            "highest": float(np.exp(logs[:, i].max())),
            "in_use": float(np.exp(start[i])),
        }
        for i, name in enumerate(FREE)
    ]
    outcomes: dict[str, dict[str, float]] = {}
    for name, x in (*(("fitted", x) for x in points[:1]), ("in use", start)):
        found = expected(waves, population_of(x))
        terms = loss_terms(found, x, start)
        outcomes[name] = {
            "loss": sum(terms.values()),
            **{f"loss of {term}": value for term, value in terms.items()},
            **{f"accuracy {t}": float(found.accuracy[i].mean()) for i, t in enumerate(TECHNIQUES)},
            **{f"SD {t}": float(found.sd_people[i]) for i, t in enumerate(TECHNIQUES)},
            **{f"SD over cells {t}": float(found.sd_cells[i]) for i, t in enumerate(TECHNIQUES)},
            **{f"power of {term}": p for term, p in zip(TERMS, found.power, strict=True)},
            "difference of techniques, mean over SD": found.gain_dz,
            "difference of techniques, skewness": found.gain_skew,
            "people with whom it is reversed": found.reversed_01,
        }
        if given.check:
            over = checked(population_of(x), given.check)
            outcomes[name] |= {f"{given.check} studies: {k}": v for k, v in over.items()}
    if given.json:
        print(json.dumps({"constants": rows, "outcomes": outcomes}, indent=1))
        return 0
    shown = ("fitted", "lowest", "highest", "in_use") if points else ("in_use",)
    print(f"{'constant':<20}" + "".join(f"{name.replace('_', ' '):>9}" for name in shown))
    for row in rows:
        print(f"{row['constant']!s:<20}" + "".join(f"{row[name]:>9.3g}" for name in shown))
    print(f"\n{'expected':<46}" + "".join(f"{name:>9}" for name in outcomes))
    for name in outcomes["in use"]:
        print(f"{name:<46}" + "".join(f"{found[name]:>9.3f}" for found in outcomes.values()))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
