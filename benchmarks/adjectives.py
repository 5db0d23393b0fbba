"""How well the four planted clusters of adjectives are found again, and what a study costs.

    python -m benchmarks.adjectives [--studies N]

Studies of 14 raters who rate 27 walks on 41 pairs, 40 without `--studies`: how many pairs the
rule of selection leaves, and the adjusted Rand index of the four clusters against those planted.
Then one study by the quick path, simulated and clustered: its CPU time.
"""

import argparse

import numpy as np

from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.adjectives.clustering import Impressions, adjusted_rand, rating_cube
from visavis.experiments.adjectives.pairs import PAIRS
from visavis.experiments.adjectives.raters import LOADINGS, drawn_ratings, mean_rating
from visavis.experiments.adjectives.study import study
from visavis.experiments.adjectives.walks import REFERENCE, WALKS, impressions_seen, walk_of
from visavis.lab.clock import cpu_time_s
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study

RATERS = 14


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=40)
    studies = parser.parse_args().studies
    felt = [impressions_seen(walk_of(walk), walk_of(REFERENCE)) for walk in WALKS]
    means = np.array([[mean_rating(pair, one) for one in felt] for pair in PAIRS])
    left, alike = [], []
    for seed in range(studies):
        ratings = drawn_ratings(means, RATERS, np.random.default_rng(seed))
        impressions = Impressions(WALKS, ratings)
        left.append(len(impressions.kept))
        planted = [LOADINGS[pair].factor for pair in impressions.kept]
        alike.append(adjusted_rand(impressions.cluster_of, planted))
    print(f"studies of {RATERS} raters: {studies}")
    print(f"pairs that the rule leaves of {len(PAIRS)}: {min(left)} to {max(left)}")
    print(f"adjusted Rand index: median {np.median(alike):.3f}, least {min(alike):.3f}")
    begin_s = cpu_time_s()
    opened = OpenedStudy(study)
    made = opened.experiment({})
    trials = quick_study(opened, made, tracker_of, range(RATERS), seed=1).trials
    one = Impressions(WALKS, rating_cube(trials, WALKS))
    print(f"one study simulated and clustered: {cpu_time_s() - begin_s:.1f} CPU s, ", end="")
    print(f"{len(one.kept)} pairs left")


if __name__ == "__main__":
    main()
