"""Write the results of a study: tables, dictionaries, figures, report."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, Final

import pandas as pd

from visavis.analysis.own_streams import OwnStream, figures_of_streams, streams_section
from visavis.analysis.plots import ReportFigure, write_figure
from visavis.analysis.report import Picture, ReportProvenance, Section
from visavis.lab.errors import UsageError
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.questionnaires import Questionnaire
from visavis.results.analysis import SIMULATED_COLUMN, StudyAnalysis
from visavis.results.choices import choice_section
from visavis.results.claims import (
    answer_claim,
    claimed_finding_term,
    published_agreement,
    published_effect_in_interval,
)
from visavis.results.coding import AGREEMENT, ANNOTATIONS, CODING_COLUMNS, agreement_of_coders
from visavis.results.confusion import confusion_section
from visavis.results.detection_table import detection_table
from visavis.results.family_tests import columns_of_tests, published_cells
from visavis.results.figures.family_figures import family_figures
from visavis.results.figures.gaze_order_figures import gaze_order_figures
from visavis.results.figures.study_figures import figure_of_quality, study_figures
from visavis.results.figures.time_course_figure import time_course_figure
from visavis.results.findings import Finding
from visavis.results.gaze_order import (
    FIXATION_COLUMNS,
    FIXATIONS,
    MOVE_COLUMNS,
    MOVES,
    shown_trials,
)
from visavis.results.intake import questionnaire
from visavis.results.locked_plan.review import PlanReview, review_section
from visavis.results.planned_tests import effect_name
from visavis.results.psychometric_section import psychometric_section
from visavis.results.quality import QUALITY_TABLE, Quality, quality_of
from visavis.results.report.references import bibtex, references_of, ris
from visavis.results.report.study_report import REPORT_NAME, build_report, picture_of
from visavis.results.sensitivity import sensitivity_columns
from visavis.results.several_sessions import later_columns
from visavis.results.tables.column_types import with_column_types
from visavis.results.tables.dictionary import (
    PEOPLE,
    STATISTICS,
    block_columns,
    fixed_columns,
    people_columns,
    trial_columns,
    write_table,
)
from visavis.results.time_course import TIME_COURSE, TIME_COURSE_COLUMNS
from visavis.results.unusual import MAX_LISTED, VIEWS, shown_table, unusual_trials
from visavis.study.experiment import StudyExperiment
from visavis.study.measures import count_column
from visavis.study.sections import Confusion, Extra, SectionOf, TrialToSee, import_object

OWN_COLUMNS: Final[Mapping[str, Sequence[Column]]] = {
    TIME_COURSE: TIME_COURSE_COLUMNS,
    FIXATIONS: FIXATION_COLUMNS,
    MOVES: MOVE_COLUMNS,
    ANNOTATIONS: CODING_COLUMNS,
}
"""Columns of tables that any study may have."""


def write_study(
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
    questionnaires: Sequence[Questionnaire],
    provenance: ReportProvenance,
    out_dir: Path,
    facts: Mapping[str, str] | None = None,
    plan: PlanReview | None = None,
    streams: Sequence[OwnStream] = (),
    make_views: Callable[[Path, Sequence[TrialToSee]], None] | None = None,
) -> Path:
    """Write tables, figures and the report; return the report's path.

    `facts` are the recordings' answers to the reporting list for eye tracking, `plan` is the
    review of a locked plan, `streams` are the recordings of the lab's own devices. `make_views`
    makes the pages of trials in the report's folder.

    Raises:
        UsageError: the folder cannot be written to.
        DataError: a column of a table is not described.
    """
    extras = [_section(of, analysis, experiment) for of in experiment.study.report.sections]
    extras += [choice_section(analysis, experiment), psychometric_section(analysis, experiment)]
    extras.append(detection_table(analysis))
    quality = quality_of(analysis, facts) if experiment.study.devices.validate else None
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        write_tables(analysis, experiment, questionnaires, out_dir, extras, quality)
        of_sections = [trial for extra in extras for trial in extra.trials]
        if make_views is not None:
            striking = unusual_trials(analysis)[:MAX_LISTED]
            make_views(out_dir, [*striking, *shown_trials(analysis), *of_sections])
        sections = [
            _with_trials(extra.section, extra.trials, provenance.folder, out_dir / VIEWS)
            for extra in extras
            if extra.section is not None
        ]
        own = {d.name: d for extra in extras for d in extra.figures}
        del extras
        pictures: dict[str, Picture] = {}
        # A figure holds data of every participant: free the memory of each once it is written.
        for figure in _figures(analysis, experiment, own, quality):
            write_figure(figure, out_dir / "figures")
            pictures[figure.name] = picture_of(figure)
            figure.figure.clear()  # without it they stay: its artists refer to each other
        stream_pictures = []
        for figure in figures_of_streams(streams):
            write_figure(figure, out_dir / "figures")  # all participants' figures
            if figure.name.endswith(f"_{streams[0].participant}"):
                stream_pictures.append(picture_of(figure))
            figure.figure.clear()
    except OSError as error:
        raise UsageError(
            f"the analysis cannot be written to {out_dir}: {error.strerror or error}; choose a "
            "folder you may write to"
        ) from error
    sections += [streams_section(streams, stream_pictures)] if streams else []
    sections += [] if plan is None else [review_section(plan)]
    references = references_of(analysis, with_gaze=quality is not None)
    (out_dir / "references.bib").write_text(bibtex(references), encoding="utf-8")
    (out_dir / "references.ris").write_text(ris(references), encoding="utf-8")
    path = out_dir / REPORT_NAME
    return build_report(
        analysis, experiment, provenance, pictures, path, questionnaires, sections, quality
    )


def _with_trials(
    section: Section, trials: Sequence[TrialToSee], folder: str, views: Path
) -> Section:
    """Return a section with the trials that its figures show below them."""
    if not trials:
        return section
    table = shown_table(trials, "Why", folder, views, "Trials that are shown")
    return replace(section, blocks=(*section.blocks, table))


def _section(
    of: SectionOf | Confusion | str, analysis: StudyAnalysis, experiment: StudyExperiment
) -> Extra:
    """Make a section that a study declares; one named "module:function" is imported now."""
    if isinstance(of, Confusion):
        return confusion_section(of, analysis, experiment)
    make: SectionOf = import_object(of) if isinstance(of, str) else of
    return make(analysis, experiment)


def _figures(
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
    own: dict[str, ReportFigure],
    quality: Quality | None,
) -> Iterator[ReportFigure]:
    """Yield every figure once; those of the study's sections replace others of the same name.

    `own` are the figures of the sections by name; each is removed from it when it is yielded.
    """
    texts = experiment.texts
    for figure in chain(study_figures(analysis, texts), family_figures(analysis, texts)):
        if figure.name not in own:
            yield figure
    while own:
        yield own.pop(next(iter(own)))
    course = time_course_figure(analysis, texts)
    if course is not None:
        yield course
    yield from gaze_order_figures(analysis, texts)
    if quality is not None:
        yield figure_of_quality(analysis, quality)


def write_tables(
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
    questionnaires: Sequence[Questionnaire],
    out_dir: Path,
    extras: Sequence[Extra] = (),
    quality: Quality | None = None,
) -> None:
    """Write trials, participants, cell means, statistics and contrasts, each with a dictionary.

    Further tables of the study, and the trials, are written as Parquet, too. Every table says how
    trials were measured where that can be set.
    """
    study = experiment.study
    pieces = study.analysis.measured_in_pieces
    marks = {SIMULATED_COLUMN: analysis.is_simulated}
    marks |= {} if pieces is None or analysis.how is None else pieces.marks(analysis.how)
    # Trials: types are fixed, so that tables of several studies can be concatenated.
    trials = analysis.selection.rows.assign(**marks)
    dictionary = trial_columns(experiment, analysis.measures)
    trials = with_column_types(trials, {c.name: c for c in fixed_columns(experiment)})
    write_table(trials, dictionary, out_dir / "trials.csv", scenes=True)
    trials.to_parquet(out_dir / "trials.parquet", index=False)
    # Participants: the selection's facts first, then answers, then quality, no column twice.
    people = analysis.selection.people
    rest = [c for c in analysis.people if c == "participant" or c not in people]
    people = people.merge(analysis.people[rest], on="participant", how="left")
    if quality is not None:
        twice = [c for c in quality.participants if c in people and c != "participant"]
        quality_rows = quality.participants.drop(columns=twice)
        people = people.merge(quality_rows, on="participant", how="left")
    people = people.assign(**marks)
    answers = people_columns(questionnaires)
    described_people = {
        **dictionary,
        **answers,
        **later_columns(answers, study.design.sessions),
    }
    described_people |= {c.name: c for c in QUALITY_TABLE}
    write_table(people, described_people, out_dir / "participants.csv")
    means = analysis.cell_means().assign(**marks)
    count = count_column(analysis.cells)
    means_dictionary = {**dictionary, count: Column(count, "1", "trials that count")}
    write_table(means, means_dictionary, out_dir / "cell_means.csv")
    for extra in extras:
        for name, table in extra.tables.items():
            columns = {**dictionary, **{c.name: c for c in extra.columns}}
            write_table(table.assign(**marks), columns, out_dir / f"{name}.csv")
    block_questionnaires = [questionnaire(name, study.folders) for name in study.asks.after_block]
    for name, table in analysis.tables.items():
        columns = (
            {**dictionary, **block_columns(block_questionnaires)}
            if name == "blocks"
            else dictionary
        )
        own = () if pieces is None else pieces.tables.get(name, ())
        own = OWN_COLUMNS.get(name, own)
        columns = {**columns, **{c.name: c for c in own}}
        write_table(table.assign(**marks), columns, out_dir / f"{name}.csv")
        table.assign(**marks).to_parquet(out_dir / f"{name}.parquet", index=False)
    spans = analysis.tables.get(ANNOTATIONS)
    if spans is not None and spans["coder"].nunique() > 1:
        table = agreement_of_coders(spans, analysis.selection.rows).assign(**marks)
        columns = {**dictionary, **{c.name: c for c in CODING_COLUMNS}}
        write_table(table, columns, out_dir / f"{AGREEMENT}.csv")
    test_dictionary = {c.name: c for c in (*PEOPLE, *STATISTICS)}
    test_dictionary |= {name: dictionary[name] for name in marks}
    test_dictionary |= (
        columns_of_tests(analysis.study.analysis.families) if analysis.results else {}
    )
    for name, rows in (
        ("statistics", statistics_rows(analysis)),
        ("contrasts", contrast_rows(analysis)),
    ):
        if rows:
            table = pd.DataFrame(rows).assign(**marks)
            write_table(table, test_dictionary, out_dir / f"{name}.csv")
    if analysis.sensitivity:
        table = pd.DataFrame([row.row() for row in analysis.sensitivity]).assign(**marks)
        of = analysis.sensitivity[0].first_tests[0].of
        columns = sensitivity_columns(of, {m.column: m for m in analysis.measures})
        write_table(table, dictionary | columns, out_dir / "sensitivity.csv")


def statistics_rows(analysis: StudyAnalysis) -> list[dict[str, Any]]:
    """Return one row per effect of every comparison, then per test of every family.

    Last comes the first family repeated without exclusions. Rows without a test say why.
    """
    rows: list[dict[str, Any]] = []
    every, primary = [f.compare for f in analysis.findings], set(analysis.primary)
    for finding in analysis.findings:
        compare = finding.compare
        about: dict[str, Any] = {
            "comparison": compare.name,
            "claim": compare.claim,
            "expects": compare.expects,
            "measure": compare.dv,
            "family": compare.family,
            "family_correction": compare.correction,
            "is_exploratory": compare.exploratory,
            "is_tested": bool(finding.terms),
            "why_not": finding.why_not,
            "alpha": compare.alpha,
            "sentence": "" if finding.outcome is None else " ".join(finding.outcome.sentences),
        }
        claimed = claimed_finding_term(finding)
        if not finding.terms:
            rows.append(about | _claim_cells(finding))
        for term in finding.terms:
            verdict: dict[str, Any] = {
                "term": term.name,
                "is_primary": not compare.exploratory
                and effect_name(compare, term.name, every) in primary,
                "p_family": term.p_corrected,
                "is_significant": term.is_significant,
                "is_one_sided": term.is_one_sided,
                **(_claim_cells(finding) if term is claimed else {}),
            }
            printed_result = compare.published_of(term.name)
            beside = published_agreement(finding, term)
            if printed_result is not None and beside is not None:
                verdict |= {
                    "published": str(printed_result),
                    "published_statistic": printed_result.statistic,
                    "published_significant": printed_result.is_significant,
                    "published_order": printed_result.order,
                    "agrees_with_published": beside.agrees,
                    "published_effect_in_interval": published_effect_in_interval(finding, term),
                }
            rows.append({**about, **_plain(term.row), **verdict})
    rows += [
        test.row() | published_cells(test) for results in analysis.results for test in results.tests
    ]
    return rows + [test.row() for test in analysis.without_rules]


def _claim_cells(finding: Finding) -> dict[str, Any]:
    """Return what became of a comparison's claim; nothing without one."""
    if not finding.compare.has_claim:
        return {}
    answer = answer_claim(finding)
    cells: dict[str, Any] = {"claim_verdict": answer.status}
    if len(answer.differences) == 1:
        (difference,) = answer.differences
        interval = difference.interval
        cells |= {
            "claim_difference": difference.value,
            "claim_difference_ci_low": None if interval is None else interval.low,
            "claim_difference_ci_high": None if interval is None else interval.high,
        }
    return cells


def contrast_rows(analysis: StudyAnalysis) -> list[dict[str, Any]]:
    """Return one row per contrast of every comparison."""
    return [
        {
            "comparison": finding.compare.name,
            "measure": finding.compare.dv,
            **{("term" if k == "family" else k): v for k, v in _plain(row).items()},
            **_verdict_cells(finding, row),
        }
        for finding in analysis.findings
        if finding.outcome is not None
        for row in finding.outcome.contrasts
    ]


def _verdict_cells(finding: Finding, row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the verdict on a contrast of two levels, with the source's where there is one."""
    contrast = next((c for c in finding.contrasts if c.row is row), None)
    if contrast is None:
        return {}
    cells: dict[str, Any] = {
        "level_1": contrast.first,
        "level_2": contrast.second,
        "mean_difference": contrast.difference,
        "is_significant": contrast.is_significant,
        "sentence": contrast.sentence,
    }
    beside = contrast.agreement
    if beside is not None:
        cells |= {
            "published_significant": beside.published_significant,
            "agrees_with_published": beside.agrees,
        }
    return cells


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    return {str(k): v for k, v in row.items()}
