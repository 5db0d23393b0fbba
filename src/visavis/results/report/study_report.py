"""The report of any study: one HTML file, made from its analysis."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from visavis.analysis.plots import ReportFigure, svg_for_page
from visavis.analysis.plots.panels import Values
from visavis.analysis.report import (
    Block,
    Bullets,
    Cell,
    Code,
    Column,
    Facts,
    Fold,
    Page,
    Paragraph,
    Picture,
    ReportProvenance,
    Section,
    Table,
    Verdict,
    Verdicts,
    write_page,
)
from visavis.analysis.report.notation import count_of, mean_sd, percentage
from visavis.protocol.plan.questionnaires import Questionnaire
from visavis.recording.remarks import Remark
from visavis.results.analysis import MIN_PARTICIPANTS, StudyAnalysis
from visavis.results.claims import published_agreement
from visavis.results.fidelity import fidelity_section
from visavis.results.figures.gaze_order_figures import SCAN_PATHS
from visavis.results.figures.study_figures import figure_name
from visavis.results.findings import Contrast, Finding
from visavis.results.gaze_order import MOVES, shown_trials
from visavis.results.quality import LOSS_COLUMNS, Quality, quality_table
from visavis.results.report.family_report import (
    NEITHER,
    NEITHER_NOTE,
    agreement_table,
    family_sections,
    family_verdicts,
    fitted_note,
    verdict_cell,
)
from visavis.results.report.gaze_map_section import gaze_map_section
from visavis.results.report.headlines import lost_by_correction, lower, p_words, verdicts_of
from visavis.results.report.methods import comparison_words, method_paragraphs
from visavis.results.report.opening import opening_of
from visavis.results.report.reporting_list import ExclusionCounts, reporting_table
from visavis.results.report.reworded import with_caveats
from visavis.results.selection import rule_words
from visavis.results.time_course import TIME_COURSE
from visavis.results.unusual import VIEWS, looks_table, shown_table, unusual_trials
from visavis.study.comparisons import trials_of
from visavis.study.experiment import StudyExperiment
from visavis.study.look_measures import LooksOn
from visavis.study.measures import aggregate_cells
from visavis.study.parameters import parameters_in_force
from visavis.study.texts import Texts, label_in_unit, label_of

REPORT_NAME: Final = "report.html"
AGE_DIGITS: Final = 1
SCORE_DIGITS: Final = 1
Pictures = Mapping[str, Picture]


def build_report(
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
    provenance: ReportProvenance,
    pictures: Mapping[str, Picture],
    path: Path,
    questionnaires: Sequence[Questionnaire] = (),
    sections: Sequence[Section] = (),
    quality: Quality | None = None,
) -> Path:
    """Write the report and return its path; the same input gives the same bytes.

    `pictures` are the figures by name.
    """
    quality_sections = (
        [] if quality is None else [_quality(analysis, experiment, quality, provenance, pictures)]
    )
    study, source = analysis.study, analysis.study.report.source
    summary, at_the_top = _summary(analysis, experiment, pictures)
    further = {name: picture for name, picture in pictures.items() if name != at_the_top}
    page = Page(
        title=study.title,
        subtitle=study.question,
        facts=Facts(
            (
                (
                    "Participants analysed",
                    f"{analysis.n_participants} of {len(analysis.selection.people)}"
                    f"{_by_group(analysis)}",
                ),
                ("Trials analysed", str(len(analysis.selection.counted))),
                *([("Measured by", analysis.measured_by)] if analysis.measured_by else []),
                ("Data", "simulated" if analysis.is_simulated else "real"),
                ("Recorded", provenance.data_date or "unknown"),
                ("Study version", provenance.study_version),
                ("Visavis", provenance.versions.get("visavis", "unknown")),
            )
        ),
        is_simulated=analysis.is_simulated,
        sections=with_caveats(
            (
                summary,
                *_measures(analysis, experiment, further),
                *family_sections(analysis, pictures),
                *_over_time(pictures),
                *_in_order(analysis, pictures, provenance.folder, path.parent),
                *gaze_map_section(
                    analysis,
                    provenance.folder,
                    path.parent / "figures",
                    has_gaze=quality is not None,
                ),
                *sections,
                *fidelity_section(analysis, experiment),
                *quality_sections,
                _people(analysis, experiment, questionnaires, pictures, provenance, path.parent),
                _methods(analysis, experiment),
                provenance_section(provenance),
            ),
            analysis,
            questionnaires,
        ),
        footer="" if source is None else f"Published values: {source.citation}",
    )
    return write_page(page, path)


def _by_group(analysis: StudyAnalysis) -> str:
    """Return how many participants of each group count; empty where there are no groups."""
    parts = []
    for factor in (
        f for f in analysis.study.design.factors if f.between and f.name in analysis.levels
    ):
        counts = analysis.selection.counted.groupby(factor.name)["participant"].nunique()
        parts += [f"{counts.get(level, 0)} {level}" for level in analysis.levels[factor.name]]
    return f" ({', '.join(parts)})" if parts else ""


def picture_of(figure: ReportFigure) -> Picture:
    """Return a figure as a block of a report."""
    svg = svg_for_page(figure)
    return Picture(svg, figure.title, figure.caption, figure.alternative, figure.data)


def answers_of(analysis: StudyAnalysis, experiment: StudyExperiment) -> list[Verdict]:
    """Return what the report says first: a verdict on each question of the study."""
    # A study's own conclusions, see `family_verdicts`, replace the verdicts on its comparisons.
    concludes = analysis.study.analysis.conclude_of is not None
    verdicts = [] if concludes else verdicts_of(analysis, experiment)
    every = [*verdicts, *family_verdicts(analysis)]
    return sorted(every, key=lambda verdict: verdict.is_secondary)


def _summary(
    analysis: StudyAnalysis, experiment: StudyExperiment, pictures: Pictures
) -> tuple[Section, str]:
    """Return the first section, and the name of the figure that it shows."""
    verdicts = answers_of(analysis, experiment)
    blocks: list[Block] = []
    at_the_top = ""
    if verdicts:
        opening, at_the_top = opening_of(verdicts[0], analysis, pictures)
        blocks += [opening, Verdicts(tuple(verdicts[1:]))] if verdicts[1:] else [opening]
    else:
        blocks.append(Paragraph("The study plans no comparison; its measures are described below."))
    blocks += [Paragraph(text) for text in _caveats(analysis, experiment, verdicts)]
    beside = _beside_published(analysis, experiment.texts)
    blocks += [] if beside is None else [beside]
    family_agreement = agreement_table(analysis)
    blocks += [] if family_agreement is None else [family_agreement]
    source = analysis.study.report.source
    if source is not None and analysis.n_participants < (source.participants or 0):
        blocks.append(
            Paragraph(
                f"With {count_of(analysis.n_participants, 'participant')} instead of the source's "
                f"{source.participants}, power is lower and verdicts are unsteady: none shows "
                "that there is no effect."
            )
        )
    return Section("summary", "Result", tuple(blocks)), at_the_top


def _overall(contrast: Contrast, finding: Finding) -> str:
    """Return that a pair with a small p shows nothing, as all levels together show nothing."""
    is_small = contrast.p < finding.compare.alpha and not contrast.is_significant
    return " (the test over all levels is not significant)" if is_small else ""


def _caveats(
    analysis: StudyAnalysis, experiment: StudyExperiment, verdicts: Sequence[Verdict]
) -> Iterator[str]:
    """Yield what bounds the headlines: ranks, intervals, and orders that were not varied."""
    yield from _ranks(verdicts)
    if sum(" CI [" in verdict.headline for verdict in verdicts) > 1:
        yield (
            "Intervals of differences are of means, each by itself: they are not widened for the "
            "number of comparisons, as verdicts are where a correction is named."
        )
    design = experiment.study.design_with(experiment.parameters)
    fixed = design.blocked_by if design.block_order == "fixed" else None
    is_compared = any(fixed in finding.compare.within for finding in analysis.findings)
    if fixed is not None and is_compared and len(analysis.levels.get(fixed, ())) > 1:
        name = label_of(experiment.texts, fixed)
        yield (
            f"Everybody had the levels of {name} in the same order, so what differs between them "
            "may also come from practice, tiredness or time: by themselves they do not show that "
            f"{name} is the cause."
        )


def _ranks(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """Yield what secondary headlines are worth, where there are primary ones, too."""
    secondary = sum(v.is_secondary for v in verdicts)
    if 0 < secondary < len(verdicts) and any(v.status != "undecided" for v in verdicts):
        yield (
            f"The study has {count_of(len(verdicts) - secondary, 'primary headline')} and "
            f"{secondary} secondary. What a secondary one finds is exploratory: the more of them "
            "there are, the more are found by chance, and none confirms anything by itself."
        )


def _beside_published(analysis: StudyAnalysis, texts: Texts) -> Table | None:
    source = analysis.study.report.source
    if source is None:
        return None
    rows: list[tuple[Cell | str, ...]] = []
    misfits: list[str] = []
    only = {name: level for name, level in source.only.items() if name in analysis.levels}
    counted_rows = trials_of(analysis.selection.counted, only)
    # Published means are compared by the first factor that has all of their levels.
    for column, cells in source.cells.items():
        measure = analysis.measure(column)
        if column not in counted_rows:
            continue
        for factor, levels in analysis.levels.items():
            if not set(map(str, levels)) >= set(cells):
                continue
            means = aggregate_cells(counted_rows, [measure], [factor])
            for level, (mean, sd) in cells.items():
                ours = means.loc[means[factor].astype(str) == level, column].to_numpy(float)
                here = _mean_sd(ours, measure.digits)
                printed_mean = mean_sd(mean, sd, measure.digits)
                what = f"{measure.axis}, {label_of(texts, level)}"
                rows.append((what, here, printed_mean, _off(ours, mean)))
            break
    # Then verdicts: effects, contrasts, and published effects that could not be tested here.
    for finding in analysis.findings:
        for term in finding.terms:
            printed_result = finding.compare.published_of(term.name)
            if printed_result is None:
                continue
            agree = verdict_cell(published_agreement(finding, term))
            what = f"{finding.measure.words} by {term.name.replace(':', ' × ')}"
            rows.append((what, f"p {p_words(term.p_corrected)}", str(printed_result), agree))
            misfits += printed_result.misfits
        for contrast in finding.contrasts:
            beside = contrast.agreement
            if beside is not None and contrast.published_result is not None:
                rows.append(
                    (
                        f"{finding.measure.words}, {contrast.name}",
                        f"p {p_words(contrast.p)}{_overall(contrast, finding)}",
                        str(contrast.published_result),
                        verdict_cell(beside),
                    )
                )
        if not finding.terms:
            for name, printed_result in finding.compare.published_terms.items():
                what = f"{finding.measure.words} by {name.replace(':', ' × ')}"
                rows.append((what, "–", str(printed_result), Cell("not tested", "weak")))
    if not rows:
        return None
    last = [row[-1] for row in rows]
    is_off = any(isinstance(cell, str) and cell for cell in last)
    is_neither = any(isinstance(cell, Cell) and cell.text == NEITHER for cell in last)
    return Table(
        (Column("What"), Column("Here"), Column("Published"), Column("Off by, or verdicts")),
        tuple(rows),
        "Beside the published study",
        " ".join(
            (
                f"Means (SD over participants). {source.note}".strip(),
                *(["Off by: in percent of the published mean."] if is_off else []),
                *([NEITHER_NOTE] if is_neither else []),
                *(f"{m[:1].upper()}{m[1:]}." for m in misfits),
            )
        )
        + fitted_note(analysis),
    )


def _mean_sd(values: Values, digits: int = 2) -> str:
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return "–"
    sd = float(finite.std(ddof=1)) if finite.size > 1 else None
    return mean_sd(float(finite.mean()), sd, digits)


def _off(ours: Values, published_mean: float) -> str:
    """Return how far a mean lies from the published one, as a signed share of it."""
    finite = ours[np.isfinite(ours)]
    if finite.size == 0 or published_mean == 0:
        return ""
    text = percentage(float(finite.mean()) / published_mean - 1, 0)
    return text if text[:1] in "-−0" else f"+{text}"


def _measures(
    analysis: StudyAnalysis, experiment: StudyExperiment, pictures: Pictures
) -> list[Section]:
    sections = []
    cells = analysis.cell_means()
    for column in dict.fromkeys(f.measure.column for f in analysis.findings):
        findings = [f for f in analysis.findings if f.measure.column == column]
        measure = findings[0].measure
        blocks: list[Block] = []
        for finding in findings:
            picture = pictures.get(figure_name(finding))
            blocks += [] if picture is None else [picture]
            blocks += _tests(finding, experiment.texts)
        values = cells if measure.of_cell is not None else analysis.selection.counted
        if column in values:
            is_known = values[column].notna().any()
            means = _means_table(analysis, cells, column, experiment)
            blocks.append(means if is_known else _nobody_has([measure.words]))
        sections.append(Section(column, measure.words, tuple(blocks)))
    compared_columns = {f.measure.column for f in analysis.findings}
    counted_rows = analysis.selection.counted
    further = [m for m in analysis.measures if m.column in counted_rows]
    further = [m for m in further if m.column not in compared_columns]
    with_values = [m for m in further if counted_rows[m.column].notna().any()]
    others: list[Block] = [_means_table(analysis, cells, m.column, experiment) for m in with_values]
    if unknown := [m.words for m in further if m not in with_values]:
        others.append(_nobody_has(unknown))
    if others:
        title = "Means of further measures" if compared_columns else "Means"
        sections.append(Section("others", title, tuple(others)))
    return sections


def _over_time(pictures: Pictures) -> list[Section]:
    picture = pictures.get(TIME_COURSE)
    return [] if picture is None else [Section("over_time", "Looks over time", (picture,))]


def _in_order(
    analysis: StudyAnalysis, pictures: Pictures, folder: str, out_dir: Path
) -> list[Section]:
    if SCAN_PATHS not in pictures:
        return []
    table = shown_table(
        shown_trials(analysis),
        "Fixations",
        folder,
        out_dir / VIEWS,
        "Trials whose scan paths are shown",
    )
    blocks = (pictures[SCAN_PATHS], table, pictures[MOVES])
    return [Section("in_order", "Looks in their order", blocks)]


def _nobody_has(measures: Sequence[str]) -> Paragraph:
    return Paragraph(f"Nobody has a value: {'; '.join(lower(words) for words in measures)}.")


def _tests(finding: Finding, texts: Texts) -> list[Block]:
    name = comparison_words(finding, texts)
    if finding.outcome is None:
        return [Paragraph(f"{name[:1].upper()}{name[1:]}: not tested, {finding.why_not}.")]
    outcome = finding.outcome
    kind = "Exploratory. " if finding.compare.exploratory else ""
    blocks: list[Block] = [
        Paragraph(f"{kind}{outcome.title} of {name}:"),
        Bullets((*outcome.sentences, *lost_by_correction(finding))),
    ]
    for summary, lines in (
        ("How it was decided", outcome.path),
        ("Contrasts", outcome.contrast_sentences),
        ("Notes", outcome.notes),
    ):
        if lines:
            blocks.append(Fold(f"{summary}: {len(lines)}", (Bullets(tuple(lines)),)))
    return blocks


def _means_table(
    analysis: StudyAnalysis, cells: pd.DataFrame, column: str, experiment: StudyExperiment
) -> Table:
    measure = analysis.measure(column)
    factors = list(analysis.cells)
    rows = []
    for key, group in cells.groupby(factors, sort=False, observed=True):
        levels = key if isinstance(key, tuple) else (key,)
        names = ", ".join(label_of(experiment.texts, str(v)) for v in levels)
        values = group[column].to_numpy(float)
        rows.append((names, _mean_sd(values, measure.digits), str(int(np.isfinite(values).sum()))))
    unit = "" if measure.unit in ("", "1") else f" in {measure.unit}"
    heads = ", ".join(label_in_unit(experiment.texts, f) for f in factors)
    return Table(
        (
            Column(heads[:1].upper() + heads[1:]),
            Column("Mean (SD)", "right"),
            Column("People", "right"),
        ),
        tuple(rows),
        f"{measure.words}{unit}: mean over participants (SD)",
    )


def _quality(
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
    quality: Quality,
    provenance: ReportProvenance,
    pictures: Pictures,
) -> Section:
    looks = analysis.study.analysis.looks
    rules = looks[0].rules({"parameters": experiment.parameters}) if looks else LooksOn().rules({})
    selection, exclusion_counts = analysis.selection, exclusion_counts_of(analysis)
    checklist = reporting_table(
        exclusion_counts,
        quality,
        provenance,
        rules,
        _losses(analysis, experiment.texts),
        counts_stamps="repeated_samples" in selection.rows,
    )
    blocks: list[Block] = [
        pictures["quality"],
        checklist,
        Fold("Every participant", (quality_table(quality),)),
    ]
    heads = tuple(Column(h) for h in ("Participant", "What", "Why"))
    errors = selection.people.get("calibration_error_deg")
    has_error_rule = any(
        r.column == "calibration_error_deg" for r in analysis.study.analysis.exclusions
    )
    if has_error_rule and errors is not None and errors.isna().any():
        unknown = ", ".join(selection.people.loc[errors.isna(), "participant"].astype(str))
        blocks.append(
            Paragraph(
                f"No validation is known for {unknown}; the rule on calibration "
                "error could not be applied there."
            )
        )
    if quality.incidents:
        table = Table(heads, quality.incidents, "Interruptions and deviations")
        blocks.append(Fold(f"Interruptions and deviations: {len(quality.incidents)}", (table,)))
    return Section("quality", "Quality of gaze data", tuple(blocks))


def _losses(analysis: StudyAnalysis, texts: Texts) -> list[tuple[str, str]]:
    """Return every level of the factors compared with the share of gaze lost in its trials."""
    rows = analysis.selection.finished
    loss_column = next((c for c in LOSS_COLUMNS if c in rows), None)
    if loss_column is None:
        return []
    losses = []
    for factor in analysis.cells:
        for level in analysis.levels[factor]:
            share = pd.to_numeric(
                rows.loc[rows[factor] == level, loss_column], errors="coerce"
            ).mean()
            text = "not recorded" if share != share else percentage(float(share))
            losses.append((f"{label_of(texts, factor)} {label_of(texts, str(level))}", text))
    return losses


def exclusion_counts_of(analysis: StudyAnalysis) -> ExclusionCounts:
    """Return the numbers and limits of exclusions, for the reporting list."""
    selection = analysis.selection
    limits = "; ".join(
        rule_words(selection, [rule], rule.name)
        for rule in selection.applied(analysis.study.analysis.exclusions)
    )
    trials = selection.finished
    return ExclusionCounts(
        len(selection.people),
        int((~selection.people["is_analysed"].astype(bool)).sum()),
        len(trials),
        int((~trials["is_analysed"].astype(bool)).sum()),
        limits,
    )


def _people(
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
    questionnaires: Sequence[Questionnaire],
    pictures: Pictures,
    provenance: ReportProvenance,
    out_dir: Path,
) -> Section:
    blocks: list[Block] = [pictures["exclusions"]]
    people = analysis.people
    if "age" in people:
        ages = pd.to_numeric(people["age"], errors="coerce").dropna().to_numpy(float)
        if len(ages):
            blocks.append(Paragraph(f"Age {_mean_sd(ages, AGE_DIGITS)} years."))
    for questionnaire in questionnaires:
        blocks += _answer_blocks(questionnaire, people)
    blocks += [
        Paragraph(_answered_by(analysis, name))
        for name in experiment.responses
        if f"{name}_by" in analysis.selection.counted
    ]
    out = analysis.selection.people
    left_out = out[~out["is_analysed"]]
    if len(left_out):
        rows = tuple(
            (str(p), str(why))
            for p, why in zip(left_out["participant"], left_out["left_out_because"], strict=True)
        )
        blocks.append(Table((Column("Participant"), Column("Why")), rows, "Left out"))
    if analysis.n_participants < MIN_PARTICIPANTS:
        blocks.append(Paragraph(f"Tests need {MIN_PARTICIPANTS} participants."))
    rows_ = analysis.selection.rows
    other = rows_[(rows_["status"] != "complete") & ~rows_["is_practice"].astype(bool)]
    if len(other):
        trial_rows = tuple(
            tuple(map(str, r))
            for r in other[["participant", "trial_id", "status", "reason"]].itertuples(index=False)
        )
        heads = tuple(Column(h) for h in ("Participant", "Trial", "Status", "Reason"))
        blocks.append(
            Fold("Interrupted, repeated and skipped trials", (Table(heads, trial_rows, "Trials"),))
        )
    blocks += _flag_table(analysis.selection.rows)
    blocks += _remark_table(analysis.remarks)
    blocks += _incident_table(provenance)
    looks = looks_table(unusual_trials(analysis), provenance.folder, out_dir / VIEWS)
    blocks += [] if looks is None else [Fold(f"{looks.caption}: {len(looks.rows)}", (looks,))]
    return Section("people", "Participants", tuple(blocks))


def _remark_table(remarks: Sequence[Remark]) -> Iterator[Block]:
    """Yield a table of what the lab noted and excluded by hand after the sessions."""
    if not remarks:
        return
    words = {"note": "note", "exclude": "left out", "include": "taken in again"}
    heads = tuple(map(Column, ("Participant", "About", "What", "Why", "By", "Date")))
    rows = tuple(
        (
            r.participant,
            r.trial_id or (f"session {r.session}" if r.session else "everything"),
            words[r.kind],
            r.text,
            r.author,
            r.at[:10],
        )
        for r in remarks
    )
    note = "Somebody decided these after the session; all other exclusions are rules."
    yield Table(heads, rows, "Notes and exclusions by hand", note=note)


def _flag_table(rows: pd.DataFrame) -> Iterator[Block]:
    """Yield a table of the flags that devices and operators set, with numbers of trials and people.

    Practice trials are not counted, as they are not analysed.
    """
    if "flags" not in rows:
        return
    rows = rows[~rows["is_practice"].astype(bool)]
    flags = rows[["participant", "flags"]].assign(
        flags=rows["flags"].fillna("").astype(str).str.split(";")
    )
    each = flags.explode("flags").query("flags != ''")
    if len(each):
        heads = (Column("Flag"), Column("Trials", "right"), Column("People", "right"))
        counts = each.groupby("flags", sort=True)["participant"].agg(["size", "nunique"])
        table_rows = tuple((str(f), str(n), str(people)) for f, n, people in counts.itertuples())
        note = (
            "A flag ending in _lost: the device was away, or the session went on without it; in "
            "_warning: it warned during the trial, in words that visavis check shows for the "
            "session; picture_stalled: the picture stood still. Flags leave no trial out; "
            "exclusions do. Practice trials are not counted."
        )
        n_flagged = int(rows["flags"].fillna("").ne("").sum())
        yield Fold(
            f"Flagged trials: {n_flagged} of {len(rows)}",
            (Table(heads, table_rows, "Flags", note),),
        )


def _incident_table(provenance: ReportProvenance) -> Iterator[Block]:
    """Yield what happened between trials: pauses with their reasons, sessions that broke off."""
    rows = tuple(
        (source.participant, source.session, one.where, one.what, one.why or "no reason given")
        for source in provenance.sessions
        for one in source.incidents
    )
    if rows:
        heads = ("Participant", "Session", "Where", "What", "Why")
        table = Table(tuple(map(Column, heads)), rows, "Pauses and interruptions of sessions")
        yield Fold(f"{table.caption}: {len(rows)}", (table,))


def _answer_blocks(questionnaire: Questionnaire, people: pd.DataFrame) -> Iterator[Block]:
    """Yield how often each option was chosen, and the answers in free words.

    A questionnaire with scores shows these first; its questions are then folded.
    """
    sentences = []
    for question in questionnaire.questions():
        name = question.question_id
        if name not in people:
            continue
        answers = people[name]
        if question.scale.kind == "text":
            words = tuple(
                f"{who}: {text}"
                for who, text in zip(people["participant"], answers, strict=True)
                if isinstance(text, str) and text
            )
            if words:
                yield Fold(
                    f"{question.prompt} ({count_of(len(words), 'answer')})", (Bullets(words),)
                )
        elif question.scale.options:
            counts = {
                label: int((pd.to_numeric(answers, errors="coerce") == value).sum())
                for value, label in question.scale.options.items()
            }
            counts["no answer"] = len(answers) - sum(counts.values())
            tally = ", ".join(f"{label} {n}" for label, n in counts.items() if n)
            sentences.append(f"{question.prompt} {tally}.")
    if questionnaire.scores:
        yield from _scores(questionnaire, people)
        title = f"{questionnaire.title}: every answer, {count_of(len(sentences), 'question')}"
        yield from [Fold(title, (Bullets(tuple(sentences)),))] if sentences else []
    else:
        yield from map(Paragraph, sentences)


def _scores(questionnaire: Questionnaire, people: pd.DataFrame) -> Iterator[Table]:
    rows = []
    for name in questionnaire.scores:
        column = f"{questionnaire.name}_{name}"
        values = pd.to_numeric(people[column], errors="coerce") if column in people else None
        if values is not None and values.notna().any():
            n = str(int(values.notna().sum()))
            rows.append((name.replace("_", " "), _mean_sd(values.to_numpy(float), SCORE_DIGITS), n))
    if rows:
        heads = (Column("Score"), Column("Mean (SD)", "right"), Column("People", "right"))
        yield Table(heads, tuple(rows), f"{questionnaire.title}: scores")


def _answered_by(analysis: StudyAnalysis, response: str) -> str:
    ways = analysis.selection.counted[f"{response}_by"].value_counts()
    tally = ", ".join(f"by {way} {count_of(count, 'time')}" for way, count in ways.items())
    return f"How {response.replace('_', ' ')} was answered: {tally}."


def _methods(analysis: StudyAnalysis, experiment: StudyExperiment) -> Section:
    blocks: list[Block] = [Paragraph(p) for p in method_paragraphs(analysis, experiment)]
    changes = [
        f"{name} is {experiment.parameters[name]} (the study's own: {usual})."
        for name, usual in _usual(experiment).items()
        if experiment.parameters[name] != usual
    ]
    if changes:
        blocks += [Paragraph("Set otherwise for these sessions:"), Bullets(tuple(changes))]
    if experiment.study.report.references:
        blocks.append(Fold("References", (Bullets(tuple(experiment.study.report.references)),)))
    return Section("methods", "Methods", tuple(blocks))


def _usual(experiment: StudyExperiment) -> dict[str, object]:
    usual = parameters_in_force(experiment.study, {})
    return {k: v for k, v in usual.items() if k in experiment.parameters}


def provenance_section(provenance: ReportProvenance) -> Section:
    """Return the section that says where the numbers come from and how to compute them again."""
    facts = [("Study", f"{provenance.study}, version {provenance.study_version}")]
    if provenance.seed is not None:
        facts.append(("Seed", str(provenance.seed)))
    for label, value in (
        ("Configuration SHA-256", provenance.configuration_sha256),
        ("Plan SHA-256", provenance.plan_sha256),
    ):
        if value:
            facts.append((label, value))
    facts += list(provenance.versions.items())
    blocks: list[Block] = [Facts(tuple(facts))]
    if provenance.commands:
        blocks += [Paragraph("The same report again:"), Code(provenance.commands)]
    rows = tuple(
        (s.participant, s.session, s.started_at, s.status, s.sha256, s.code_revision)
        for s in provenance.sessions
    )
    if rows:
        heads = ("Participant", "Session", "Began", "Status", "SHA-256", "Code")
        table = Table(tuple(Column(h) for h in heads), rows, "Recordings")
        blocks.append(Fold(count_of(len(rows), "recording"), (table,)))
    return Section("provenance", "Provenance", tuple(blocks))
