"""The study of cameras: its films, what simulated viewers see of them, and its tables."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from visavis.experiments.cameras.sections import equivalence, sides
from visavis.experiments.cameras.study import CAMERAS, PAIRS, could_tell, faults, study
from visavis.experiments.cameras.walks import WALKS, timed_walk
from visavis.results.opened_study import OpenedStudy
from visavis.running.film_store import FilmStore, film_store
from visavis.study.films import Film
from visavis.study.moving_camera import FilmSeen


@pytest.fixture(scope="module")
def films() -> tuple[tuple[Film, ...], FilmStore]:
    experiment = OpenedStudy(study).experiment({})
    return experiment.films, film_store(experiment)


def test_every_walk_is_filmed_once_by_every_camera(
    films: tuple[tuple[Film, ...], FilmStore],
) -> None:
    shown = {(film.scene.options["walk"], film.lens) for film in films[0]}
    assert {(walk, lens) for walk in WALKS for lens in CAMERAS.values()} == shown
    assert len(WALKS) * len(CAMERAS) == len(films[0])
    assert len(CAMERAS) * (len(CAMERAS) - 1) // 2 == len(PAIRS)


def test_no_camera_of_the_study_goes_through_a_wall_and_all_of_them_see_the_walker(
    films: tuple[tuple[Film, ...], FilmStore],
) -> None:
    walk = "between"
    for film in films[0]:
        if film.scene.options["walk"] == walk:
            seen = films[1].film_seen(film)
            assert seen.sheet.collisions == 0, film.lens
            assert seen.is_visible.mean() > 0.9, film.lens
            assert seen.t_s[-1] == pytest.approx(timed_walk(walk).seconds, abs=0.05)


def clear(film: FilmSeen, share: float) -> FilmSeen:
    """Return a film in which the walker is seen for a share of it, from the beginning on."""
    n = len(film.t_s)
    return replace(film, is_visible=np.arange(n) < share * n, height_01=np.full(n, 0.5))


def test_a_viewer_sees_what_was_done_only_where_film_and_size_show_it(
    films: tuple[tuple[Film, ...], FilmStore],
) -> None:
    film = films[1].film_seen(films[0][0])
    window_s = (0.0, float(film.t_s[-1]))
    assert could_tell(clear(film, 0.6), window_s)
    assert not could_tell(clear(film, 0.4), window_s)
    assert not could_tell(
        replace(clear(film, 1.0), height_01=np.full(len(film.t_s), 0.1)), window_s
    )
    assert faults(clear(film, 0.4)) == pytest.approx(faults(clear(film, 0.9)) + 1.5, abs=0.02)


def votes(values: list[float], side: str = "left") -> pd.DataFrame:
    rows = [
        {"participant": str(i), "pair": PAIRS[0], "preference": v, "first_side": side}
        for i, v in enumerate(values)
    ]
    return pd.DataFrame(rows)


def test_cameras_are_equally_good_within_the_bounds_of_the_plan_and_not_for_lack_of_people() -> (
    None
):
    near = [0.1, -0.1] * 10
    assert "equivalent" in equivalence(votes(near), PAIRS[0], 0.5)
    assert "not shown" in equivalence(votes([1.5, -1.5] * 2), PAIRS[0], 0.5)
    assert "cannot be computed" in equivalence(votes([1.0]), PAIRS[0], 0.5)


def test_votes_for_the_left_film_are_counted_whichever_camera_stood_there() -> None:
    both = pd.concat([votes([1.0, 1.0]), votes([1.0, 1.0], "right")])
    assert "left in 2 of 4 trials" in sides(both)
    assert "left film is +0.00 steps" in sides(both)
