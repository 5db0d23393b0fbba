"""The study of hybrid animation: its clips, its raters, and its tables."""

from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.hybrid.clips import CLIPS, Flaws, hybrid_clip, key_frame_clip, period_s
from visavis.experiments.hybrid.sections import consistency, positive_01, sign_test_p
from visavis.experiments.hybrid.study import MEANINGS, looks_of, study
from visavis.results.choices import meanings_of
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.printed_orders import order_holds, printed_orders_of
from visavis.running.quick import quick_study
from visavis.stimuli.motion.clip import placed_joints
from visavis.study.experiment import StudyExperiment
from visavis.study.responses import Choice

PEOPLE = 31
MANY = 150
SAME_M = 1e-6


@cache
def judged(people: int = PEOPLE, **parameters: Any) -> pd.DataFrame:
    """Return simulated votes."""
    opened = OpenedStudy(study)
    experiment = opened.experiment(parameters)
    return quick_study(opened, experiment, tracker_of, range(people), seed=2).trials


@pytest.mark.parametrize("name", CLIPS)
def test_a_clip_and_its_hybrid_come_round_at_the_same_time(name: str) -> None:
    for motion in (key_frame_clip(name, Flaws()), hybrid_clip(name, 0, "shoemake", Flaws())):
        first, again = placed_joints(motion, np.array([0.0, period_s(name)])).position_m
        assert float(np.abs(first - again).max()) < SAME_M


def test_a_limp_is_in_the_clip_alone_as_a_hybrid_mirrors_the_other_half() -> None:
    seconds = 3 * period_s("run")
    clip = looks_of(key_frame_clip("run", Flaws()), seconds).lame_cm
    sound = looks_of(key_frame_clip("run", Flaws(limp=0.0)), seconds).lame_cm
    made = looks_of(hybrid_clip("run", 0, "neighbours", Flaws()), seconds).lame_cm
    assert clip > 2.0
    assert sound < 0.2
    assert made < 0.2


def test_the_hybrid_run_is_preferred_only_because_the_clip_limps() -> None:
    as_source, sound = judged(), judged(limp=0.0)
    assert as_source.loc[as_source["clip"] == "run", "preference"].mean() > 0.2
    assert sound.loc[sound["clip"] == "run", "preference"].mean() < 0.0


def orders_that_hold(rows: pd.DataFrame) -> set[str]:
    return {o.name for o in printed_orders_of(StudyExperiment(study)) if order_holds(o, rows)}


def test_votes_lie_as_the_source_describes_its_bars() -> None:
    expected = {o.name for o in printed_orders_of(StudyExperiment(study)) if not o.not_reproduced}
    assert set() == expected - orders_that_hold(judged(MANY))


def test_what_is_seen_of_two_figures_alone_decides_whichever_is_the_hybrid() -> None:
    rows = judged(MANY)
    swapped = rows.assign(preference=-rows["preference"])
    assert len(orders_that_hold(swapped)) <= 8


def test_votes_do_not_depend_on_the_side_of_the_hybrid() -> None:
    means = judged(MANY).groupby("hybrid_side")["preference"].mean()
    assert pytest.approx(means["left"], abs=0.2) == means["right"]


def votes(values: list[tuple[str, str, float]]) -> pd.DataFrame:
    rows = [
        {"participant": p, "clip": "walk", "increment": 0, "hybrid_side": s, "preference": v}
        for p, s, v in values
    ]
    return pd.DataFrame(rows)


def test_a_sign_test_counts_people_not_votes() -> None:
    everybody = votes([(str(i), side, 1.0) for i in range(6) for side in ("left", "right")])
    assert pytest.approx(2 / 2**6) == sign_test_p(everybody)
    assert pytest.approx(1.0) == sign_test_p(votes([("a", "left", 0.0)]))


def test_votes_mean_hybrid_or_clip_whichever_side_they_stood_on() -> None:
    read = find_study("hybrid")
    assert isinstance(read, OpenedStudy)
    made = read.experiment({})
    means = {}
    for key, trial in made.read.items():
        (vote,) = trial.responses
        assert isinstance(vote, Choice)
        means[dict(key)["hybrid_side"]] = dict(zip(vote.options, vote.meanings, strict=True))
    assert ("hybrid_much", "clip_much") == (means["left"]["left_much"], means["left"]["right_much"])
    assert ("clip_some", "hybrid_some") == (
        means["right"]["left_some"],
        means["right"]["right_some"],
    )
    assert MEANINGS == meanings_of(made, "vote")


def test_the_source_counts_every_vote_but_significantly_for_the_clip_as_positive() -> None:
    own = votes([(str(k), "left", v) for k, v in enumerate((-2.0, -2.0, -1.0, 0.0, 2.0))])
    assert 0.6 == positive_01(own)


def test_contradictions_are_votes_that_go_with_the_side() -> None:
    said = consistency(
        votes([("a", "left", 1.0), ("a", "right", -1.0), ("b", "left", 2.0), ("b", "right", 1.0)])
    )
    assert "1 of 2 pairs of votes contradict" in said
    # For the right side: −1, −1 (hybrid right, voted against), −2, +1.
    assert "the right side is -0.75 steps" in said
