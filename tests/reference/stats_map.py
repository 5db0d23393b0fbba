"""Compare the statistics package with files of reference results.

    python -m tests.reference.stats_map FILE... [--data FOLDER]

Every entry is mapped to a public call; one line per failing value, a closing count, exit status 1
when any value fails or an entry has no call. Results whose data set is not in the file are
recomputed when FOLDER holds DATASET.csv; otherwise what follows from their statistics is checked.
"""

import argparse
import csv
import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.reference.stats_compare import Failure, Outcome, compare, total
from tests.reference.stats_factorial import FACTORIAL, Case
from tests.reference.stats_printed import check_item, follow
from tests.reference.stats_simple import SIMPLE
from visavis.analysis.statistics import StatisticsError

CALLS = {**FACTORIAL, **SIMPLE}


def run_file(path: Path, data_folder: Path | None = None) -> Outcome:
    """Compare all entries of one file."""
    file = json.loads(path.read_text(encoding="utf-8"))
    name = path.stem
    if "items" in file:
        items = [check_item(f"{name}[{i}]", item) for i, item in enumerate(file["items"])]
        return total([*items, _counts(name, file)])
    if "dataset" in file and "data" not in file:
        source = None if data_folder is None else data_folder / f"{file['dataset']}.csv"
        if source is None or not source.exists():
            return total(follow(_where(name, i, e), e, file) for i, e in enumerate(file["results"]))
        case = Case({**file, "design": _design(file)}, _read(source))
    else:
        case = Case(file)
    return total(run_entry(case, _where(name, i, e), e) for i, e in enumerate(file["results"]))


def run_entry(case: Case, where: str, entry: Mapping[str, Any]) -> Outcome:
    """Compare one entry; an unknown procedure or an error counts as a failure."""
    call = CALLS.get(entry["procedure"])
    if call is None:
        return Outcome(1, (Failure(where, entry["procedure"], "no call for this procedure"),))
    try:
        got = call(case, entry)
    except StatisticsError as error:
        return Outcome(1, (Failure(where, "a result", f"{type(error).__name__}: {error}"),))
    return compare(where, entry["expected"], got, entry["tolerance"])


def _where(name: str, i: int, entry: Mapping[str, Any]) -> str:
    of = entry.get("term") or entry.get("factor") or entry.get("set") or ""
    return f"{name}[{i}] {entry['procedure']} {entry.get('dv', '')} {of}".rstrip()


def _counts(name: str, file: Mapping[str, Any]) -> Outcome:
    """Check that a file of published values says itself how many items are inconsistent."""
    got = {
        "n_items": len(file["items"]),
        "n_inconsistent": sum(not all(i["consistent"].values()) for i in file["items"]),
    }
    stated = {k: file[k] for k in got if k in file}
    return compare(name, stated, got, {})


def _design(file: Mapping[str, Any]) -> dict[str, Any]:
    """Read the factors of a file without design from the formulas of its calls."""
    calls = " ".join(entry["call"] for entry in file["results"])
    match = re.search(r"art\((\w+) ~ ([\w* ]+)", calls)
    factors = [] if match is None else [f.strip() for f in match.group(2).split("*")]
    strata = re.search(r"Error\(\w+/\(([\w* ]+)\)\)", calls)
    within = [] if strata is None else [f.strip() for f in strata.group(1).split("*")]
    return {
        "subject": file["subject_column"] if within else None,
        "within": within,
        "between": [f for f in factors if f not in within],
    }


def _read(path: Path) -> dict[str, list[Any]]:
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    columns: dict[str, list[Any]] = {name: [row[name] for row in rows] for name in rows[0]}
    for name, values in columns.items():
        try:
            columns[name] = [float(v) for v in values]
        except ValueError:
            continue
    return columns


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the comparison and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]  # the docstring is above
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--data", type=Path, default=None)
    options = parser.parse_args(arguments)
    outcomes = []
    for path in options.files:
        outcome = run_file(path, options.data)
        for failure in outcome.failures:
            sys.stdout.write(f"{failure}\n")
        outcomes.append(outcome)
    summed = total(outcomes)
    text = f"{summed.compared} values compared in {len(outcomes)} files, "
    text += f"{len(summed.failures)} failed"
    if summed.without_data:
        text += f"; {summed.without_data} values belong to data sets not in the files (--data)"
    sys.stdout.write(text + "\n")
    return 1 if summed.failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
