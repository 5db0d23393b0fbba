"""A person who walks towards the participant stops before them."""

from dataclasses import replace

import numpy as np
import pytest

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.study.dry_run import still_view
from visavis.study.scenes import Scene, Staging, stage


def staged(**options):
    staging = Staging(np.random.default_rng(1), 8.0)
    return stage(Scene("person", motion="walk", **options), staging, {})


def distance_m(seconds, **options):
    """Return how far the hips are from the participant, on the floor."""
    view = staged(**options).frame(still_view(), 0)
    root_m = picture_of(replace(view, t_ns=round(seconds * NS_PER_S))).people.root_m[0]
    return float(np.hypot(root_m[0], root_m[2]))


@pytest.mark.parametrize(("options", "expected"), [({}, 0.5), ({"stop_m": 1.2}, 1.2)])
def test_a_walker_stands_where_the_study_says(options, expected):
    assert distance_m(0.0, distance_m=4.0, **options) == pytest.approx(4.0, abs=0.15)
    for seconds in (8.0, 20.0):
        at_m = distance_m(seconds, distance_m=4.0, speed_mps=1.0, **options)
        assert at_m == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"distance_m": 0.9}, "there is no way to walk"),
        ({"stop_m": 0.5, "turn_deg": 90.0}, "nobody walks towards the participant"),
        ({"stopp_m": 0.5}, "did you mean 'stop_m'"),
    ],
)
def test_a_walk_that_cannot_be_is_refused(options, says):
    with pytest.raises(DesignError, match=says):
        staged(**options)


def test_the_options_of_a_walker_are_listed_once():
    with pytest.raises(DesignError) as problem:
        staged(xyz=1)
    assert str(problem.value).count("distance_m") == 1
