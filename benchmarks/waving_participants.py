"""Hold simulated participants of the waving study against the published results.

    python -m benchmarks.waving_participants [--seeds 100] [--participants 16] [--session]

Over the quick path (`visavis.experiments.waving.quick_study`): what can be seen of the 54 waves is
rendered once, people and answers are drawn anew for every seed. Prints mean accuracies beside
the published ones and how often each effect is significant, with the closed-form power of the F
that the source prints; `--session` also times a whole
simulated session of 54 trials in processor seconds. `--json` for machines.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tests.experiments.waving.quick_sessions import quick_analysis, quick_study
from visavis.cli.quick_tracker import tracker_of
from visavis.devices.registry import OPTION_MODELS
from visavis.experiments.waving.clips import DIRECTIONS, TECHNIQUES
from visavis.experiments.waving.judgement import DEFAULT_POPULATION, Population
from visavis.experiments.waving.quick_study import STIMULI, evidence_for
from visavis.experiments.waving.study import COMPARISON, MEAN_ACCURACY
from visavis.lab.clock import cpu_time_s
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.results.opened_study import find_study
from visavis.results.power import KitPower
from visavis.running.quick import quick_study as quick_study_of_kit
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

MEAN_LIMIT = 0.08
SD_LIMIT = 0.08
"""Of the two readings of the published SD, that over people and that over people's cells."""
SHARE_LIMITS = {
    ("is_right", "technique"): ("at least", 0.50),
    ("is_right", "direction"): ("at least", 0.90),
    ("is_right", "technique:direction"): ("at most", 0.12),
    ("realism", "technique"): ("at most", 0.12),
}
"""Shares of studies: nominal means 5 %, of which 100 studies show up to 11 by chance."""
SESSION_LIMIT_S = 60.0


def study_rows(
    seeds: range, participants: int, population: Population = DEFAULT_POPULATION
) -> list[dict[str, object]]:
    """Return rows of name, value, published or limit, and whether it holds."""
    means: dict[str, list[float]] = {}
    hits: dict[tuple[str, str], int] = {}
    for seed in seeds:
        analysis = quick_analysis(quick_study(participants, seed, population=population))
        table = analysis.cell_means()
        for technique in TECHNIQUES:
            chosen = table[table["technique"] == technique]
            people = chosen.groupby("participant")["is_right"].mean()
            means.setdefault(f"accuracy {technique}", []).append(float(people.mean()))
            means.setdefault(f"SD {technique}", []).append(float(people.std(ddof=1)))
            means.setdefault(f"cell SD {technique}", []).append(float(chosen["is_right"].std()))
            for direction in DIRECTIONS:
                cell = chosen[chosen["direction"] == direction]
                name = f"accuracy {technique} {direction}"
                means.setdefault(name, []).append(float(cell["is_right"].mean()))
        for direction in DIRECTIONS:
            cell = table[table["direction"] == direction]
            means.setdefault(f"realism {direction}", []).append(float(cell["realism"].mean()))
        for finding in analysis.findings:
            for term in finding.terms:
                key = (finding.compare.dv, term.name)
                hits[key] = hits.get(key, 0) + int(term.is_significant)
    rows: list[dict[str, object]] = []
    printed = KitPower("waving", tracker_of, quick_study_of_kit).printed_tests
    for name, values in means.items():
        row: dict[str, object] = {"name": name, "value": float(np.mean(values))}
        row |= {"spread": float(np.std(values))}
        for technique in TECHNIQUES:
            mean, sd = MEAN_ACCURACY[technique]
            if name == f"accuracy {technique}":
                holds = abs(float(np.mean(values)) - mean) <= MEAN_LIMIT
                row |= {"beside": f"published {mean}", "holds": holds}
            if name in (f"SD {technique}", f"cell SD {technique}"):
                row |= {"beside": f"published {sd}, over what is not said"}
                row |= {"holds": abs(float(np.mean(values)) - sd) <= SD_LIMIT}
        rows.append(row)
    for key, count in hits.items():
        measure, name = key
        if measure != "who_ms":
            share = count / len(seeds)
            row = {"name": f"{measure}, {name} significant", "value": share}
            if key in SHARE_LIMITS:
                word, limit = SHARE_LIMITS[key]
                holds = share >= limit if word == "at least" else share <= limit
                row |= {"beside": f"{word} {limit}", "holds": holds}
            if f"{measure}:{term}" in printed:
                closed = printed[f"{measure}:{term}"].power(participants, COMPARISON.alpha)
                row["beside"] = f"{row.get('beside', '')} (printed F alone: {closed:.2f})".strip()
            rows.append(row)
    return rows


def session_row() -> dict[str, object]:
    """Return the processor time of one whole simulated session, waves being there already."""
    study = find_study("waving")
    config = load_config(EXAMPLE, OPTION_MODELS)
    with tempfile.TemporaryDirectory() as folder:
        config = config.model_copy(update={"data_root": Path(folder)})
        request = simulated_request(
            study, study.experiment({}), config, label="S01B", index=0, seed=1
        )
        before_s = cpu_time_s()
        perform_new(request)
        took_s = cpu_time_s() - before_s
    return {
        "name": "a session of 54 trials, processor seconds",
        "value": took_s,
        "beside": f"at most {SESSION_LIMIT_S:g}",
        "holds": took_s <= SESSION_LIMIT_S,
    }


def print_rows(rows: Sequence[Mapping[str, object]]) -> None:
    """Print a line for each row."""
    for row in rows:
        said = {True: "holds", False: "DOES NOT HOLD", None: ""}[row.get("holds")]  # type: ignore[index]
        print(f"{row['name']!s:<44} {row['value']:8.3f}  {row.get('beside', '')!s:<40} {said}")


def main(arguments: Sequence[str]) -> int:
    """Print the rows; exit with 1 when one does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--participants", type=int, default=16)
    parser.add_argument("--session", action="store_true")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    for stimulus in STIMULI:
        evidence_for(stimulus)
    rows = study_rows(range(given.seeds), given.participants)
    if given.session:
        rows.append(session_row())
    if given.json:
        print(json.dumps(rows, indent=1))
    else:
        print_rows(rows)
    return 0 if all(row.get("holds", True) for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
