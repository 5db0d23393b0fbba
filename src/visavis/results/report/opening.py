"""The first screen of a report: the answer, the figure that shows it, and the place."""

from collections.abc import Mapping
from typing import Final

from visavis.analysis.report import Opening, Photo, Picture, Verdict
from visavis.lab.errors import UsageError
from visavis.results.analysis import StudyAnalysis
from visavis.results.figures.family_figures import opening_name
from visavis.results.figures.study_figures import figure_name
from visavis.results.planned_tests import names_of_finding
from visavis.study.declaration import Study

MAX_PLACE_BYTES: Final = 300_000
PLACE_ENDING: Final = "_place.jpg"


def opening_of(
    answer: Verdict, analysis: StudyAnalysis, pictures: Mapping[str, Picture]
) -> tuple[Opening, str]:
    """Return the first screen, and the name of the figure it takes; "" where it takes none."""
    every, primary = [f.compare for f in analysis.findings], set(analysis.primary)
    findings = sorted(
        (f for f in analysis.findings if not f.compare.exploratory),
        key=lambda f: primary.isdisjoint(names_of_finding(f, every)),
    )
    names = [figure_name(f) for f in findings] + [opening_name(f) for f in analysis.families()]
    name = next((name for name in names if name in pictures), "")
    return Opening(answer, pictures.get(name), place_of(analysis.study)), name


def place_of(study: Study) -> Photo | None:
    """Return the picture that lies beside the study's file, or its base's; None without one.

    Raises:
        UsageError: it is no JPEG, or too large for a page.
    """
    path = study.files.folder / f"{study.name}{PLACE_ENDING}"
    if not path.is_file():
        return None if study.base is None else place_of(study.base)
    jpeg = path.read_bytes()
    again = f"make it anew: visavis preview {study.name} --size 720x450 --png {path.name}"
    if not jpeg.startswith(b"\xff\xd8\xff"):
        raise UsageError(f"{path} is no JPEG picture; {again}")
    if len(jpeg) > MAX_PLACE_BYTES:
        raise UsageError(
            f"{path} has {len(jpeg) / 1e3:.0f} kB; a report takes up to "
            f"{MAX_PLACE_BYTES / 1e3:.0f} kB; {again}"
        )
    return Photo(
        jpeg,
        "What a participant sees: an example, not one of these sessions.",
        "What a participant sees.",
    )
