"""Analyse a crowd study and write what an analyst takes away: tables, figures, report."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import pandas as pd

from analysis.plots import write_figure
from analysis.report import ReportProvenance
from analysis.report.sources import provenance_of_sessions
from experiments.crowd.analysis import SIMULATED_COLUMN, CrowdAnalysis, Tables, analyse_tables
from experiments.crowd.analysis_parameters import DEFAULT_PARAMETERS, AnalysisParameters
from experiments.crowd.columns import table_columns
from experiments.crowd.design import AFTER_BLOCK, AT_END
from experiments.crowd.figures import study_figures
from experiments.crowd.intake import SessionIntake
from experiments.crowd.measures import MeasuredWalk
from experiments.crowd.report import build_report
from experiments.crowd.study import study
from lab.errors import UsageError
from lab.geometry import Vector
from protocol.questionnaires import load_questionnaire
from visavis.dictionary import trial_columns, write_table
from visavis.experiment import StudyExperiment

REPORT_NAME: Final = "report.html"
_WHICH: Final = ("participant", "condition", "configuration", "measure_rule", "measure_surface")


def tables_of(sessions: Sequence[SessionIntake]) -> dict[str, pd.DataFrame]:
    """Return the study's tables by name: trials, collisions, crossings, pulses, blocks, people,
    cells. Each says by which rule and on which surface volumes were measured where it holds any.
    """
    walks = [walk for session in sessions for walk in session.walks]
    unmeasured = [row for session in sessions for row in session.unmeasured]
    pulses = [
        {"participant": session.participant, **p} for session in sessions for p in session.pulses
    ]
    return {
        **tables_of_walks(walks, unmeasured),
        "pulses": pd.DataFrame(pulses),
        "blocks": pd.DataFrame([b for s in sessions for b in s.blocks]),
        "people": pd.DataFrame([s.person for s in sessions]),
    }


def tables_of_walks(
    walks: Sequence[MeasuredWalk], unmeasured: Sequence[Mapping[str, Any]] = ()
) -> dict[str, pd.DataFrame]:
    """Return the tables of measured walks: trials, collisions, crossings, cells.

    `unmeasured` walks have their row in the first alone.
    """
    trials: list[dict[str, Any]] = []
    collisions: list[dict[str, Any]] = []
    crossings: list[dict[str, Any]] = []
    cells: list[dict[str, Any]] = []
    for walk in walks:
        row = walk.row
        which = {name: row[name] for name in _WHICH}
        place = {name: row[name] for name in _WHICH[:3]}
        trials.append(row)
        collisions += [{**which, **c} for c in walk.collisions]
        crossings += [{**place, **c} for c in walk.crossings]
        cells.append({**place, "trial_id": row["trial_id"], "cells": json.dumps(walk.cells)})
    return {
        "trials": pd.DataFrame([*trials, *unmeasured]),
        "collisions": pd.DataFrame(collisions),
        "crossings": pd.DataFrame(crossings),
        "cells": pd.DataFrame(cells),
    }


def tracks_of(sessions: Sequence[SessionIntake]) -> dict[tuple[str, str], Vector]:
    """Return every walk's way over the floor by participant and trial."""
    return {
        (str(w.row["participant"]), str(w.row["trial_id"])): w.track_m
        for s in sessions
        for w in s.walks
    }


def analyse_study(
    sessions: Sequence[SessionIntake],
    out_dir: Path,
    *,
    is_simulated: bool,
    commands: tuple[str, ...],
    parameters: AnalysisParameters = DEFAULT_PARAMETERS,
    limits: Mapping[str, Any] = MappingProxyType({}),
) -> Path:
    """Write every table, the figures and the report of a study; return the report's path.

    Files of the same name are replaced; the same input gives the same bytes.
    """
    tables = tables_of(sessions)
    provenance = provenance_of_sessions(
        "crowd", [s.manifest for s in sessions], [s.source for s in sessions], commands
    )
    kinds = {s.is_simulated for s in sessions}
    return write_study(
        tables,
        tracks_of(sessions),
        out_dir,
        is_simulated=is_simulated,
        allow_mixture=len(kinds) > 1,
        provenance=provenance,
        parameters=parameters,
        limits=limits,
    )


def write_study(
    tables: Tables,
    tracks: Mapping[tuple[str, str], Vector],
    out_dir: Path,
    *,
    is_simulated: bool,
    provenance: ReportProvenance,
    allow_mixture: bool = False,
    parameters: AnalysisParameters = DEFAULT_PARAMETERS,
    limits: Mapping[str, Any] = MappingProxyType({}),
) -> Path:
    """Analyse tables and write them with statistics, figures and report; return the report."""
    analysis = analyse_tables(
        tables,
        parameters,
        is_simulated=is_simulated,
        allow_mixture=allow_mixture,
        limits=limits,
    )
    figures = study_figures(analysis, tables, tracks)
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        write_tables(analysis, tables, out_dir)
        for drawn in figures.values():
            write_figure(drawn, out_dir / "figures")
    except OSError as error:
        raise UsageError(
            f"the analysis cannot be written to {out_dir}: {error.strerror or error}; choose a "
            "folder you may write to"
        ) from error
    return build_report(analysis, tables, provenance, out_dir / REPORT_NAME, figures=figures)


def write_tables(analysis: CrowdAnalysis, tables: Tables, out_dir: Path) -> None:
    """Write every table as CSV and Parquet, a JSON dictionary of its columns beside it."""
    first = analysis.trials.iloc[0]
    how = {name: first[name] for name in _WHICH[3:]}
    everything = {
        **tables,
        "trials": analysis.trials,
        "condition_means": analysis.means.assign(**how),
        "statistics": pd.DataFrame(analysis.statistics_rows()).assign(**how),
        "similarity": similarity_rows(analysis),
        "excluded": pd.DataFrame(analysis.excluded, columns=["participant", "trial_id", "reason"]),
    }
    known = trial_columns(StudyExperiment(study), ())
    asked = [load_questionnaire(name) for name in (*AFTER_BLOCK, *AT_END)]
    for name, table in everything.items():
        marked = table.assign(**{SIMULATED_COLUMN: analysis.is_simulated})
        uniform(marked).to_parquet(out_dir / f"{name}.parquet", index=False)
        columns = table_columns(name, tuple(map(str, marked.columns)), known, asked)
        write_table(marked, columns, out_dir / f"{name}.csv")


def uniform(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose columns of mixed values are text, so that Parquet takes them."""
    columns = {}
    for name in table.columns:
        values = table[name]
        if values.dtype == object and len({type(v) for v in values if v is not None}) > 1:
            values = pd.Series(
                [None if v is None or v != v else str(v) for v in values], index=table.index
            )
        columns[name] = values
    return pd.DataFrame(columns, index=table.index)


def similarity_rows(analysis: CrowdAnalysis) -> pd.DataFrame:
    """Return one row per group, variant and pair of blocks with every similarity."""
    rows = []
    for group in (analysis.main, analysis.control):
        if group is None:
            continue
        for found in group.paths.pairs:
            within = group.paths.within[found.variant]
            row: dict[str, Any] = {
                "group": group.group,
                "variant": found.variant,
                "first": found.pair[0],
                "second": found.pair[1],
                "between_blocks": found.mean,
                "between_blocks_sd": found.sd,
                "within_block_halves": float(within.mean()) if within.size else None,
                "within_block_halves_sd": float(within.std(ddof=1)) if within.size > 1 else None,
            }
            if found.fair is not None:
                row |= {
                    "matched_between": found.fair.between,
                    "matched_within": found.fair.within,
                    "matched_difference": found.fair.difference,
                    "permutation_p": found.fair.p,
                    "n_people": found.fair.n_people,
                    "n_splits": found.fair.n_splits,
                    "n_permutations": found.fair.n_permutations,
                }
            for configuration, value in zip(
                group.paths.configurations, found.by_configuration, strict=True
            ):
                row[f"between_{configuration}"] = float(value)
            rows.append(row)
    return pd.DataFrame(rows)
