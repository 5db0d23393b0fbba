"""Find planted psychometric functions again, and compare the fit with another implementation.

python -m benchmarks.psychometric [--people 200] [--trials 60] [--oracle PYTHON]

Simulated people answer at constant levels, along a staircase (two down, one up) and along QUEST+;
printed are the bias of threshold and slope (of their logarithms' means) and how often the 95 %
intervals hold what was planted. `--oracle` is a Python in which the package psignifit (GPL, never a
part of Visavis) is installed, in an environment of its own; it gets the same answers at constant
levels, and how far both lie apart is printed as a share of the interval's width.
"""

import argparse
import json
import subprocess
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.psychometric import (
    NoFitError,
    PsychometricFit,
    fit_psychometric,
    share_right,
)
from visavis.study.quest_plus import QuestPlus
from visavis.study.staircase import Staircase, StaircaseState, after

THRESHOLD, SLOPE, LAPSE, GUESS = 0.05, 3.0, 0.02, 0.5
CONSTANT: Final = np.geomspace(0.02, 0.1, 6)
STAIRCASE: Final = Staircase("c", start=0.3, step=0.4, is_ratio=True, low=0.002)
QUEST: Final = QuestPlus(
    "c",
    levels=np.geomspace(0.002, 0.6, 41).tolist(),
    thresholds=np.geomspace(0.004, 0.4, 41).tolist(),
    slopes=(1.5, 2.0, 3.0, 4.0, 6.0),
    lapses=(0.0, 0.02, 0.04),
)
Answers = tuple[list[float], list[bool]]
ORACLE: Final = """
import json, sys, warnings
warnings.simplefilter("ignore")
import numpy as np, psignifit
rows = []
for levels, right in json.load(sys.stdin):
    at, place = np.unique(levels, return_inverse=True)
    total = np.bincount(place)
    data = np.stack([at, np.bincount(place, weights=right), total], axis=1)
    fit = psignifit.psignifit(data, sigmoid="weibull", experiment_type="2AFC", verbose=False)
    rows.append(float(fit.threshold(1 - np.exp(-1), unscaled=True, return_ci=False)))
json.dump(rows, sys.stdout)
"""


def is_right(level: float, rng: np.random.Generator) -> bool:
    """Return whether a simulated person's answer at a level is right."""
    return bool(rng.random() < share_right(level, THRESHOLD, SLOPE, GUESS, LAPSE))


def constant(trials: int, rng: np.random.Generator) -> Answers:
    """Return answers at constant levels, equally many at each."""
    levels = np.resize(CONSTANT, trials).tolist()
    return levels, [is_right(level, rng) for level in levels]


def staircase(trials: int, rng: np.random.Generator) -> Answers:
    """Return answers along a staircase."""
    state, levels, right = StaircaseState(STAIRCASE.start), [], []
    for _ in range(trials):
        levels.append(state.level)
        right.append(is_right(state.level, rng))
        state = after(STAIRCASE, state, right[-1])
    return levels, right


def quest_plus(trials: int, rng: np.random.Generator) -> Answers:
    """Return answers along QUEST+."""
    posterior, levels, right = QUEST.first, [], []
    for _ in range(trials):
        levels.append(posterior.next_level)
        right.append(is_right(levels[-1], rng))
        posterior = posterior.after(levels[-1], right[-1])
    return levels, right


WAYS: Final[dict[str, Callable[[int, np.random.Generator], Answers]]] = {
    "constant levels": constant,
    "staircase": staircase,
    "QUEST+": quest_plus,
}


def print_way(name: str, people: int, trials: int) -> None:
    """Print bias and coverage of one way to choose levels."""
    fits: list[PsychometricFit] = []
    for seed in range(people):
        try:
            fits.append(fit_psychometric(*WAYS[name](trials, np.random.default_rng(seed))))
        except NoFitError:
            continue
    words = []
    for what, planted in (("threshold", THRESHOLD), ("slope", SLOPE)):
        values: npt.NDArray[np.float64] = np.array([getattr(fit, what) for fit in fits])
        bias = float(np.exp(np.log(values).mean()) / planted - 1)
        inside = [
            getattr(fit, f"{what}_low") <= planted <= getattr(fit, f"{what}_high") for fit in fits
        ]
        words.append(f"{what} off by {bias:+.1%}, in {np.mean(inside):.1%} of intervals")
    print(f"{name}, {len(fits)} of {people} people of {trials} trials: {'; '.join(words)}")


def print_oracle(oracle: str, people: int, trials: int) -> None:
    """Print how far the thresholds of another implementation lie from ours."""
    answers = [constant(trials, np.random.default_rng(seed)) for seed in range(people)]
    result = subprocess.run(  # the Python that the caller named
        [oracle, "-c", ORACLE],
        input=json.dumps(answers),
        capture_output=True,
        text=True,
        check=True,
    )
    apart = []
    for own, threshold in zip(answers, json.loads(result.stdout), strict=True):
        fit = fit_psychometric(*own)
        width = np.log(fit.threshold_high / fit.threshold_low)
        apart.append(abs(np.log(threshold / fit.threshold)) / width)
    print(
        f"{people} people of {trials} trials: thresholds differ from psignifit's by "
        f"{np.median(apart):.2f} of the interval's width in the middle, {max(apart):.2f} at most"
    )


def main(words: Sequence[str] | None = None) -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=200)
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--oracle", default="")
    options = parser.parse_args(words)
    for name in WAYS:
        print_way(name, options.people, options.trials)
    if options.oracle:
        print_oracle(options.oracle, min(options.people, 20), 10 * options.trials)


if __name__ == "__main__":
    main()
