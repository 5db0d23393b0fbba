"""A film is named by what it shows, built once, and the same whenever it is built."""

from dataclasses import replace
from pathlib import Path

import pytest

from lab.errors import DesignError
from stage.errors import StageError
from visavis.catalogue import find_study
from visavis.films import Film, Following, Lens, Placed
from visavis.page.film_store import FilmStore, film_store
from visavis.scenes import Scene

SHORT = Film(Scene("person", motion="wave"), 0.1, size_px=(64, 64), rate_hz=30)


def store(folder: Path) -> FilmStore:
    """Return a store in a folder."""
    return FilmStore({}, folder, folder)


@pytest.mark.parametrize(
    "other",
    [
        replace(SHORT, scene=Scene("person", motion="idle")),
        replace(SHORT, seconds=0.2),
        replace(SHORT, size_px=(96, 64)),
        replace(SHORT, lens=Lens(eye_m=(0.0, 1.3, 0.0))),
        replace(SHORT, lens=Following()),
        replace(SHORT, lens=Following(back_m=2.0)),
        replace(SHORT, scene=Scene("person", motion="wave", character="male_01")),
    ],
)
def test_whatever_changes_what_is_seen_changes_the_name(other: Film, tmp_path: Path) -> None:
    made = store(tmp_path)
    assert made.name_of(SHORT) == store(tmp_path).name_of(replace(SHORT))
    assert made.name_of(SHORT) != made.name_of(other)


def test_a_film_built_again_is_equal_to_the_byte(tmp_path: Path) -> None:
    built = []
    for name in ("a", "b"):
        made = store(tmp_path / name)
        try:
            made.build([SHORT], lambda done, of: None)
        except StageError as problem:
            pytest.skip(str(problem))
        found = made.file_of(SHORT)
        assert found is not None
        built.append(found.path.read_bytes())
    assert built[0] == built[1]


def test_a_film_damaged_in_the_cache_is_built_anew(tmp_path: Path) -> None:
    made = store(tmp_path)
    path = tmp_path / f"{made.name_of(SHORT)}.webm"
    path.write_bytes(b"damaged")
    path.with_suffix(".json").write_text('{"sha256": "other"}', encoding="utf-8")
    assert made.file_of(SHORT) is None


def test_films_by_different_cameras_are_told_apart_and_whom_they_film_must_be_there(
    tmp_path: Path,
) -> None:
    made, near = store(tmp_path), replace(SHORT, lens=Following(back_m=2.0))
    assert made.name_of(near) != made.name_of(replace(SHORT, lens=Following()))
    assert near.frame_count == len(made.cameras(near)) == len(made.seen(near).seen)
    nobody = replace(SHORT, lens=Placed(((0.0, 2.0, 1.0),), subject="walker"))
    with pytest.raises(DesignError, match="nobody who is 'walker'"):
        made.name_of(nobody)


@pytest.mark.parametrize("wrong", [{"seconds": 0.0}, {"size_px": (65, 64)}, {"rate_hz": 0}])
def test_films_that_cannot_be_made_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(DesignError):
        replace(SHORT, **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["stare", "crowd", "waving"])
def test_a_study_of_the_laboratory_is_refused_before_anybody_is_let_in(name: str) -> None:
    with pytest.raises(DesignError, match=f"{name} cannot be performed on a page"):
        film_store(find_study(name).experiment({}))
