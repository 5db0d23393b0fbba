"""From the tables of a crowd study to every conclusion."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

import pandas as pd

from analysis.statistics import Equivalence, rm_anova
from analysis.statistics.errors import StatisticsError
from experiments.crowd import published
from experiments.crowd.analysis_parameters import DEFAULT_PARAMETERS, RULES, AnalysisParameters
from experiments.crowd.comparisons import (
    MeasureComparison,
    compare_measure,
    path_length_equivalence,
)
from experiments.crowd.design import CONDITIONS, CONTROL_GROUP
from experiments.crowd.narrow_gaps import with_narrow_gaps
from experiments.crowd.paths import CellsBy, PathAnalysis, analyse_paths
from experiments.crowd.terms import MEASURES, PAIRS, PATH, PRIMARY, Measure
from lab.errors import DataError
from visavis.exclusions import COUNTED, REASON, Selection, limits_in_force, select

Tables = Mapping[str, pd.DataFrame]
SIMULATED_COLUMN = "is_simulated"
PERSON_OUT: Final = "participant left out"


@dataclass(frozen=True)
class GroupAnalysis:
    """One group of participants over the three blocks.

    `kept` holds the walks analysed, `means` one row per participant and block. `path_lengths`
    says per pair of blocks whether people walk as far, or why that was not tested.
    """

    group: str
    kept: pd.DataFrame = field(repr=False)
    means: pd.DataFrame = field(repr=False)
    comparisons: tuple[MeasureComparison, ...]
    paths: PathAnalysis
    path_lengths: Mapping[tuple[str, str], Equivalence | str]

    @property
    def people(self) -> tuple[str, ...]:
        """Participants with at least one block."""
        return tuple(sorted(set(self.means["participant"].astype(str))))

    @property
    def walks(self) -> frozenset[tuple[str, str]]:
        """Participant and trial of every walk analysed."""
        return _keys(self.kept)

    def comparison(self, measure: Measure) -> MeasureComparison:
        """Return the comparison of a measure."""
        return next(c for c in self.comparisons if c.measure == measure)


@dataclass(frozen=True)
class CrowdAnalysis:
    """Everything the study's analysis found; `main` is the group that felt vibrations.

    `selection` says of every walk whether it counts, `planned` how many walks each person's blocks
    were planned with.
    """

    parameters: AnalysisParameters
    is_simulated: bool
    rules: tuple[str, ...]
    trials: pd.DataFrame = field(repr=False)
    selection: Selection = field(repr=False)
    planned: Mapping[str, int]
    main: GroupAnalysis
    control: GroupAnalysis | None
    between_groups: tuple[str, ...]

    @property
    def kept(self) -> pd.DataFrame:
        """The walks that count."""
        return self.selection.counted

    @property
    def excluded(self) -> tuple[tuple[str, str | None, str], ...]:
        """Who and what is left out and why: participant, walk (None: all of them), reason."""
        rows, people = self.selection.rows, self.selection.people
        out = rows[~rows[COUNTED] & ~rows[REASON].str.startswith(PERSON_OUT)]
        gone = people[~people[COUNTED]]
        walks = [(str(p), str(t), str(why)) for p, t, why in
                 zip(out["participant"], out["trial_id"], out[REASON], strict=True)]  # fmt: skip
        whole = [(str(p), None, str(why)) for p, why in
                 zip(gone["participant"], gone[REASON], strict=True)]  # fmt: skip
        return (*walks, *whole)

    def agreement(self, *, published_as_different: bool) -> tuple[int, int]:
        """How many published verdicts come back, of how many that can be told: of the pairs of
        blocks that the source calls different, or of those it does not.
        """
        found = [
            c.agrees(pair)
            for c in self.main.comparisons
            for pair in PAIRS
            if c.measure.column in published.TESTS
            and (pair in published.TESTS[c.measure.column].pairs) == published_as_different
        ]
        known = [a for a in found if a is not None]
        return sum(known), len(known)

    @property
    def means(self) -> pd.DataFrame:
        """One row per participant and block of every group, the group named."""
        groups = [g for g in (self.main, self.control) if g is not None]
        return pd.concat([g.means.assign(group=g.group) for g in groups], ignore_index=True)

    def statistics_rows(self) -> list[dict[str, Any]]:
        """Return one flat row per test of every group."""
        rows = []
        for group in (self.main, self.control):
            if group is None:
                continue
            for comparison in group.comparisons:
                rows += [{"group": group.group, **row} for row in comparison.rows()]
        return rows


def analyse_tables(
    tables: Tables,
    parameters: AnalysisParameters = DEFAULT_PARAMETERS,
    *,
    is_simulated: bool,
    allow_mixture: bool = False,
    limits: Mapping[str, Any] = MappingProxyType({}),
) -> CrowdAnalysis:
    """Analyse a study from its tables of trials, cells and blocks.

    Works with any number of participants: what cannot be tested says why. `limits` replace those
    of the rules of exclusion by name.

    Raises:
        DataError: no walk was measured, simulated and real walks are mixed, or volumes were
            measured by several rules.
    """
    trials = tables["trials"]
    if not (trials["status"] == "complete").any():
        raise DataError("no walk of this study was measured; check that sessions are complete")
    trials = with_narrow_gaps(trials, tables.get("crossings"), parameters.narrow_gap_m)
    if not (allow_mixture and is_simulated):
        _refuse_mixture(trials, is_simulated)
    rules = tuple(
        sorted(
            {
                f"{rule} ({surface})"
                for rule, surface in zip(
                    trials["measure_rule"], trials["measure_surface"], strict=True
                )
            }
        )
    )
    if len(rules) > 1:
        raise DataError(
            f"volumes were measured by {', '.join(rules)}; they cannot be compared: measure all "
            "sessions by one rule and surface"
        )
    planned = planned_walks(trials, _people(tables))
    selection = select(
        trials,
        RULES,
        limits_in_force(RULES, limits),
        cells=("condition",),
        planned={person: len(CONDITIONS) * walks for person, walks in planned.items()},
        cell_count=len(CONDITIONS),
    )
    kept = selection.counted
    blocks = tables["blocks"]
    cells = tables["cells"]
    groups = kept["group"].fillna("").astype(str) if "group" in kept else pd.Series("", kept.index)
    main_rows = kept[groups != CONTROL_GROUP]
    control_rows = kept[groups == CONTROL_GROUP]
    if main_rows.empty:
        main_rows, control_rows = control_rows, main_rows
    main = _group(main_rows, blocks, cells, parameters)
    control = _group(control_rows, blocks, cells, parameters) if len(control_rows) else None
    return CrowdAnalysis(
        parameters,
        is_simulated,
        rules,
        selection.rows,
        selection,
        planned,
        main,
        control,
        () if control is None else _between(main, control),
    )


def planned_walks(trials: pd.DataFrame, everybody: Sequence[str] = ()) -> dict[str, int]:
    """Return how many walks each person's blocks were planned with."""
    longest = max(_walks_by_block(trials).values(), default=0)
    planned = dict.fromkeys(sorted({*everybody, *trials["participant"].astype(str)}), longest)
    if "block_walks" in trials:
        known = trials.dropna(subset=["block_walks"])
        for person, most in (
            known.groupby(known["participant"].astype(str))["block_walks"].max().items()
        ):
            planned[str(person)] = int(most)
    return planned


def _people(tables: Tables) -> tuple[str, ...]:
    people = tables.get("people")
    if people is None or "participant" not in people:
        return ()
    return tuple(people["participant"].astype(str))


def _keys(trials: pd.DataFrame) -> frozenset[tuple[str, str]]:
    return frozenset(
        (str(p), str(t)) for p, t in zip(trials["participant"], trials["trial_id"], strict=True)
    )


def _walks_by_block(trials: pd.DataFrame) -> Counter[tuple[str, str]]:
    return Counter(
        zip(trials["participant"].astype(str), trials["condition"].astype(str), strict=True)
    )


def block_means(kept: pd.DataFrame, blocks: pd.DataFrame) -> pd.DataFrame:
    """Return one row per participant and block: means over walks, ratings beside them."""
    columns = [m.column for m in MEASURES if m.column in kept and not m.is_rating]
    values = kept[["participant", "condition", *columns]].copy()
    values["participant"] = values["participant"].astype(str)
    for column in columns:
        values[column] = pd.to_numeric(values[column], errors="coerce")
    means = values.groupby(["participant", "condition"], as_index=False).mean()
    ratings = [m.column for m in MEASURES if m.is_rating and m.column in blocks]
    if len(blocks) and ratings:
        asked = blocks[["participant", "condition", *ratings]].copy()
        asked["participant"] = asked["participant"].astype(str)
        for column in ratings:
            asked[column] = pd.to_numeric(asked[column], errors="coerce")
        means = means.merge(asked, on=["participant", "condition"], how="left")
    return means


def cells_by(cells: pd.DataFrame, kept: pd.DataFrame) -> CellsBy:
    """Return the cells of every kept walk by condition, configuration and participant."""
    keys = _keys(kept)
    return {
        (str(row["condition"]), int(row["configuration"]), str(row["participant"])): frozenset(
            (int(c[0]), int(c[1]), int(c[2])) for c in json.loads(row["cells"]) if c is not None
        )
        for row in cells.to_dict("records")
        if (str(row["participant"]), str(row["trial_id"])) in keys
    }


def _group(
    kept: pd.DataFrame, blocks: pd.DataFrame, cells: pd.DataFrame, parameters: AnalysisParameters
) -> GroupAnalysis:
    means = block_means(kept, blocks)
    comparisons = tuple(compare_measure(means, m, parameters) for m in MEASURES)
    path = next(c for c in comparisons if c.measure == PATH)
    name = str(kept["group"].iloc[0] or "") if "group" in kept and len(kept) else ""
    return GroupAnalysis(
        name,
        kept,
        means,
        comparisons,
        analyse_paths(cells_by(cells, kept), parameters),
        {pair: path_length_equivalence(path, pair, parameters) for pair in PAIRS},
    )


def _between(main: GroupAnalysis, control: GroupAnalysis) -> tuple[str, ...]:
    """Say for each primary measure whether the change over blocks differs between groups."""
    sentences = []
    for measure in PRIMARY:
        rows: list[dict[str, Any]] = []
        for group in (main, control):
            found = group.comparison(measure)
            for person, values in zip(found.people, found.table, strict=True):
                rows += [
                    {"participant": person, "group": group.group, "block": c, "value": float(v)}
                    for c, v in zip(CONDITIONS, values, strict=True)
                ]
        try:
            table = rm_anova(
                pd.DataFrame(rows),
                "value",
                subject="participant",
                within=("block",),
                between=("group",),
            )
        except StatisticsError as error:
            sentences.append(f"{measure.label}: not tested, {error}")
            continue
        sentences.append(f"{measure.label}, {table.effect('block:group').sentence()}.")
    return tuple(sentences)


def _refuse_mixture(trials: pd.DataFrame, is_simulated: bool) -> None:
    kinds: Sequence[bool] = sorted(set(trials[SIMULATED_COLUMN].astype(bool)))
    if set(kinds) - {is_simulated}:
        said, other = ("simulated", "real") if is_simulated else ("real", "simulated")
        raise DataError(
            f"the trial table holds {other} sessions but was given as {said} data; analyse "
            "simulated and real sessions apart"
        )
