"""Hold simulated participants of the stare study against the published tables.

    python -m benchmarks.stare_participants [--seeds 10] [--participants 30] [--processes 2]

Over the quick path (`visavis.experiments.stare.quick_study`). Prints, for every condition and
measure, the published mean and SD, ours over all seeds, the deviation of the mean, and the largest
deviation of any seed; then the verdicts of the thirty tests that agree, per seed and in the median,
the correlations with anxiety, and first fixation times by zone. `--json` for machines.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence

import numpy as np

from tests.experiments.stare.simulated_studies import StudyOutcome, simulate_studies
from visavis.experiments.stare import published
from visavis.experiments.stare.design import CONDITIONS
from visavis.results.family_tests import agreement, count_agreement
from visavis.study.look_measures import (
    DWELL_MS,
    FIRST_FIXATION_DURATION_MS,
    FIXATION_COUNT,
    MAIN_MEASURES,
)

LIMITS_01 = {DWELL_MS: 0.15, FIXATION_COUNT: 0.15, FIRST_FIXATION_DURATION_MS: 0.20}
"""How far a condition's mean may lie from the published one; other measures have no limit."""
VERDICTS_LIMIT = 26


def mean_rows(outcomes: Sequence[StudyOutcome]) -> list[dict[str, object]]:
    """Compare means and spreads: one row per condition and measure."""
    rows: list[dict[str, object]] = []
    for condition in CONDITIONS:
        for measure in MAIN_MEASURES:
            ours = [
                d
                for o in outcomes
                for d in o.descriptives
                if d.condition == condition and d.measure.column == measure
            ]
            printed = published.MEANS[condition][measure]
            mean = float(np.mean([d.mean for d in ours]))
            deviations = [d.deviation_01 for d in ours]
            limit = LIMITS_01.get(measure)
            rows.append(
                {
                    "condition": condition,
                    "measure": measure,
                    "published_mean": printed.mean,
                    "mean": mean,
                    "deviation_01": mean / printed.mean - 1,
                    "largest_deviation_01": max(deviations, key=abs),
                    "published_sd": printed.sd,
                    "sd": float(np.mean([d.sd for d in ours])),
                    "limit_01": limit,
                    "seeds_within_limit": (
                        None if limit is None else sum(abs(d) <= limit for d in deviations)
                    ),
                }
            )
    return rows


def verdict_rows(outcomes: Sequence[StudyOutcome]) -> list[dict[str, object]]:
    """Count the agreeing verdicts of every seed."""
    return [
        {
            "seed": o.seed,
            "agree": count_agreement(o.comparisons).agree,
            "differ": [
                f"{c.name} {c.measure.column}"
                for c in o.comparisons
                if not (found := agreement(c)) or not found.agrees
            ],
        }
        for o in outcomes
    ]


def anxiety_rows(outcomes: Sequence[StudyOutcome]) -> list[dict[str, object]]:
    """Compare the printed correlations with the mean of ours."""
    return [
        {
            "condition": condition,
            "measure": measure,
            "published_r_s": printed.r,
            "r_s": float(
                np.mean(
                    [
                        c.outcome.r
                        for o in outcomes
                        for c in o.anxiety
                        if c.outcome is not None
                        and (c.level, c.measure.column) == (condition, measure)
                    ]
                )
            ),
        }
        for (condition, measure), printed in published.CORRELATIONS.items()
    ]


def zone_rows(outcomes: Sequence[StudyOutcome]) -> list[dict[str, object]]:
    """Compare first fixation times by zone: published p, median of ours, share significant."""
    rows: list[dict[str, object]] = []
    found = [c for o in outcomes for c in o.zones]
    for zone, tests in published.ZONE_TESTS.items():
        for pair, printed in tests.items():
            ours = [c for c in found if c.where == zone and (c.first, c.second) == pair]
            ps = [c.outcome.p for c in ours if c.outcome is not None]
            if ps:
                rows.append(
                    {
                        "zone": zone,
                        "comparison": " - ".join(pair),
                        "published_p": printed.p,
                        "median_p": float(np.median(ps)),
                        "significant_01": float(np.mean([bool(c.is_significant) for c in ours])),
                    }
                )
    return rows


def _print(result: dict[str, list[dict[str, object]]], median: float) -> None:
    print(
        f"{'':3} {'measure':28} {'published':>18} {'simulated':>18} "
        f"{'dev.':>6} {'worst':>6}  seeds within"
    )
    for r in result["means"]:
        digits = 2 if r["measure"] == FIXATION_COUNT else 0
        pair = [
            f"{r[m]:.{digits}f} ({r[s]:.{digits}f})"
            for m, s in (("published_mean", "published_sd"), ("mean", "sd"))
        ]
        within = (
            "" if r["limit_01"] is None else f"{r['seeds_within_limit']} of {r['limit_01']:.0%}"
        )
        print(
            f"{r['condition']:3} {r['measure']:28} {pair[0]:>18} {pair[1]:>18} "
            f"{r['deviation_01']:+6.0%} {r['largest_deviation_01']:+6.0%}  {within}"
        )
    print("\nverdicts that agree, of 30:")
    for r in result["verdicts"]:
        print(f"  seed {r['seed']}: {r['agree']}  {'; '.join(r['differ'])}")  # type: ignore[arg-type]
    often = Counter(d for r in result["verdicts"] for d in r["differ"])  # type: ignore[attr-defined]
    print(
        f"  median {median:g} (limit {VERDICTS_LIMIT}); most often different: "
        + ", ".join(f"{name} ({n})" for name, n in often.most_common(4))
    )
    print("\nSpearman with anxiety:")
    for r in result["anxiety"]:
        print(
            f"  {r['condition']:3} {r['measure']:28} published {r['published_r_s']:+.2f}, "
            f"simulated {r['r_s']:+.2f}"
        )
    print("\nfirst fixation time by zone:")
    for r in result["zones"]:
        print(
            f"  {r['zone']:7} {r['comparison']:8} published p {r['published_p']:.4f}, simulated "
            f"median {r['median_p']:.4f}, significant in {r['significant_01']:.0%}"
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark; exit 1 when a mean over seeds or the median verdict misses its limit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--participants", type=int, default=30)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    outcomes = list(
        simulate_studies(
            range(options.first_seed, options.first_seed + options.seeds),
            participants=options.participants,
            effect=True,
            processes=options.processes,
        )
    )
    result = {
        "means": mean_rows(outcomes),
        "verdicts": verdict_rows(outcomes),
        "anxiety": anxiety_rows(outcomes),
        "zones": zone_rows(outcomes),
    }
    median = float(np.median([r["agree"] for r in result["verdicts"]]))
    if options.json:
        print(json.dumps(result | {"median_verdicts": median}, indent=1))
    else:
        _print(result, median)
    missed = [
        r
        for r in result["means"]
        if r["limit_01"] is not None and abs(r["deviation_01"]) > r["limit_01"]  # type: ignore[arg-type]
    ]
    return int(bool(missed) or median < VERDICTS_LIMIT)


if __name__ == "__main__":
    sys.exit(main())
