"""Tables as they were laid out when they were pinned, from the tables of today.

Every pinned column stays compared: where a table or a column is called otherwise now, the mapping
here says how. Columns and rows that are new are left out of the comparison.
"""

import csv
import statistics
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from tests.experiments.fingerprint import fingerprint_of_table
from visavis.experiments.crowd import published
from visavis.experiments.crowd.comparisons import PAIRS
from visavis.experiments.crowd.design import CONDITIONS
from visavis.protocol.plan.questionnaires import load_questionnaire

Row = Mapping[str, str]


@dataclass(frozen=True)
class Part:
    """Some rows of a former table: those of `table` where `only` columns have one of the values.

    `columns` lead from former names to today's, where these differ; `constants` are former columns
    that today's table has not, as all its rows are alike.
    """

    table: str
    columns: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, str] = field(default_factory=dict)
    only: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Former:
    """The former tables of a study by name, and values of theirs that are called otherwise now.

    Rows of several parts are ordered by the column `ordered_by`; numbers of `fractional` columns,
    which shared a column with missing ones, were written with a fraction, those of `whole` without
    one. `sorted_by` are the columns by which a table's rows were sorted. `made` are tables that
    followed from today's in another way, by what makes their rows.
    """

    tables: Mapping[str, tuple[Part, ...]]
    values: Mapping[tuple[str, str], str] = field(default_factory=dict)
    ordered_by: str = ""
    fractional: tuple[str, ...] = ()
    sorted_by: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    whole: tuple[str, ...] = ()
    made: Mapping[str, Callable[[Path], list[dict[str, str]]]] = field(default_factory=dict)


EFFECTS: Final = ("technique", "direction", "technique:direction")
NO_EFFECT_SIZES: Final = dict.fromkeys(
    ("effect", "effect_size", "effect_ci_low", "effect_ci_high"), ""
)
"""Contrasts of aligned ranks had none then."""
WAVING: Final = Former(
    {
        "trials": (Part("trials"),),
        "participants": (Part("participants"),),
        "confusion": (Part("confusion"),),
        "cell_means": (Part("cell_means", {"accuracy": "is_right", "response_ms": "who_ms"}),),
        "statistics": (
            Part("statistics", {"published_F": "published_statistic"}, {"kind": "effect"},
                 {"term": EFFECTS}),
            Part("contrasts", {}, {"kind": "contrast", "error_term": "", **NO_EFFECT_SIZES},
                 {"term": EFFECTS}),
        ),
    },
    {("measure", "is_right"): "accuracy", ("measure", "who_ms"): "response_ms"},
    "measure",
    ("df1", "df2"),
)  # fmt: skip
SCORES: Final = (
    "total",
    "fear",
    "avoidance",
    "performance",
    "interaction",
    "fear_performance",
    "fear_interaction",
    "avoidance_performance",
    "avoidance_interaction",
)
SCORE_NAMES: Final = {f"anxiety_{name}": f"social_anxiety_{name}" for name in SCORES}
STARE: Final = Former(
    {
        "trials": (Part("trials"),),
        "answers": (Part("answers", SCORE_NAMES),),
        "participants": (Part("participants", {**SCORE_NAMES, "excluded": "left_out_because"}),),
        "condition_means": (Part("cell_means", {"n_trials": "n"}),),
        "statistics": (Part("statistics"),),
        "sensitivity": (Part("sensitivity", {"dwell_p": "dwell_ms_p"}),),
    },
    {("second", "social_anxiety_total"): "anxiety_total"},
    sorted_by={"condition_means": ("participant", "condition")},
)


def _read(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _crowd_means(today: Path) -> list[dict[str, str]]:
    """Return means by person and block as they were sorted: controls last."""
    rows = [{"group": "", **row} for row in _read(today / "cell_means.csv")]
    return sorted(rows, key=lambda r: (r["group"] == "control", r["participant"], r["condition"]))


def _crowd_statistics(today: Path) -> list[dict[str, str]]:
    """Return the tests over blocks with means of people who have all of them, then every pair."""
    found: list[dict[str, str]] = []
    means, contrasts = _crowd_means(today), _read(today / "contrasts.csv")
    for row in _read(today / "statistics.csv"):
        column, _, of = row["comparison"].partition(" by condition")
        if "×" in of:
            continue  # groups compared: these stood in the report alone
        group = of.strip(" ()")
        people: dict[str, dict[str, float]] = {}
        for mean in (m for m in means if m["group"] == group and m.get(column)):
            people.setdefault(mean["participant"], {})[mean["condition"]] = float(mean[column])
        whole = [p for p in people.values() if len(p) == len(CONDITIONS)]
        base = {"group": group, "measure": column, "n": str(len(whole))}
        for condition in CONDITIONS:
            values = [p[condition] for p in whole]
            base[f"mean_{condition}"] = str(statistics.mean(values)) if values else ""
            base[f"sd_{condition}"] = str(statistics.stdev(values)) if values else ""
        marks = {k: v for k, v in row.items() if k.startswith(("measure_", "is_simulated"))}
        if row["is_tested"] == "FALSE":
            why = row["why_not"]
            if not any(column in m for m in means):
                why = "not measured"
            elif len(whole) < 3:
                why = f"{len(whole)} people with all three blocks"
            found.append({**base, **marks, "comparison": "blocks", "problem": why})
            continue
        found.append(
            {
                **base,
                **marks,
                "comparison": "blocks",
                "test": "friedman" if row["chi2"] else "rm_anova",
                "p": row["p_used"] or row["p"],
                "significant": row["significant"],
                "sentence": row["sentence"]
                .replace("condition:", "block:")
                .replace("of condition", "of block"),
            }
        )
        mine = {
            (c["level_1"], c["level_2"]): c
            for c in contrasts
            if c["comparison"] == row["comparison"]
        }
        for pair in PAIRS:
            one = mine[pair]
            agrees = one["agrees_with_published"]
            if group == "control" and column in published.TESTS:  # held against the source then
                ours, theirs = one["is_significant"], pair in published.DIFFERENT.get(column, {})
                agrees = str(ours == str(theirs).upper()).upper()
            found.append(
                {
                    **base,
                    **marks,
                    "comparison": f"{pair[0]} - {pair[1]}",
                    "p": one["p_adjusted"],
                    "significant": one["is_significant"],
                    "difference": one["mean_difference"],
                    "agrees_with_published": agrees,
                    "sentence": one["sentence"].removesuffix("."),
                }
            )
    return found


def _labels() -> dict[tuple[str, str], str]:
    """Return what answers with options were called, which today's tables hold as values."""
    return {
        (question.question_id, str(value)): label
        for question in load_questionnaire("demographics").questions()
        for value, label in question.scale.options.items()
    }


CROWD: Final = Former(
    {
        "trials": (Part("trials", only={"is_practice": ("FALSE",)}),),
        "people": (Part("participants", {}, {"group": ""}),),
        "excluded": (
            Part(
                "trials", {"reason": "left_out_because"}, {},
                {"is_practice": ("FALSE",), "is_analysed": ("FALSE",)},
            ),
        ),
        **{name: (Part(name),) for name in ("blocks", "cells", "collisions", "crossings", "pulses",
                                            "similarity", "quick_walks")},
        "condition_means": (),
        "statistics": (),
    },
    _labels(),
    made={"condition_means": _crowd_means, "statistics": _crowd_statistics},
)  # fmt: skip
FORMER: Final[Mapping[str, Former]] = {
    "waving": WAVING,
    "quick_waving": WAVING,
    "stare": STARE,
    "quick_stare": STARE,
    "crowd": CROWD,
    "quick_crowd": CROWD,
}


def fingerprint_as_pinned(
    former: Former, pinned: Mapping[str, Any], today: Path, out: Path
) -> dict[str, Any]:
    """Return the fingerprint of tables in a folder, laid out as they were pinned; `out` is empty.

    Raises:
        KeyError: a pinned column is in none of today's tables.
    """
    found: dict[str, Any] = {}
    for name, parts in sorted(former.tables.items()):
        columns = pinned.get(f"{name}.csv: columns")
        if columns is None:
            continue
        rows = [row for part in parts for row in _rows(former, part, columns, today)]
        if name in former.made:
            rows = [{c: row.get(c, "") for c in columns} for row in former.made[name](today)]
        if len(parts) > 1 and former.ordered_by in columns:
            order = list(dict.fromkeys(row[former.ordered_by] for row in rows))
            rows.sort(key=lambda row: order.index(row[former.ordered_by]))
        if name in former.sorted_by:
            rows.sort(key=lambda row: [row[column] for column in former.sorted_by[name]])
        path = out / f"{name}.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, columns)
            writer.writeheader()
            writer.writerows(rows)
        found.update(fingerprint_of_table(path))
    return found


def _rows(former: Former, part: Part, columns: list[str], today: Path) -> Iterator[dict[str, str]]:
    path = today / f"{part.table}.csv"
    if not path.exists():  # no comparison could be tested: there are no contrasts
        return
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if any(row.get(column) not in values for column, values in part.only.items()):
                continue
            yield {name: _cell(former, part, row, name) for name in columns}


def _cell(former: Former, part: Part, row: Row, name: str) -> str:
    if name in part.constants:
        return part.constants[name]
    today = part.columns.get(name, name)
    if today not in row and part.constants:
        return ""  # effects have no contrast, contrasts no F
    cell = former.values.get((name, row[today]), row[today])
    if cell and name in former.whole:
        return str(int(float(cell)))
    return str(float(cell)) if cell and name in former.fractional else cell
