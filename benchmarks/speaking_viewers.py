"""Simulate both studies of speaking bodies again and again, and hold them against their source.

    python -m benchmarks.speaking_viewers [--studies N] [--people N] [--json]

Of 200 studies of 21 people each: how far mean ratings of the three bodies and the mean vote lie
from those printed on average (limit .15); in how many the body filled from the corpus is rated
above the one that holds with p < .05 by the source's unpaired test (limit 85 %); in how many the
body that does not move is rated lowest (limit: all); in how many each t lies within the band that
the printed means and SDs lead to (limit 90 %); and the CPU seconds of both studies (limit 60).
Exits with 1 where one is missed.
"""

import argparse
import sys
from dataclasses import dataclass, field

import numpy as np

from benchmarks.table import Row, show
from visavis.analysis.statistics import independent_t, one_sample_t
from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.gestures import published
from visavis.experiments.gestures.clips import FILLS
from visavis.experiments.gestures.pairs import study as pairs
from visavis.experiments.gestures.sections import person_means
from visavis.experiments.gestures.study import study
from visavis.lab.clock import cpu_time_s
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study

ALPHA = 0.05
MAX_OFF = 0.15
MIN_ABOVE_01 = 0.85
MIN_IN_BAND_01 = 0.90
MAX_CPU_S = 60.0
BANDS = {
    "still corpus": (-14.2, -7.5),
    "still holds": (-10.3, -5.0),
    "corpus holds": (1.8, 6.1),
    "votes": (-9.4, -3.5),
}
"""95 % of t in 4,000 tables simulated from the printed means and SDs."""


@dataclass
class Found:
    """What came of all studies; shares are of studies."""

    studies: int
    people: int
    means: dict[str, float] = field(default_factory=dict)
    sds: dict[str, float] = field(default_factory=dict)
    mean_t: dict[str, float] = field(default_factory=dict)
    in_band_01: dict[str, float] = field(default_factory=dict)
    corpus_above_holds_01: float = 0.0
    still_lowest_01: float = 0.0
    cpu_s: float = 0.0

    @property
    def most_off(self) -> float:
        """How far a mean lies from the printed one at most."""
        printed = {body: m.mean for body, m in published.RATINGS.items()}
        printed["votes"] = published.VOTES_MEAN
        return max(abs(self.means[name] - mean) for name, mean in printed.items())

    @property
    def rows(self) -> list[Row]:
        """Every figure beside its limit; of means and t the one that is printed in the source."""
        of = f"of {self.studies} studies of {self.people} people"
        printed_t = {" ".join(k): t for k, t in published.TESTS.items()}
        printed_t["votes"] = published.VOTES_T
        return [
            *(
                Row(f"mean of {body} (printed {m.mean:g}, SD {m.sd:g})", self.means[body], "")
                for body, m in published.RATINGS.items()
            ),
            Row(f"mean vote (printed {published.VOTES_MEAN:g})", self.means["votes"], ""),
            *(Row(f"SD of people's {name}", sd, "") for name, sd in self.sds.items()),
            Row("mean farthest from the printed one", self.most_off, "", MAX_OFF),
            *(
                Row(f"mean t of {name} (printed {printed_t[name]:g})", self.mean_t[name], "")
                for name in BANDS
            ),
            *(
                Row(
                    f"t of {name} within {low:g} to {high:g}, {of}",
                    self.in_band_01[name],
                    "share",
                    MIN_IN_BAND_01,
                    at_least=True,
                )
                for name, (low, high) in BANDS.items()
            ),
            Row(
                f"corpus above holds with p < {ALPHA:g}, {of}",
                self.corpus_above_holds_01,
                "share",
                MIN_ABOVE_01,
                at_least=True,
            ),
            Row(f"still lowest, {of}", self.still_lowest_01, "share", 1.0, at_least=True),
            Row("both studies simulated and analysed", self.cpu_s, "CPU s", MAX_CPU_S),
        ]


def simulated(studies: int, people: int) -> Found:
    """Simulate and analyse so many of both studies."""
    opened = [OpenedStudy(s) for s in (study, pairs)]
    experiments = [o.experiment({}) for o in opened]
    means, sds, ts = [], [], []
    above, lowest = [], []
    begun_s = 0.0
    for seed in range(studies):
        if seed == min(1, studies - 1):
            begun_s = cpu_time_s()  # the first one learns the speaker and poses every clip
        rated, voted = (
            quick_study(o, e, tracker_of, range(people), seed=seed).trials
            for o, e in zip(opened, experiments, strict=True)
        )
        table = person_means(rated)
        votes = voted.groupby("participant")["vote_for_holds"].mean()
        means.append({**{b: float(table[b].mean()) for b in FILLS}, "votes": float(votes.mean())})
        sds.append({**{b: float(table[b].std()) for b in FILLS}, "votes": float(votes.std())})
        tests = {
            f"{one} {other}": independent_t(np.asarray(table[one]), np.asarray(table[other]))
            for one, other in published.TESTS
        }
        ts.append(
            {**{k: t.t for k, t in tests.items()}, "votes": one_sample_t(np.asarray(votes)).t}
        )
        above.append(tests["corpus holds"].p < ALPHA and tests["corpus holds"].t > 0)
        lowest.append(str(table.mean().idxmin()) == "still")
    return Found(
        studies,
        people,
        {name: float(np.mean([m[name] for m in means])) for name in means[0]},
        {name: float(np.mean([m[name] for m in sds])) for name in sds[0]},
        {name: float(np.mean([t[name] for t in ts])) for name in BANDS},
        {
            name: float(np.mean([low <= t[name] <= high for t in ts]))
            for name, (low, high) in BANDS.items()
        },
        float(np.mean(above)),
        float(np.mean(lowest)),
        (cpu_time_s() - begun_s) / max(1, studies - 1),
    )


def main(arguments: list[str]) -> int:
    """Print what came of it beside what is printed."""
    parser = argparse.ArgumentParser(prog="benchmarks.speaking_viewers", description=__doc__)
    parser.add_argument("--studies", type=int, default=200)
    parser.add_argument("--people", type=int, default=published.PEOPLE)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    found = simulated(options.studies, options.people)
    return show(found.rows, as_json=options.json)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
