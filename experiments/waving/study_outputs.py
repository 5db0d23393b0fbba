"""Write what an analyst takes away of a waving study: tables, figures, report."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.plots import write_figure
from analysis.report import ReportProvenance
from experiments.waving.analysis import SIMULATED_COLUMN, WavingAnalysis, analyse_rows
from experiments.waving.data_dictionary import write_dictionary
from experiments.waving.design import TECHNIQUES, WavingParameters
from experiments.waving.figures import study_figures
from experiments.waving.intake import SessionIntake
from experiments.waving.measures import PLACES, eye_heights
from experiments.waving.report import build_report
from lab.errors import UsageError
from recording.csv_file import tell_neutralised, write_csv

REPORT_NAME = "report.html"


def analyse_study(
    sessions: Sequence[SessionIntake],
    out_dir: Path,
    *,
    is_simulated: bool,
    provenance: ReportProvenance,
) -> Path:
    """Analyse a study; write tables, figures and the report, and return the report's path."""
    trials = pd.concat([s.rows for s in sessions], ignore_index=True)
    people = pd.DataFrame([dict(s.person) for s in sessions]).merge(
        eye_heights(trials), on="participant", how="left"
    )
    kinds = trials[SIMULATED_COLUMN].astype(bool)
    analysis = analyse_rows(
        trials, is_simulated=is_simulated, allow_mixture=is_simulated and not kinds.all()
    )
    drawn = study_figures(analysis)
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        write_tables(analysis, people, out_dir)
        for figure in drawn.values():
            write_figure(figure, out_dir / "figures")
    except OSError as error:
        raise UsageError(
            f"the analysis cannot be written to {out_dir}: {error.strerror or error}; choose a "
            "folder you may write to"
        ) from error
    params = parameters_of(sessions[0].manifest.plan)
    return build_report(analysis, people, provenance, drawn, out_dir / REPORT_NAME, params)


def parameters_of(plan: Mapping[str, Any]) -> WavingParameters:
    """Return the parameters a session was planned with."""
    known = {f.name for f in fields(WavingParameters)}
    given = plan.get("parameters", {})
    return WavingParameters(**{k: v for k, v in given.items() if k in known})


def write_tables(analysis: WavingAnalysis, people: pd.DataFrame, out_dir: Path) -> None:
    """Write trials, participants, cell means, confusions and statistics, each with a dictionary."""
    tables = {
        "trials": analysis.trials,
        "participants": people,
        "cell_means": analysis.means,
        "confusion": _confusions(analysis),
        "statistics": pd.DataFrame(list(analysis.statistics_rows())),
    }
    for name, table in tables.items():
        marked = table.assign(**{SIMULATED_COLUMN: analysis.is_simulated})
        touched = write_csv(marked, out_dir / f"{name}.csv")
        write_dictionary(name, map(str, marked.columns), out_dir / f"{name}.json")
        tell_neutralised(out_dir / f"{name}.json", touched)
    analysis.trials.to_parquet(out_dir / "trials.parquet", index=False)


def _confusions(analysis: WavingAnalysis) -> pd.DataFrame:
    rows: list[dict[str, str | int]] = []
    for technique in TECHNIQUES:
        for place, counts in zip(PLACES, analysis.confusion(technique), strict=True):
            row: dict[str, str | int] = {"technique": technique, "target_place": place}
            rows.append(row | {p: int(c) for p, c in zip(PLACES, counts, strict=True)})
    return pd.DataFrame(rows)
