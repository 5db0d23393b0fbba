"""Quiet frames of a showing are counted alike, one by one and together."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from visavis.protocol.plan.steps import Unchanged
from visavis.stimuli.scenes.flat import FlatScene
from visavis.study.film_pictures import FilmPictures
from visavis.study.lit_frames import LitFrames
from visavis.study.scenes import StagedFlat

T_NS = [16_666_666, 33_333_333, 50_000_000, 66_666_666]
NOBODY = np.zeros((4, 3))
GAZES: Any = (None,) * 3  # only how many matters


class NotedTimes(FilmPictures):
    def __init__(self) -> None:
        super().__init__((), 0)
        self.times_ns: list[int] = []

    def note(self, t_ns: int) -> None:
        self.times_ns.append(t_ns)


def frames_of(*, stays: bool) -> tuple[LitFrames, NotedTimes, list[int]]:
    pictures, asked_ns = NotedTimes(), []

    def update(view: Any) -> None:
        asked_ns.append(view.t_ns)

    return LitFrames(update, pictures, 1, stays=stays), pictures, asked_ns


@pytest.mark.parametrize("is_lit", [True, False])
def test_frames_that_pass_together_are_counted_as_those_that_pass_one_by_one(is_lit: bool) -> None:
    each, pictures_each, asked_ns = frames_of(stays=True)
    together, pictures_together, never_asked_ns = frames_of(stays=True)
    each.is_lit = together.is_lit = is_lit
    for t_ns in T_NS[:3]:
        view: Any = SimpleNamespace(t_ns=t_ns)
        each(view)
    ahead = together.ahead(T_NS, NOBODY)
    assert isinstance(ahead, Unchanged)
    together.pass_frames(ahead, GAZES)

    assert (4 if is_lit else 1) == each.count == together.count
    assert (T_NS[:3] if is_lit else []) == pictures_each.times_ns == pictures_together.times_ns
    assert T_NS[:3] == asked_ns
    assert [] == never_asked_ns


def test_what_may_change_by_itself_tells_nothing_ahead_until_it_is_dark() -> None:
    frames, _, _ = frames_of(stays=False)
    assert frames.ahead(T_NS, NOBODY) is None
    frames.is_lit = False
    assert frames.ahead(T_NS, NOBODY) is not None


def test_a_flat_scene_of_a_class_with_frames_of_its_own_does_not_stay() -> None:
    class Blinking(StagedFlat):
        def frame(self, view: Any, elapsed_ns: int) -> None:
            return None

    scene = FlatScene("flat", ())
    assert StagedFlat(scene).stays
    assert not Blinking(scene).stays
