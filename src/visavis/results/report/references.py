"""What a report cites, as BibTeX and RIS for the paper that is written from it."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from visavis.results.analysis import StudyAnalysis

_TYPES: Final = {"article": "JOUR", "inproceedings": "CONF", "misc": "GEN"}


@dataclass(frozen=True)
class Reference:
    """One cited work; `note` holds a citation that is known only as text."""

    key: str
    kind: str
    authors: tuple[str, ...] = ()
    year: int | None = None
    title: str = ""
    container: str = ""
    volume: str = ""
    pages: str = ""
    doi: str = ""
    note: str = ""


GUIDELINE: Final = Reference(
    "dunn2024",
    "article",
    ("Dunn, M. J.", "others"),
    2024,
    "Minimal reporting guideline for research involving eye tracking (2023 edition)",
    "Behavior Research Methods",
    "56",
    "4351--4357",
    "10.3758/s13428-023-02187-1",
)
VALIDATION: Final = Reference(
    "schuetz2022",
    "article",
    ("Schuetz, I.", "Fiehler, K."),
    2022,
    "Eye tracking in virtual reality: Vive Pro Eye spatial accuracy, precision, and calibration "
    "reliability",
    "Journal of Eye Movement Research",
    "15",
    "3",
    "10.16910/jemr.15.3.3",
)
ALIGNED_RANKS: Final = Reference(
    "wobbrock2011",
    "inproceedings",
    ("Wobbrock, J. O.", "Findlater, L.", "Gergle, D.", "Higgins, J. J."),
    2011,
    "The aligned rank transform for nonparametric factorial analyses using only ANOVA procedures",
    "Proceedings of CHI 2011",
    "",
    "143--146",
    "10.1145/1978942.1978963",
)
HOLM: Final = Reference(
    "holm1979",
    "article",
    ("Holm, S.",),
    1979,
    "A simple sequentially rejective multiple test procedure",
    "Scandinavian Journal of Statistics",
    "6",
    "65--70",
)


def references_of(analysis: StudyAnalysis, *, with_gaze: bool) -> tuple[Reference, ...]:
    """Return the references of a report: the methods it uses, and the study's own."""
    references = [GUIDELINE, VALIDATION] if with_gaze else []
    findings = [f for f in analysis.findings if f.outcome is not None]
    if any(f.outcome.question.test == "art" for f in findings if f.outcome is not None):
        references += [ALIGNED_RANKS]
    if any(f.compare.correction == "holm" for f in findings):
        references += [HOLM]
    study = analysis.study
    source = () if study.report.source is None else (study.report.source.citation,)
    return (
        *references,
        *(_reference_from_text(t) for t in dict.fromkeys((*study.report.references, *source))),
    )


def _reference_from_text(text: str) -> Reference:
    year = re.search(r"\b(?:19|20)\d\d\b", text)
    words = re.findall(r"[A-Za-zÀ-ÿ]{3,}", text)
    key = f"{words[0].lower() if words else 'work'}{year.group() if year else ''}"
    return Reference(key, "misc", year=int(year.group()) if year else None, note=text)


def bibtex(references: Iterable[Reference]) -> str:
    """Return the references as BibTeX; a work known only as text is `@misc`."""
    entries, key_counts = [], dict[str, int]()
    for r in references:
        key_counts[r.key] = key_counts.get(r.key, 0) + 1
        key = r.key if key_counts[r.key] == 1 else f"{r.key}{'abcdefghij'[key_counts[r.key] - 1]}"
        where = "booktitle" if r.kind == "inproceedings" else "journal"
        fields = {
            "author": " and ".join(r.authors),
            "year": "" if r.year is None else str(r.year),
            "title": f"{{{r.title}}}" if r.title else "",
            where: r.container,
            "volume": r.volume,
            "pages": r.pages,
            "doi": r.doi,
            "note": _plain(r.note),
        }
        lines = ",\n".join(f"  {name} = {{{value}}}" for name, value in fields.items() if value)
        entries.append(f"@{r.kind}{{{key},\n{lines}\n}}\n")
    return "\n".join(entries)


def ris(references: Iterable[Reference]) -> str:
    """Return the references as RIS."""
    entries = []
    for r in references:
        first, _, last = r.pages.partition("--")
        tags = [("TY", _TYPES[r.kind]), *(("AU", a) for a in r.authors if a != "others")]
        tags += [("PY", "" if r.year is None else str(r.year)), ("TI", r.title or r.note)]
        tags += [("T2", r.container), ("VL", r.volume), ("SP", first), ("EP", last), ("DO", r.doi)]
        lines = [f"{tag}  - {value}" for tag, value in tags if value]
        entries.append("\n".join([*lines, "ER  - "]) + "\n")
    return "\n".join(entries)


def _plain(text: str) -> str:
    """Return a text with the special characters of BibTeX escaped or replaced."""
    return re.sub(
        r"([%&#_$])", r"\\\1", text.replace("\\", " ").replace("{", "(").replace("}", ")")
    )
