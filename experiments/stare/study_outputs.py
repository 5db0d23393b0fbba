"""Analyse a study and write what an analyst takes away: tables, figures, report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.plots import Drawn, write_figure
from analysis.report import ReportProvenance
from experiments.stare.analysis import SIMULATED_COLUMN, StareAnalysis, analyse_rows
from experiments.stare.analysis_parameters import DEFAULT_PARAMETERS, AnalysisParameters
from experiments.stare.comparisons import ALL_MEASURES, CONDITION_TESTS, FAMILIES, LEVELS
from experiments.stare.figures import TrialExample, study_figures
from experiments.stare.report import build_report
from experiments.stare.scene import distances
from experiments.stare.study import experiment_of, study
from experiments.stare.terms import MEASURES
from lab.errors import UsageError
from protocol.columns import Column
from protocol.questionnaires import load_questionnaire
from visavis.dictionary import people_columns, trial_columns, write_table
from visavis.looks import DEFAULT_MEASURE_PARAMETERS, MeasureParameters
from visavis.pairs import columns_of_tests
from visavis.quality import QUALITY_TABLE, Quality, quality_of_trials
from visavis.sensitivity import sensitivity_columns
from visavis.table_types import typed

REPORT_NAME = "report.html"


@dataclass(frozen=True)
class StudyOutputs:
    """What was written; `report` is the HTML file, `tables` and `figures` the rest."""

    analysis: StareAnalysis
    report: Path
    tables: tuple[Path, ...]
    figures: tuple[Path, ...]


def analyse_study(
    trials: pd.DataFrame,
    answers: pd.DataFrame,
    out_dir: Path,
    *,
    is_simulated: bool,
    provenance: ReportProvenance,
    parameters: AnalysisParameters = DEFAULT_PARAMETERS,
    measures: MeasureParameters = DEFAULT_MEASURE_PARAMETERS,
    sensitivity_rows: pd.DataFrame | None = None,
    example: TrialExample | None = None,
    facts: Mapping[str, str] | None = None,
    study_parameters: Mapping[str, Any] | None = None,
    levels: Mapping[str, Sequence[str]] = LEVELS,
    allow_mixture: bool = False,
) -> StudyOutputs:
    """Analyse a study and write trials, participants, statistics, figures and the report.

    Tables as `analyse_rows` takes them. `facts` answers items of the eye-tracking reporting list
    (keys of `reporting_list.SETUP_ITEMS`); `study_parameters` are the performed plan's. Files of
    the same name are replaced; the same input gives the same bytes.
    """
    analysis = analyse_rows(
        trials,
        answers,
        parameters,
        is_simulated=is_simulated,
        sensitivity_rows=sensitivity_rows,
        levels=levels,
        allow_mixture=allow_mixture,
    )
    quality = quality_of_trials(
        trials,
        analysis.selection.complete,
        max_trial_lost_01=parameters.max_trial_lost_01,
        facts={**(facts or {}), "distances": distances()},
        people=answers,
        max_error_deg=parameters.max_error_deg,
    )
    drawn = study_figures(analysis, quality, example)
    try:
        tables = write_tables(analysis, quality, answers, out_dir)
        figures = write_figures(drawn, out_dir / "figures")
    except OSError as error:
        raise UsageError(
            f"the analysis cannot be written to {out_dir}: {error.strerror or error}; choose a "
            "folder you may write to"
        ) from error
    report = build_report(
        analysis,
        quality,
        provenance,
        out_dir / REPORT_NAME,
        measures=measures,
        figures=drawn,
        study_parameters=study_parameters,
    )
    return StudyOutputs(analysis, report, tables, figures)


def write_tables(
    analysis: StareAnalysis, quality: Quality, answers: pd.DataFrame, out_dir: Path
) -> tuple[Path, ...]:
    """Write trials (CSV, Parquet), participants, condition means, statistics, sensitivity.

    Each has a JSON dictionary of its columns beside it.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    simulated = analysis.is_simulated
    trials = _marked(analysis.trials, simulated)
    trials["is_analysed"] = _is_analysed(analysis, trials)
    people = quality.participants
    if "participant" in answers:
        twice = [c for c in answers if c in people and c != "participant"]
        known = answers.drop(columns=twice).assign(participant=answers["participant"].astype(str))
        people = people.merge(known, on="participant", how="outer", sort=True)
    out = {e.participant: e.reason for e in analysis.selection.excluded if e.trial_id is None}
    people = people.assign(excluded=[out.get(str(p), "") for p in people["participant"]])
    named = trial_columns(experiment_of(), MEASURES)
    asked = [load_questionnaire(name) for name in study.questionnaires]
    n_trials = Column("n_trials", "1", "trials averaged; a measure leaves out those without one")
    excluded = Column("excluded", "", "why the participant is not in the statistics; empty: is")
    tables: list[tuple[str, pd.DataFrame, Mapping[str, Column]]] = [
        ("trials", typed(trials, named), named),
        (
            "participants",
            _marked(people, simulated),
            {**people_columns(asked), **{c.name: c for c in (*QUALITY_TABLE, excluded)}},
        ),
        ("condition_means", _marked(analysis.means, simulated), {**named, "n_trials": n_trials}),
        (
            "statistics",
            _marked(pd.DataFrame(list(analysis.statistics_rows())), simulated),
            {**named, **columns_of_tests(FAMILIES)},
        ),
    ]
    if analysis.sensitivity:
        rows = pd.DataFrame([r.row() for r in analysis.sensitivity])
        described = sensitivity_columns(CONDITION_TESTS, ALL_MEASURES)
        tables.append(("sensitivity", _marked(rows, simulated), {**named, **described}))
    written = [
        path
        for name, table, columns in tables
        for path in write_table(table, dict(columns), out_dir / f"{name}.csv")
    ]
    parquet = out_dir / "trials.parquet"
    tables[0][1].to_parquet(parquet, index=False)
    return (*written, parquet)


def write_figures(figures: Mapping[str, Drawn], folder: Path) -> tuple[Path, ...]:
    """Write every figure as SVG and PNG."""
    return tuple(path for drawn in figures.values() for path in write_figure(drawn, folder))


def _is_analysed(analysis: StareAnalysis, trials: pd.DataFrame) -> list[bool]:
    keys = [
        c
        for c in ("participant", "session", "trial_id", "attempt")
        if c in trials and c in analysis.selection.kept
    ]
    kept = {tuple(map(str, k)) for k in analysis.selection.kept[keys].itertuples(index=False)}
    return [tuple(map(str, k)) in kept for k in trials[keys].itertuples(index=False)]


def _marked(table: pd.DataFrame, is_simulated: bool) -> pd.DataFrame:
    return table.assign(**{SIMULATED_COLUMN: is_simulated})
