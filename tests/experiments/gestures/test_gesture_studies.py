"""The studies of speaking bodies: their clips, what viewers see of them, and their tables."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.stimuli.motion.speaking.touching import clearance_m
from visavis.analysis.statistics import independent_t
from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.gestures import published
from visavis.experiments.gestures.clips import (
    FILLS,
    PART_S,
    PARTS,
    VERSIONS,
    clip_of,
    heard_from_s,
    mouth_from,
    whole,
)
from visavis.experiments.gestures.pairs import study as pairs
from visavis.experiments.gestures.sections import (
    person_means,
    ratings_as_printed,
    votes_as_printed,
)
from visavis.experiments.gestures.study import film_of, study
from visavis.experiments.gestures.viewing import looks_of
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study
from visavis.stimuli.dressing.casting import build_of, default_casting


@cache
def judged(name: str, *, effect: bool = True) -> pd.DataFrame:
    opened = OpenedStudy({"gestures": study, "gesture_pairs": pairs}[name])
    experiment = opened.experiment({})
    people = range(published.PEOPLE)
    return quick_study(opened, experiment, tracker_of, people, seed=2, effect=effect).trials


def test_36_films_are_rated_twelve_of_each_body_and_27_of_them_differ() -> None:
    rows = judged("gestures")
    counts = rows.groupby(["participant", "body"]).size().unique()
    assert counts.tolist() == [12]
    films = {film_of(b, p, v) for b in FILLS for p in PARTS for v in VERSIONS}
    assert len(films) == 27


def test_parts_go_on_where_the_part_before_ends() -> None:
    for one, other in ((1, 2), (2, 3)):
        end, begin = clip_of("corpus", one, 1).root_m[-1], clip_of("corpus", other, 1).root_m[0]
        assert (end == begin).all()


def test_a_body_that_is_left_still_is_and_the_others_hold_as_their_gaps_say() -> None:
    still = {
        body: np.mean(
            [looks_of(clip_of(body, p, v), PART_S).still_01 for p in PARTS for v in VERSIONS]
        )
        for body in FILLS
    }
    assert still["still"] == 1.0
    assert still["corpus"] < 0.4 < still["holds"] < 0.6


def test_no_foot_slides_in_any_clip() -> None:
    slides = [looks_of(clip_of(b, p, 1), PART_S).sliding_cmps for b in FILLS for p in PARTS]
    assert max(slides) == pytest.approx(0.0, abs=1e-6)


def test_no_arm_passes_through_the_moving_body() -> None:
    build = build_of(default_casting("male_02"))
    gap_m, parts, when_s = clearance_m(whole("corpus", 1), build.stature_m, every=6)
    assert gap_m >= 0.0, f"{parts} at {when_s:.2f} s"


def test_bodies_stand_in_the_printed_order_and_as_far_apart() -> None:
    means = person_means(judged("gestures"))
    for body, printed in published.RATINGS.items():
        assert float(means[body].mean()) == pytest.approx(printed.mean, abs=0.4)
    test = independent_t(np.asarray(means["corpus"]), np.asarray(means["holds"]))
    assert test.t > 0
    assert test.p < 0.05


def test_viewers_judge_what_they_see_and_never_the_label() -> None:
    swap = {"corpus": "holds", "holds": "corpus", "still": "still"}
    rows = judged("gestures")
    means = person_means(rows.assign(body=rows["body"].map(swap)))
    assert means["corpus"].mean() < means["holds"].mean()


def test_votes_are_for_the_corpus_on_both_sides() -> None:
    rows = judged("gesture_pairs")
    assert len(rows) == 12 * published.PEOPLE
    assert rows["vote_for_holds"].mean() == pytest.approx(published.VOTES_MEAN, abs=0.45)
    is_left = (rows["vote"] == "left_much") & (rows["vote_for_holds"] == -2)
    is_right = (rows["vote"] == "right_much") & (rows["vote_for_holds"] == -2)
    assert is_left.any()
    assert is_right.any()


def test_somebody_blind_to_bodies_prefers_none() -> None:
    assert abs(judged("gesture_pairs", effect=False)["vote_for_holds"].mean()) < 0.2
    means = person_means(judged("gestures", effect=False)).mean()
    assert float(np.ptp(means)) < 0.25


def analysis_of(rows: pd.DataFrame) -> Any:
    return SimpleNamespace(selection=SimpleNamespace(counted=rows))


def text_of(extra: Any) -> str:
    return repr(extra.section)


def test_the_report_has_the_printed_tests_beside_paired_ones() -> None:
    text = text_of(ratings_as_printed(analysis_of(judged("gestures")), Any))
    for printed in ("−10.19", "−7.36", "3.75", "'40'", "calls the body filled", "of I over F"):
        assert printed in text
    means = person_means(judged("gestures"))
    test = independent_t(np.asarray(means["still"]), np.asarray(means["corpus"]))
    assert f"{test.t:.2f}".replace("-", "−") in text


def test_the_report_of_pairs_has_the_printed_test() -> None:
    text = text_of(votes_as_printed(analysis_of(judged("gesture_pairs")), Any))
    assert "t(20) = −5.78" in text


def test_one_person_alone_is_reported_without_tests() -> None:
    rows = judged("gestures")
    alone = rows[rows["participant"] == rows["participant"].iloc[0]]
    assert "not computed" in text_of(ratings_as_printed(analysis_of(alone), Any))


def test_the_same_body_is_heard_with_other_speech_and_sooner_or_later() -> None:
    named = {"part": [1, 3], "version": [1], "body": ["corpus"], "speech": ["own", "other"]}
    experiment = OpenedStudy(study).experiment(named | {"sound_late_ms": [-300, 0, 300]})
    films = set(experiment.films)
    assert 12 == len(films)
    heard_s: dict[int, list[float]] = {1: [], 3: []}
    for film in films:
        assert film.voice is not None
        heard_s[film.scene.options["part"]].append(round(film.voice.from_s, 3))
    assert [-0.3, 0.0, 0.3, 10.7, 11.0, 11.3] == sorted(heard_s[1])
    assert [-0.3, 0.0, 0.3, 21.7, 22.0, 22.3] == sorted(heard_s[3])
    late, own = (mouth_from(heard_from_s(1, "own", late_ms)) for late_ms in (300.0, 0.0))
    assert own(3.0) == pytest.approx(late(3.3)) != (0.0, 0.0)
