"""The first screen of a report: which figure it takes, and the picture of the place."""

from pathlib import Path
from typing import Any

import pytest

from tests.experiments.stare.synthetic_rows import analysed, anxiety_answers, study_rows
from visavis.analysis.report import Picture, Verdict
from visavis.experiments.stare.study import study
from visavis.lab.errors import UsageError
from visavis.results.figures.family_figures import opening_name
from visavis.results.opened_study import find_study
from visavis.results.report.opening import MAX_PLACE_BYTES, opening_of, place_of
from visavis.study.catalogue import SHIPPED_STUDIES
from visavis.study.parts import StudyFiles

ANSWER = Verdict("found", "Yes", "because")
JPEG = b"\xff\xd8\xff\xe0"


def with_place(folder: Path, content: bytes, name: str = "stare_place.jpg") -> Any:
    (folder / name).write_bytes(content)
    return study.with_changes(files=StudyFiles(folder=folder))


def test_the_first_figure_of_the_first_family_is_taken() -> None:
    analysis = analysed(study_rows(6), anxiety_answers(6))
    name = opening_name(analysis.families()[0])
    picture = Picture("<svg></svg>", "T", "C", "A")
    opening, taken = opening_of(ANSWER, analysis, {"quality": picture, name: picture})
    assert (name, picture) == (taken, opening.picture)
    opening, taken = opening_of(ANSWER, analysis, {"quality": picture})
    assert ("", None) == (taken, opening.picture)


def test_the_place_is_the_picture_that_bears_the_studys_name(tmp_path: Path) -> None:
    assert place_of(with_place(tmp_path, JPEG, "duel_place.jpg")) is None
    photo = place_of(with_place(tmp_path, JPEG))
    assert photo is not None
    assert JPEG == photo.jpeg


def test_a_study_without_a_picture_has_that_of_its_base(tmp_path: Path) -> None:
    made = study.with_changes(
        name="duel", base=with_place(tmp_path, JPEG), files=StudyFiles(folder=tmp_path)
    )
    photo = place_of(made)
    assert photo is not None
    assert JPEG == photo.jpeg


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"GIF89a", "no JPEG"), (JPEG + bytes(MAX_PLACE_BYTES), "takes up to 300 kB")],
)
def test_a_picture_that_fits_no_page_is_refused_with_the_command_that_makes_one(
    content: bytes, words: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=f"stare_place.jpg .*{words}.*visavis preview stare"):
        place_of(with_place(tmp_path, content))


@pytest.mark.parametrize("name", SHIPPED_STUDIES)
def test_every_study_that_comes_along_shows_what_participants_see(name: str) -> None:
    assert place_of(find_study(name).study) is not None
