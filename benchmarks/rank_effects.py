"""Print how often intervals of ε² and Kendall's W hold the truth.

    python -m benchmarks.rank_effects [--studies 1500]

The truth is the effect in very many simulated people of the same kind.
"""

import argparse
from collections.abc import Callable, Sequence

import numpy as np

from visavis.analysis import statistics
from visavis.analysis.statistics.results import Array, Effect

Draw = Callable[[np.random.Generator, int], Array]
"""Values (people, conditions), or of groups as columns."""
TRUTH_N = 20_000
GROUP, CONDITIONS = 12, 4


def rating(z: Array) -> Array:
    """Return ratings from 1 to 9 near their ceiling."""
    return np.clip(np.round(6 + 1.5 * z), 1, 9)


def apart(by: float) -> Draw:
    """Return a draw of normal values whose columns lie `by` standard deviations apart."""
    return lambda rng, n: rng.normal(size=(n, CONDITIONS)) + by * np.arange(CONDITIONS)


def of_people(draw: Draw) -> Draw:
    """Return a draw in which the values of a row share a person."""
    return lambda rng, n: draw(rng, n) + rng.normal(size=(n, 1))


KINDS: Sequence[tuple[str, Draw]] = (
    ("normal, no effect", apart(0.0)),
    ("normal, 0.2 SD apart", apart(0.2)),
    ("normal, 0.5 SD apart", apart(0.5)),
    ("normal, 1 SD apart", apart(1.0)),
    ("lognormal, 0.5 SD apart", lambda rng, n: np.exp(apart(0.5)(rng, n))),
    ("ratings, 0.5 SD apart", lambda rng, n: rating(apart(0.5)(rng, n))),
)


def epsilon(values: Array) -> Effect:
    """Return ε² of groups in columns."""
    group = np.tile(np.arange(values.shape[1]), values.shape[0])
    frame = {"g": group, "y": values.ravel()}
    return statistics.kruskal_wallis(frame, "y", factor="g").effect


def concordance(values: Array) -> Effect:
    """Return Kendall's W of people in rows."""
    person, condition = np.indices(values.shape)
    frame = {"s": person.ravel(), "c": condition.ravel(), "y": values.ravel()}
    return statistics.friedman(frame, "y", subject="s", within="c").effect


def coverage(of: Callable[[Array], Effect], draw: Draw, studies: int) -> tuple[float, float]:
    """Return the effect in very many people and how often its interval holds it."""
    rng = np.random.default_rng(1)
    truth = of(draw(rng, TRUTH_N)).value
    held = 0
    for _ in range(studies):
        found = of(draw(rng, GROUP)).interval
        held += found is not None and found.low <= truth <= found.high
    return truth, held / studies


def main() -> None:
    """Print one row per effect and kind of data."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=1500)
    options = parser.parse_args()
    print(f"{'data':26} {'effect':12} truth  held by its 95 % interval ({options.studies} studies)")
    for name, draw in KINDS:
        for effect, of, kind in (("ε²", epsilon, draw), ("Kendall's W", concordance, draw)):
            drawn = of_people(kind) if of is concordance else kind
            if name.startswith(("ratings", "lognormal")) and of is concordance:
                drawn = kind
            truth, held = coverage(of, drawn, options.studies)
            print(f"{name:26} {effect:12} {truth:5.2f}  {held:.3f}", flush=True)


if __name__ == "__main__":
    main()
