"""The report of a waving study: one HTML file."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.plots import Drawn, svg_for_page
from analysis.report import (
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
from analysis.report.notation import counted, decimal, fraction, mean_sd, probability
from experiments.waving import published
from experiments.waving.analysis import ALPHA, MeasureAnalysis, WavingAnalysis
from experiments.waving.design import DIRECTIONS, TECHNIQUES, WavingParameters
from experiments.waving.figures import DIRECTION_NAMES, NAMES
from experiments.waving.measures import PLACES, relative_confusion
from experiments.waving.methods_text import REFERENCES, choices, method_paragraphs
from experiments.waving.report_people import people_section

TITLE = "Waving at whom?"
TERM_NAMES = {
    "technique": "Technique",
    "direction": "Direction",
    "technique:direction": "Technique × direction",
}
UNITS = {"response_ms": " in ms", "realism": ", 1 to 9"}
MEASURE_NAMES = {"accuracy": "Accuracy", "realism": "Realism", "response_ms": "Response time"}


def build_report(
    analysis: WavingAnalysis,
    people: pd.DataFrame,
    provenance: ReportProvenance,
    figures: Mapping[str, Drawn],
    out_path: Path,
    params: WavingParameters,
) -> Path:
    """Write the report and return its path; the same input gives the same bytes."""
    pictures = {
        name: Picture(svg_for_page(d), d.title, d.caption, d.alternative)
        for name, d in figures.items()
    }
    everybody = int(analysis.trials["participant"].nunique())
    page = Page(
        title=TITLE,
        subtitle="Is a wave understood better when it is warped to be seen by who is meant?",
        facts=Facts(
            (
                ("Participants analysed", f"{analysis.n_participants} of {everybody}"),
                ("Trials analysed", f"{len(analysis.analysed)}"),
                ("Data", "simulated" if analysis.is_simulated else "real"),
                ("Recorded", provenance.data_date or "unknown"),
                ("Study version", provenance.study_version),
                ("Visavis", provenance.versions.get("visavis", "unknown")),
            )
        ),
        is_simulated=analysis.is_simulated,
        sections=(
            _summary(analysis, pictures),
            *(_measure(analysis, m, pictures) for m in ("accuracy", "realism")),
            _cells(analysis, pictures),
            _places(analysis, pictures),
            people_section(analysis, people),
            _methods(params),
            _provenance(provenance),
        ),
        footer=f"Published values: {published.CITATION}",
    )
    return write_page(page, out_path)


# ---- result ---------------------------------------------------------------------------------


def _verdict(analysis: WavingAnalysis, measure: str, term: str, found: str, none: str) -> Verdict:
    tested = analysis.of(measure)
    significant = tested.is_significant(term)
    printed = published.published_effect(measure, term)
    said = "significant" if printed.is_significant else "not significant"
    if significant is None or tested.anova is None:
        return Verdict("undecided", none, f"Not tested: {tested.why_not}. Published: {said}.")
    effect = next(e for e in tested.anova.effects if e.name == term)
    agrees = "as published" if significant == printed.is_significant else f"published: {said}"
    return Verdict(
        "found" if significant else "not_found",
        found if significant else none,
        f"{effect.sentence()} ({agrees}).",
    )


def _summary(analysis: WavingAnalysis, pictures: Mapping[str, Picture]) -> Section:
    means = analysis.by_technique("accuracy")
    better = max(means, key=lambda t: means[t][0]) if means else "warping"
    verdicts = (
        _verdict(
            analysis, "accuracy", "technique",
            f"Waves are understood better with {NAMES[better]}",
            "No difference in accuracy found between techniques",
        ),
        _verdict(
            analysis, "accuracy", "direction", "Accuracy depends on the direction",
            "No effect of direction on accuracy found",
        ),
        _verdict(
            analysis, "accuracy", "technique:direction",
            "The advantage differs between directions",
            "No difference found between directions in what technique changes",
        ),
        _verdict(
            analysis, "realism", "technique", "The techniques differ in realism",
            "No difference in realism found between techniques",
        ),
    )  # fmt: skip
    blocks: list[Block] = [Verdicts(verdicts), _beside_published(analysis), pictures["accuracy"]]
    if analysis.n_participants < published.PARTICIPANTS:
        blocks.append(
            Paragraph(
                f"With {counted(analysis.n_participants, 'participant')} instead of the source's "
                f"{published.PARTICIPANTS}, power is lower and verdicts are unsteady: none shows "
                "that there is no effect."
            )
        )
    return Section("summary", "Result", tuple(blocks))


def _beside_published(analysis: WavingAnalysis) -> Table:
    rows: list[tuple[Cell | str, ...]] = []
    ours = analysis.by_technique("accuracy")
    for technique in TECHNIQUES:
        mean, sd = published.MEAN_ACCURACY[technique]
        rows.append(
            (f"Accuracy with {NAMES[technique]}", mean_sd(*ours[technique]), mean_sd(mean, sd), "")
        )
    for printed in published.EFFECTS:
        tested = analysis.of(printed.measure)
        effect = None
        if tested.anova is not None:
            effect = next(e for e in tested.anova.effects if e.name == printed.term)
        verdict = tested.is_significant(printed.term)
        agree = Cell("not tested", "weak")
        if verdict is not None:
            same = verdict == printed.is_significant
            agree = Cell("agree" if same else "differ", "agree" if same else "differ")
        rows.append(
            (
                f"{MEASURE_NAMES[printed.measure]}: {TERM_NAMES[printed.term].lower()}",
                "–" if effect is None else _f_text(effect.F, effect.p_used, effect.eta.value,
                                                   effect.df1_used, effect.df2_used),
                _printed_text(printed),
                agree,
            )
        )  # fmt: skip
    notes = "; ".join(_misfits())
    notes = notes[:1].upper() + notes[1:]
    return Table(
        (Column("What"), Column("Here"), Column("Published"), Column("Verdicts")),
        tuple(rows),
        "Beside the published study",
        "Means (SD over participants). Verdicts at "
        f"α = {fraction(ALPHA)}. The published partial η² of .356 for direction does not follow "
        "from its F(2, 30) = 18.92, which implies .558. "
        f"{notes}. Published means per direction are in figures only.",
    )


def _misfits() -> tuple[str, ...]:
    found = []
    for effect in published.EFFECTS:
        check = published.check_effect(effect)
        if check is None:
            continue
        for name, verdict in check.verdicts.items():
            if not verdict.is_consistent and (effect.term, name) != ("direction", "eta2p"):
                label = "p" if name == "p" else "partial η²"
                what = f"{MEASURE_NAMES[effect.measure]}, {TERM_NAMES[effect.term]}".lower()
                found.append(
                    f"{what}: {label} printed "
                    f"{verdict.printed}, {decimal(verdict.computed, 4)} by its F "
                    f"({verdict.remark})"
                )
    return tuple(found)


def _f_text(F: float, p: float, eta: float, df1: float, df2: float) -> str:
    sign = "" if probability(p).startswith(("<", ">")) else "= "
    return f"F({df1:g}, {df2:g}) = {decimal(F)}, p {sign}{probability(p)}, η²p = {fraction(eta)}"


def _printed_text(printed: published.PublishedEffect) -> str:
    if printed.F is None:
        return "not significant (no values)"
    p = printed.p or ""
    sign = "" if p.startswith("<") else "= "
    eta = (printed.eta2p or "").removeprefix("0")
    test = f"F({printed.df1}, {printed.df2}) = {printed.F}"
    return f"{test}, p {sign}{p.replace('0.', '.')}, η²p = {eta}"


# ---- measures -------------------------------------------------------------------------------


def _measure(analysis: WavingAnalysis, measure: str, pictures: Mapping[str, Picture]) -> Section:
    tested = analysis.of(measure)
    blocks: list[Block] = []
    if measure != "accuracy":
        blocks.append(pictures[measure])
    blocks.append(_means_table(analysis, measure))
    blocks += _tests(tested)
    return Section(measure, MEASURE_NAMES[measure], tuple(blocks))


def _means_table(analysis: WavingAnalysis, measure: str) -> Table:
    digits = 0 if measure == "response_ms" else 2
    rows = []
    for technique in TECHNIQUES:
        cells = [mean_sd(*analysis.cell(measure, technique, d), digits) for d in DIRECTIONS]
        rows.append((NAMES[technique].capitalize(), *cells,
                     mean_sd(*analysis.by_technique(measure)[technique], digits)))  # fmt: skip
    by = analysis.by_direction(measure)
    rows.append(("Both", *(mean_sd(*by[d], digits) for d in DIRECTIONS), ""))
    return Table(
        (
            Column("Technique"),
            *(Column(DIRECTION_NAMES[d].capitalize(), "right") for d in DIRECTIONS),
            Column("All directions", "right"),
        ),
        tuple(rows),
        f"{MEASURE_NAMES[measure]}{UNITS.get(measure, '')}: mean (SD over participants)",
    )


def _tests(tested: MeasureAnalysis) -> list[Block]:
    if tested.anova is None:
        return [Paragraph(f"Not tested: {tested.why_not}.")]
    rows = [
        (
            TERM_NAMES[effect.name],
            f"{effect.df1_used:g}, {effect.df2_used:g}",
            decimal(effect.F),
            Cell(probability(effect.p_used), "strong" if effect.p_used < ALPHA else ""),
            fraction(effect.eta.value),
        )
        for effect in tested.anova.effects
    ]
    table = Table(
        (
            Column("Effect"),
            Column("df"),
            Column("F", "right"),
            Column("p", "right"),
            Column("η²p", "right"),
        ),
        tuple(rows),
        "Aligned rank transform ANOVA, two-way, repeated measures",
        "; ".join(tested.anova.provenance.notes),
    )
    blocks: list[Block] = [table]
    for family in tested.contrasts:
        name = TERM_NAMES[":".join(family.term)].lower()
        sentences = tuple(c.sentence() for c in family.contrasts)
        if len(sentences) > 3:
            blocks.append(Fold(f"Tukey contrasts of {name}", (Bullets(sentences),)))
        else:
            blocks += [Paragraph(f"Tukey contrasts of {name} (on aligned ranks):"),
                       Bullets(sentences)]  # fmt: skip
    return blocks


def _cells(analysis: WavingAnalysis, pictures: Mapping[str, Picture]) -> Section:
    return Section(
        "cells",
        "Cells and response time",
        (
            pictures["cells"],
            _means_table(analysis, "response_ms"),
            *_tests(analysis.of("response_ms")),
        ),
    )


def _places(analysis: WavingAnalysis, pictures: Mapping[str, Picture]) -> Section:
    table = relative_confusion(analysis.analysed)
    rows = []
    for row in table.to_dict("records"):
        total = max(sum(int(row[c]) for c in ("left", "self", "right", "farther")), 1)
        shares = (fraction(int(row[c]) / total) for c in ("left", "self", "right", "farther"))
        rows.append(
            (f"{NAMES[str(row['technique'])]}, {DIRECTION_NAMES[str(row['direction'])]}", *shares)
        )
    everything = analysis.confusion()
    right = float(np.trace(everything)) / max(int(everything.sum()), 1)
    return Section(
        "places",
        "Answers by place",
        (
            pictures["confusion"],
            Table(
                (
                    Column("Wave"),
                    *(Column(h, "right") for h in ("Left", "Oneself", "Right", "Farther")),
                ),
                tuple(rows),
                "Answers relative to one's own place, as shares",
                f"{fraction(right)} of all {int(everything.sum())} answers named the right place "
                f"among {len(PLACES)}.",
            ),
        ),
    )


def _methods(params: WavingParameters) -> Section:
    return Section(
        "methods",
        "Methods",
        (
            *(Paragraph(p) for p in method_paragraphs(params)),
            Paragraph("Where the source says nothing, this platform chose:"),
            Bullets(choices(params)),
            Fold("References", (Bullets(REFERENCES),)),
        ),
    )


def _provenance(provenance: ReportProvenance) -> Section:
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
        blocks.append(Fold(counted(len(rows), "recording"), (table,)))
    return Section("provenance", "Provenance", tuple(blocks))
