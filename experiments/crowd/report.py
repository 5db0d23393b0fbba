"""The report of a crowd study: one HTML file a lab can read at a glance and check in depth."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from analysis.plots import Drawn
from analysis.report import (
    Block,
    Bullets,
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
from experiments.crowd import published
from experiments.crowd import report_tables as tables_of
from experiments.crowd.analysis import CrowdAnalysis, Tables
from experiments.crowd.collision_table import collision_facts
from experiments.crowd.conclusions import conclude
from experiments.crowd.design import CONDITIONS
from experiments.crowd.methods_text import REFERENCES, differences_from_source, method_paragraphs
from experiments.crowd.pulse_table import pulse_table
from visavis.report import picture_of, provenance_section

TITLE = "Through the crowd"


def build_report(
    analysis: CrowdAnalysis,
    tables: Tables,
    provenance: ReportProvenance,
    out_path: Path,
    *,
    figures: Mapping[str, Drawn],
    notes: tuple[str, ...] = (),
) -> Path:
    """Write the report and return its path; the same input gives the same bytes."""
    pictures = {name: picture_of(d) for name, d in figures.items()}
    return write_page(report_page(analysis, tables, provenance, pictures, notes), out_path)


def report_page(
    analysis: CrowdAnalysis,
    tables: Tables,
    provenance: ReportProvenance,
    pictures: Mapping[str, Picture],
    notes: tuple[str, ...] = (),
) -> Page:
    """Return the report as a page."""
    sections = [
        _summary(analysis, pictures),
        _paths(analysis, pictures),
        _body(analysis, tables, pictures),
        _ratings(analysis, pictures),
        _haptics(tables),
    ]
    if analysis.control is not None:
        sections.append(_control(analysis))
    sections += [
        _exclusions(analysis, provenance, pictures),
        _methods(analysis, notes),
        provenance_section(provenance),
    ]
    return Page(
        title=TITLE,
        subtitle="Do people walk through a dense crowd differently when contacts can be felt?",
        facts=Facts(
            (
                ("Participants analysed", _participants(analysis)),
                ("Walks analysed", _walks(analysis)),
                ("Data", "simulated" if analysis.is_simulated else "real"),
                ("Volumes", ", ".join(analysis.rules)),
                ("Recorded", provenance.data_date or "unknown"),
                ("Study version", provenance.study_version),
                ("Visavis", provenance.versions.get("visavis", "unknown")),
            )
        ),
        is_simulated=analysis.is_simulated,
        sections=tuple(sections),
        footer=f"Published values: {published.CITATION}",
    )


def _participants(analysis: CrowdAnalysis) -> str:
    groups = [g for g in (analysis.main, analysis.control) if g is not None]
    n = sum(len(g.people) for g in groups)
    text = f"{n} of {len(analysis.planned)}"
    if len(groups) > 1:
        text += f" ({', '.join(f'{len(g.people)} {g.group}' for g in groups)})"
    return text


def _walks(analysis: CrowdAnalysis) -> str:
    planned = len(CONDITIONS) * sum(analysis.planned.values())
    text = f"{len(analysis.kept)} of {planned}"
    finished = len(analysis.selection.finished)
    return text if finished == planned else f"{text} ({finished} were finished)"


def _summary(analysis: CrowdAnalysis, pictures: Mapping[str, Picture]) -> Section:
    verdicts = tuple(
        Verdict(c.status, c.headline, " ".join(c.evidence)) for c in conclude(analysis)
    )
    found, of_found = analysis.agreement(published_as_different=True)
    none, of_none = analysis.agreement(published_as_different=False)
    blocks: list[Block] = [Verdicts(verdicts), pictures["blocks"], tables_of.means_table(analysis)]
    n = len(analysis.main.people)
    text = (
        f"Of {of_found} published differences between two blocks, {found} come back in the same "
        f"direction; of {of_none} pairs that did not differ, {none} do not here either."
    )
    if n < published.PARTICIPANTS:
        text += (
            f" With {counted(n, 'participant')} instead of the source's "
            f"{published.PARTICIPANTS}, verdicts that differ mainly reflect lower statistical "
            "power; compare means first."
        )
    blocks += [Paragraph(text), tables_of.tests_table(analysis, primary=True)]
    if not any(rule.startswith("published") for rule in analysis.rules):
        blocks.append(
            Paragraph(
                "The source counted cubes that touch both bodies, which overstates a common "
                "volume about twofold and lets near misses count; the numbers here are of another "
                "rule, so compare changes over blocks rather than sizes."
            )
        )
    return Section("summary", "Result", tuple(blocks))


def _paths(analysis: CrowdAnalysis, pictures: Mapping[str, Picture]) -> Section:
    maps = [picture for name, picture in pictures.items() if name.startswith("paths_")]
    blocks: list[Block] = [
        pictures["similarity"],
        tables_of.equivalence_table(analysis.main),
        tables_of.similarity_table(analysis.main),
        tables_of.fair_table(analysis.main),
        *maps[:1],
    ]
    if maps[1:]:
        others = len(maps) - 1
        title = "The other configuration" if others == 1 else f"The other {others} configurations"
        blocks.append(Fold(title, tuple(maps[1:])))
    return Section("paths", "Paths and cells", tuple(blocks))


def _body(analysis: CrowdAnalysis, tables: Tables, pictures: Mapping[str, Picture]) -> Section:
    return Section(
        "body",
        "Collisions, shoulders, walking",
        (
            pictures["collisions"],
            tables_of.collision_table(
                analysis, collision_facts(analysis.main, tables["collisions"])
            ),
            pictures["shoulders"],
            pictures["further"],
            tables_of.tests_table(analysis, primary=False),
        ),
    )


def _ratings(analysis: CrowdAnalysis, pictures: Mapping[str, Picture]) -> Section:
    sentences = tuple(
        f"{c.measure.label}: {c.test.sentence() if c.test else 'not tested, ' + c.problem}"
        for c in analysis.main.comparisons
    )
    return Section(
        "ratings",
        "Presence and embodiment",
        (
            pictures["ratings"],
            Fold(f"All {len(sentences)} conclusions in words", (Bullets(sentences),)),
        ),
    )


def _haptics(tables: Tables) -> Section:
    pulses = tables["pulses"]
    if pulses.empty:
        return Section("haptics", "Vibrations", (Paragraph("No vibration was commanded."),))
    return Section("haptics", "Vibrations", (pulse_table(pulses),))


def _control(analysis: CrowdAnalysis) -> Section:
    control = analysis.control
    if control is None:
        raise ValueError("there is no control group")
    rows = tuple(
        (
            c.measure.axis,
            str(len(c.people)),
            *(decimal(float(m), c.measure.digits) for m in c.means),
            "–" if c.test is None else c.test.test.sentence(),
        )
        for c in control.comparisons
    )
    headers = ("Measure", "n", "Block 1", "Block 2", "Block 3", "Test over blocks")
    return Section(
        "control",
        "Control group (never haptics)",
        (
            Table(
                tuple(Column(h) for h in headers),
                rows,
                "Control group by block",
                tables_of.rule_note(analysis),
            ),
            Paragraph("Does the change over blocks differ between the groups?"),
            Bullets(analysis.between_groups),
        ),
    )


def _exclusions(
    analysis: CrowdAnalysis, provenance: ReportProvenance, pictures: Mapping[str, Picture]
) -> Section:
    blocks: list[Block] = [pictures["exclusions"]]
    broken = tuple(
        (s.participant, s.session, s.status) for s in provenance.sessions if s.status != "complete"
    )
    if broken:
        blocks.append(
            Table(
                (Column("Participant"), Column("Session"), Column("Status")),
                broken,
                "Recordings that are not whole",
                "Walks that were finished before are analysed; `visavis check SESSION` says what "
                "is missing.",
            )
        )
    rows = tuple((person, walk or "all walks", why) for person, walk, why in analysis.excluded)
    headers = (Column("Participant"), Column("Walk"), Column("Reason"))
    blocks.append(
        Table(headers, rows, "Left out of the statistics")
        if rows
        else Paragraph("No walk was left out.")
    )
    flags: Counter[str] = Counter()
    for text in analysis.trials.get("flags", pd.Series(dtype=str)).dropna():
        flags.update(f for f in text.split(";") if f)
    if flags:
        blocks.append(
            Table(
                (Column("Flag"), Column("Walks", "right")),
                tuple((name, str(n)) for name, n in sorted(flags.items())),
                "What was flagged",
                "Flagged walks are analysed unless they are listed above; docs/crowd.md explains "
                "every flag.",
            )
        )
    return Section("exclusions", "Exclusions and flags", tuple(blocks))


def _methods(analysis: CrowdAnalysis, notes: tuple[str, ...]) -> Section:
    return Section(
        "methods",
        "Methods",
        (
            *(Paragraph(p) for p in (*method_paragraphs(analysis), *notes)),
            Paragraph("Differences from the source:"),
            Bullets(differences_from_source(analysis)),
            Fold("What does not fit in the published text", (Bullets(published.INCONSISTENCIES),)),
            Fold("References", (Bullets(REFERENCES),)),
        ),
    )
