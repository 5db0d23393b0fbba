"""Where people looked on the scene, in a report: the maps that were made, or how to make them."""

from collections.abc import Iterator
from pathlib import Path

from visavis.analysis.report import Block, Code, Paragraph, Section
from visavis.results.analysis import StudyAnalysis
from visavis.results.figures.gaze_map_files import gaze_map_pictures


def gaze_map_section(
    analysis: StudyAnalysis, folder: str, figures: Path, *, has_gaze: bool
) -> Iterator[Section]:
    """Yield the maps of gaze beside a report; without any, the command that makes them, where the
    study has gaze.

    `folder` is the study's as commands name it.
    """
    pictures = gaze_map_pictures(figures)
    by = next((name for name, levels in analysis.levels.items() if len(levels) > 1), "")
    command = Code((f"visavis gaze-map {folder} --by {by}",))
    if pictures:
        note = "As visavis gaze-map made them; with further sessions make them anew."
        yield Section("gaze_map", "Where people looked", (*pictures, Paragraph(note)))
    elif has_gaze and by and folder:
        words = "Maps of gaze on the scene, which the next report then shows, are made by:"
        blocks: tuple[Block, ...] = (Paragraph(words), command)
        yield Section("gaze_map", "Where people looked", blocks)
