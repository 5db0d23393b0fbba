"""The report of a stare study: one HTML file a lab can read at a glance and check in depth."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from analysis.plots import Drawn, svg_for_page
from analysis.report import (
    Block,
    Bullets,
    Cell,
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
from analysis.report.notation import counted, decimal
from experiments.stare import published
from experiments.stare import report_tables as tables
from experiments.stare.analysis import StareAnalysis
from experiments.stare.design import DEFAULT_PARAMETERS, StareParameters
from experiments.stare.figures import TrialExample, study_figures
from experiments.stare.methods_text import (
    REFERENCES,
    differences_from_source,
    method_paragraphs,
    study_of,
)
from visavis.looks import DEFAULT_MEASURE_PARAMETERS, MeasureParameters
from visavis.pairs import same_verdicts
from visavis.quality import Quality, quality_table
from visavis.report import provenance_section
from visavis.reporting_list import Kept, reporting_table

TITLE = "Stare in the crowd"


def build_report(
    analysis: StareAnalysis,
    quality: Quality,
    provenance: ReportProvenance,
    out_path: Path,
    *,
    example: TrialExample | None = None,
    measures: MeasureParameters = DEFAULT_MEASURE_PARAMETERS,
    figures: Mapping[str, Drawn] | None = None,
    study_parameters: Mapping[str, Any] | None = None,
) -> Path:
    """Write the report and return its path.

    The same input gives the same bytes. `figures` takes those already drawn for this analysis,
    `study_parameters` those of the performed plan (the source's for what it does not name).
    """
    drawn = figures if figures is not None else study_figures(analysis, quality, example)
    pictures = {
        name: Picture(svg_for_page(d), d.title, d.caption, d.alternative)
        for name, d in drawn.items()
    }
    study = study_of(study_parameters)
    page = report_page(analysis, quality, provenance, pictures, measures, study)
    return write_page(page, out_path)


def report_page(
    analysis: StareAnalysis,
    quality: Quality,
    provenance: ReportProvenance,
    pictures: Mapping[str, Picture],
    measures: MeasureParameters = DEFAULT_MEASURE_PARAMETERS,
    study: StareParameters = DEFAULT_PARAMETERS,
) -> Page:
    """Return the report as a page."""
    flow = analysis.selection.flow
    kind = "simulated" if analysis.is_simulated else "real"
    sections = (
        _summary(analysis, pictures),
        _gaze(analysis, pictures),
        _positions(analysis, pictures),
        _anxiety(analysis, pictures),
        _robustness(analysis),
        _quality(analysis, quality, provenance, pictures, measures),
        _exclusions(analysis, quality, pictures),
        _methods(analysis, measures, study),
        provenance_section(provenance),
    )
    return Page(
        title=TITLE,
        subtitle="Do people look more at an agent in a virtual crowd who looks at them?",
        facts=Facts(
            (
                ("Participants analysed", f"{flow.participants_in} of {flow.participants}"),
                ("Trials analysed", f"{flow.analysed} of {flow.complete} finished"),
                ("Data", kind),
                ("Recorded", provenance.data_date or "unknown"),
                ("Study version", provenance.study_version),
                ("Visavis", provenance.versions.get("visavis", "unknown")),
            )
        ),
        is_simulated=analysis.is_simulated,
        sections=sections,
        footer=f"Published values: {published.CITATION}",
    )


def _summary(analysis: StareAnalysis, pictures: Mapping[str, Picture]) -> Section:
    agreements = analysis.agreements
    verdicts = tuple(
        Verdict(c.status, c.headline, " ".join(c.evidence)) for c in analysis.conclusions
    )
    rows = tuple(
        (label, str(agreements[key]), source)
        for key, label, source in (
            ("conditions", "Five comparisons × six measures", "tables 3.1, 3.2, A.1 to A.3"),
            ("places", "Nine places × two measures", "table A.4"),
            ("zones", "Three zones × five comparisons", "table A.5"),
            ("anxiety", "Correlations with social anxiety", "section 3.3.2"),
        )
    )
    agreement = Table(
        (Column("Family of tests"), Column("Verdicts that agree", "right"), Column("Published in")),
        rows,
        "Agreement with the published study",
        "Verdicts agree when both are not significant, or both are, in the same direction. "
        "Undecided: not tested, or so few participants that the test cannot reach its threshold.",
    )
    blocks: list[Block] = [Verdicts(verdicts), pictures["effect"]]
    if analysis.n_participants < published.PARTICIPANTS:
        blocks.append(
            Paragraph(
                f"With {counted(analysis.n_participants, 'participant')} instead of the source's "
                f"{published.PARTICIPANTS}, verdicts that differ mainly reflect lower statistical "
                "power; compare means and effect sizes first."
            )
        )
    return Section("summary", "Result", (*blocks, agreement))


def _gaze(analysis: StareAnalysis, pictures: Mapping[str, Picture]) -> Section:
    sentences = tuple(c.sentence() for c in analysis.comparisons)
    blocks: list[Block] = [tables.means_table(analysis), pictures["conditions"]]
    blocks += [tables.comparison_table(analysis, pair) for pair in published.COMPARISONS]
    blocks += [
        pictures["differences"],
        Fold(f"All {len(sentences)} conclusions in words", (Bullets(sentences),)),
    ]
    if "trial" in pictures:
        blocks.append(pictures["trial"])
    return Section("gaze", "Gaze behaviour", tuple(blocks))


def _positions(analysis: StareAnalysis, pictures: Mapping[str, Picture]) -> Section:
    sentences = tuple(c.sentence() for c in (*analysis.places, *analysis.zones))
    return Section(
        "places",
        "Places",
        (
            pictures["places"],
            tables.places_table(analysis),
            tables.zones_table(analysis),
            Fold(f"All {len(sentences)} conclusions in words", (Bullets(sentences),)),
        ),
    )


def _anxiety(analysis: StareAnalysis, pictures: Mapping[str, Picture]) -> Section:
    sentences = tuple(c.sentence() for c in analysis.anxiety)
    return Section(
        "anxiety",
        "Social anxiety",
        (
            pictures["anxiety"],
            tables.anxiety_table(analysis),
            Fold(f"All {len(sentences)} conclusions in words", (Bullets(sentences),)),
        ),
    )


def _robustness(analysis: StareAnalysis) -> Section:
    same = same_verdicts(analysis.without_rules, analysis.comparisons)
    blocks: list[Block] = [
        Paragraph(
            f"Without any exclusion ({counted(analysis.selection.flow.complete, 'trial')} of "
            f"{counted(analysis.selection.flow.participants, 'participant')}), {same} of "
            f"{len(analysis.comparisons)} verdicts are the same as in the main analysis."
        )
    ]
    if analysis.sensitivity:
        blocks.append(tables.sensitivity_table(analysis))
    else:
        blocks.append(Paragraph("Other paddings and minimum durations were not computed."))
    if analysis.second_view:
        blocks.append(tables.second_view_table(analysis.second_view))
    return Section("robustness", "Robustness", tuple(blocks))


def _quality(
    analysis: StareAnalysis,
    quality: Quality,
    provenance: ReportProvenance,
    pictures: Mapping[str, Picture],
    measures: MeasureParameters,
) -> Section:
    return Section(
        "quality",
        "Data quality",
        (
            pictures["quality"],
            reporting_table(kept_of(analysis), quality, provenance, measures),
            Fold("Every participant", (quality_table(quality),)),
        ),
    )


def kept_of(analysis: StareAnalysis) -> Kept:
    """Return what was excluded, for the reporting list."""
    flow, limits = analysis.selection.flow, analysis.parameters
    return Kept(
        flow.participants,
        flow.participants_out,
        flow.complete,
        flow.lost + flow.with_participants,
        f"{100 * limits.max_trial_lost_01:.0f} % loss per trial; "
        f"{100 * limits.max_bad_trials_01:.0f} % of trials; "
        f"{decimal(limits.max_error_deg, 1)}° mean error",
    )


def _exclusions(
    analysis: StareAnalysis, quality: Quality, pictures: Mapping[str, Picture]
) -> Section:
    selection = analysis.selection
    blocks: list[Block] = [pictures["flow"]]
    out = tuple((e.participant, e.trial_id or "all trials", e.reason) for e in selection.excluded)
    blocks.append(
        _fold_if_long("Excluded", ("Participant", "Trial", "Reason"), out)
        if out
        else Paragraph("Nothing was excluded.")
    )
    if selection.uncalibrated:
        blocks.append(
            Paragraph(
                "No validation is known for "
                f"{', '.join(selection.uncalibrated)}; the rule on calibration error could not "
                "be applied there."
            )
        )
    blocks.append(
        _fold_if_long(
            "Interruptions and deviations", ("Participant", "What", "Why"), quality.incidents
        )
        if quality.incidents
        else Paragraph("No interruption, skipped trial or flag was recorded.")
    )
    return Section("exclusions", "Exclusions and deviations", tuple(blocks))


def _fold_if_long(
    caption: str, headers: tuple[str, ...], rows: tuple[tuple[str, ...], ...]
) -> Block:
    cells: tuple[tuple[Cell | str, ...], ...] = rows
    table = Table(tuple(Column(h) for h in headers), cells, caption)
    return table if len(rows) <= 15 else Fold(f"{caption}: {len(rows)} rows", (table,))


def _methods(
    analysis: StareAnalysis, measures: MeasureParameters, study: StareParameters
) -> Section:
    paragraphs = method_paragraphs(analysis.parameters, measures, study, analysis.changes)
    differences = differences_from_source(study, measures, analysis.changes)
    slips = tuple(f"{slip.where}: {slip.what}." for slip in published.INCONSISTENCIES)
    return Section(
        "methods",
        "Methods",
        (
            *(Paragraph(p) for p in paragraphs),
            Paragraph("Differences from the source:"),
            Bullets(differences),
            Fold("What does not fit in the published numbers", (Bullets(slips),)),
            Fold("References", (Bullets(REFERENCES),)),
        ),
    )
