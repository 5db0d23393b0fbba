"""Simulate the study `interpolation` again and again, and hold it against what its source prints.

    python -m benchmarks.rated_gestures [--studies N] [--people N] [--json]

Of 200 studies of 97 people: how far the mean rating of each gesture by each method lies from the
printed one on average (limit .20); in how many Squad is above both other methods by Tukey's test,
over all and gesture by gesture (limit 95 %, of the deictic gesture 85 %); in how many Slerp and
LinEuler do not differ (limit 93 %); in how many people who work with animation tell Squad from
LinEuler by more than others do (limit 90 %); and the CPU seconds of one study, analysed (limit 60).
Exits with 1 where one is missed.
"""

import argparse
import json
import sys
from dataclasses import asdict, dataclass, field

import numpy as np
import pandas as pd

from visavis.analysis.statistics import oneway_anova, tukey_hsd
from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.interpolation import published
from visavis.experiments.interpolation.gestures import GESTURES, METHODS
from visavis.experiments.interpolation.study import study
from visavis.lab.clock import cpu_time_s
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study

ALPHA = 0.05
ASKED, LEVELS = "animation_experience", ("none", "tried", "studied", "work")
MAX_OFF = 0.20
MIN_ABOVE_01 = {"over all": 0.95, **dict.fromkeys(GESTURES, 0.95), "deictic": 0.85}
"""The printed differences of the deictic gesture are the smallest."""
MIN_SAME_01 = 0.93
MIN_APART_01 = 0.90
MAX_CPU_S = 60.0


@dataclass
class Found:
    """What came of all studies; shares are of studies."""

    studies: int = 0
    people: int = 0
    means: dict[str, float] = field(default_factory=dict)
    printed: dict[str, float] = field(default_factory=dict)
    above_both_01: dict[str, float] = field(default_factory=dict)
    slerp_is_lineuler_01: float = 0.0
    experienced_apart_01: float = 0.0
    cpu_s: float = 0.0

    @property
    def most_off(self) -> float:
        """How far a cell's mean lies from the printed one at most."""
        return max(abs(self.means[cell] - self.printed[cell]) for cell in self.printed)


def pairs_of(rows: pd.DataFrame) -> dict[frozenset[str], float]:
    """Return the adjusted p of each pair of methods."""
    found = tukey_hsd(rows, "naturalness", factor="method", levels=METHODS)
    return {frozenset(c.label.split(" − ")): float(c.p_adjusted) for c in found.contrasts}


def is_above_both(rows: pd.DataFrame) -> bool:
    """Tell whether Squad is rated above both other methods, by Tukey's test."""
    means = rows.groupby("method")["naturalness"].mean()
    pairs = pairs_of(rows)
    return all(
        means["squad"] > means[m] and pairs[frozenset(("squad", m))] < ALPHA
        for m in ("slerp", "lineuler")
    )


def gap(rows: pd.DataFrame) -> float:
    """Return how far Squad is above LinEuler."""
    means = rows.groupby("method")["naturalness"].mean()
    return float(means["squad"] - means["lineuler"])


def simulated(studies: int, people: int) -> Found:
    """Simulate and analyse so many studies."""
    opened = OpenedStudy(study)
    experiment = opened.experiment({})
    above: dict[str, list[bool]] = {name: [] for name in ("over all", *GESTURES)}
    same, apart, tables = [], [], []
    begun_s = 0.0
    for seed in range(studies):
        if seed == min(1, studies - 1):
            begun_s = cpu_time_s()  # the first one compiles, and poses every gesture
        rows = quick_study(opened, experiment, tracker_of, range(people), seed=seed).trials
        oneway_anova(rows, "naturalness", factor="method", levels=METHODS)
        above["over all"].append(is_above_both(rows))
        for name in GESTURES:
            above[name].append(is_above_both(rows[rows["gesture"] == name]))
        same.append(pairs_of(rows)[frozenset(("slerp", "lineuler"))] >= ALPHA)
        practised = [
            opened.participant(k, seed, effect=True, experiment=experiment).answer(
                ASKED, "", LEVELS
            )
            == LEVELS[-1]
            for k in range(people)
        ]
        names = list(dict.fromkeys(rows["participant"]))
        of_them = rows["participant"].isin(
            [n for n, is_so in zip(names, practised, strict=True) if is_so]
        )
        apart.append(gap(rows[of_them]) > gap(rows[~of_them]))
        tables.append(rows.groupby(["gesture", "method"])["naturalness"].mean())
    means = pd.concat(tables, axis=1).mean(axis=1)
    printed = {
        f"{s.gesture} {method}": float(mean)
        for s in published.SUBSETS
        if s.gesture
        for method, mean in zip(METHODS, s.means, strict=True)
    }
    return Found(
        studies,
        people,
        {f"{g} {m}": float(means[g, m]) for g in GESTURES for m in METHODS},
        printed,
        {name: float(np.mean(told)) for name, told in above.items()},
        float(np.mean(same)),
        float(np.mean(apart)),
        (cpu_time_s() - begun_s) / max(1, studies - 1),
    )


def main(arguments: list[str]) -> int:
    """Print what came of it beside what is printed."""
    parser = argparse.ArgumentParser(prog="benchmarks.rated_gestures", description=__doc__)
    parser.add_argument("--studies", type=int, default=200)
    parser.add_argument("--people", type=int, default=97)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    found = simulated(options.studies, options.people)
    is_well = (
        found.most_off <= MAX_OFF
        and all(found.above_both_01[name] >= limit for name, limit in MIN_ABOVE_01.items())
        and found.slerp_is_lineuler_01 >= MIN_SAME_01
        and found.experienced_apart_01 >= MIN_APART_01
        and found.cpu_s <= MAX_CPU_S
    )
    if options.json:
        print(json.dumps(asdict(found), indent=2))
        return not is_well
    print(f"SIMULATED: {found.studies} studies of {found.people} people")
    print("mean rating      printed  simulated")
    for cell, mean in found.printed.items():
        print(f"  {cell:<20} {mean:.2f}  {found.means[cell]:.2f}")
    print(f"most off {found.most_off:.2f} (limit {MAX_OFF:g})")
    for name, share in found.above_both_01.items():
        limit = f"limit {100 * MIN_ABOVE_01[name]:g} %"
        print(f"Squad above both, {name}: {100 * share:.1f} % of studies ({limit})")
    print(
        f"Slerp and LinEuler do not differ: {100 * found.slerp_is_lineuler_01:.1f} % "
        f"(limit {100 * MIN_SAME_01:g} %)"
    )
    print(
        f"who works with animation tells them further apart: "
        f"{100 * found.experienced_apart_01:.1f} % (limit {100 * MIN_APART_01:g} %)"
    )
    print(f"{found.cpu_s:.1f} CPU s a study, simulated and analysed (limit {MAX_CPU_S:g})")
    return not is_well


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
