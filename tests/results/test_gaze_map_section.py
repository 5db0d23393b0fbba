"""Maps of gaze in a report: shown where they were made, else the command that makes them."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from visavis.analysis.plots import draw, new_figure, write_figure
from visavis.analysis.report import Code, Picture, Section
from visavis.results.report.gaze_map_section import gaze_map_section

LEVELS = {"place": ["desk"], "light": ["day", "night"]}


def sections_of(figures: Path, *, has_gaze: bool = True) -> list[Section]:
    analysis: Any = SimpleNamespace(levels=LEVELS)
    return list(gaze_map_section(analysis, "data/seen", figures, has_gaze=has_gaze))


def write_map(folder: Path, name: str) -> None:
    figure = draw(
        name,
        lambda: new_figure(2, 2),
        title="Where people looked, by light & place",
        caption="Mean over 8 participants; p < .05.",
        alternative="a",
        is_simulated=True,
    )
    write_figure(figure, folder)


def test_maps_that_lie_beside_the_report_are_shown_with_their_captions(tmp_path: Path) -> None:
    for name in ("gaze_map_by_light_shelf", "gaze_map_by_light_desk", "time_course"):
        write_map(tmp_path, name)
    (section,) = sections_of(tmp_path)
    pictures = [block for block in section.blocks if isinstance(block, Picture)]
    assert ["Where people looked, by light & place"] * 2 == [one.title for one in pictures]
    assert {"Mean over 8 participants; p < .05."} == {one.caption for one in pictures}
    for picture, name in zip(pictures, ("desk", "shelf"), strict=True):
        assert picture.svg.startswith("<svg")
        assert f'id="gaze_map_by_light_{name}-simulated-watermark"' in picture.svg
    assert not any(isinstance(block, Code) for block in section.blocks)


def test_without_maps_the_report_gives_the_command_that_makes_them(tmp_path: Path) -> None:
    (section,) = sections_of(tmp_path)
    (code,) = [block for block in section.blocks if isinstance(block, Code)]
    assert ("visavis gaze-map data/seen --by light",) == code.lines


def test_a_study_without_gaze_has_no_such_section(tmp_path: Path) -> None:
    assert [] == sections_of(tmp_path, has_gaze=False)


def test_a_file_that_is_no_figure_of_visavis_is_not_taken_into_the_report(tmp_path: Path) -> None:
    write_map(tmp_path, "gaze_map_by_light")
    path = tmp_path / "gaze_map_by_light.svg"
    whole = path.read_text("utf-8")
    for text in ("", whole[:300], whole.replace("</svg>", "<script>1</script></svg>")):
        path.write_text(text, "utf-8")
        (section,) = sections_of(tmp_path)
        assert not any(isinstance(block, Picture) for block in section.blocks)
