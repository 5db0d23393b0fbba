"""A film that people rate shows whoever moves in it whole, or it is not built."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from tests.running.page.pages import STUDY
from visavis.lab.errors import DesignError
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.film_edges import cut_off
from visavis.running.film_store import FilmStore, camera_of, film_store
from visavis.study.films import Film, Lens
from visavis.study.scenes import Scene

CLOSE = Lens(eye_m=(0.95, 1.30, 0.0), aim_m=(0.0, 1.16, -2.6), half_height_01=0.30)
"""The lens of the gestures as it was, which cut off the hand that points to the sky."""


@cache
def store_and_films(name: str) -> tuple[FilmStore, tuple[Film, ...]]:
    study = find_study(name)
    assert isinstance(study, OpenedStudy)
    made = study.experiment({})
    return film_store(made), made.films


@pytest.mark.parametrize("name", ["interpolation", "hybrid", "gestures", str(STUDY)])
def test_no_film_of_a_study_cuts_off_a_body_that_moves(name: str) -> None:
    store, films = store_and_films(name)
    assert films
    for film in films:
        store.check_edges(film)


def test_a_film_that_cuts_off_a_hand_is_refused_by_name_and_nothing_is_built(
    tmp_path: Path,
) -> None:
    store, films = store_and_films("interpolation")
    (film,) = (f for f in films if f.scene.options == {"gesture": "deictic", "method": "squad"})
    built = replace(store, folder=tmp_path / "films")
    with pytest.raises(DesignError, match=r"deictic, method squad\).*distal above in 36 of 144"):
        built.build([replace(film, lens=CLOSE)], lambda done, of: None)
    assert not (tmp_path / "films").exists()
    built.check_edges(replace(film, lens=CLOSE, may_crop=True))


def test_feet_that_stand_still_may_be_below_the_picture_and_feet_that_walk_may_not() -> None:
    store, _ = store_and_films(str(STUDY))
    knee_up = Lens(eye_m=(0.0, 1.3, 0.0), aim_m=(0.0, 1.3, -2.6), half_height_01=0.3)

    def below(motion: str) -> set[str]:
        film = Film(Scene("person", motion=motion), 1.0, rate_hz=10, lens=knee_up)
        parts = cut_off(list(store.pictures(film)), camera_of(film.lens, film.size_px))
        return {part.part for part in parts if part.side == "below"}

    assert set() == below("idle")
    assert {"left_foot", "right_foot"} <= below("walk")
