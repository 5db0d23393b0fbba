"""Light that goes and comes: over the time asked for, the mark never dimmed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.stage import figures
from visavis.lab.clock import NS_PER_MS
from visavis.stage.fades import Fades, FadeTimes
from visavis.stimuli.picture import Picture

MARK = np.array([0.0, 1.5, -2.0])


def lit(t_ms: float) -> Picture:
    return replace(figures.picture(1), t_ns=round(t_ms * NS_PER_MS))


def dark(t_ms: float) -> Picture:
    return replace(lit(t_ms), brightness_01=0.0, mark_m=MARK)


def test_scene_that_ends_is_halfway_to_black_after_half_the_time() -> None:
    fades = Fades(FadeTimes(out_ms=200))
    before = fades.apply(lit(0))
    assert before.brightness_01 == 1.0
    assert fades.apply(dark(10)).brightness_01 == pytest.approx(1.0)
    halfway = fades.apply(dark(110))
    assert halfway.brightness_01 == pytest.approx(0.5, abs=1e-6)
    assert halfway.people is before.people
    assert halfway.mark_m is MARK
    assert fades.apply(dark(210)).brightness_01 == 0.0


def test_without_fades_the_picture_is_the_scene_s() -> None:
    fades = Fades(FadeTimes())
    for picture in (lit(0), dark(10), dark(20), lit(30)):
        assert fades.apply(picture) is picture or picture.brightness_01 > 0
        assert fades.apply(picture).brightness_01 == picture.brightness_01


def test_scene_that_begins_comes_at_once_unless_asked() -> None:
    at_once, slowly = Fades(FadeTimes(out_ms=200)), Fades(FadeTimes(in_ms=100))
    for fades in (at_once, slowly):
        fades.apply(dark(0))
    assert at_once.apply(lit(10)).brightness_01 == 1.0
    assert 0.0 < slowly.apply(lit(10)).brightness_01 < 0.01
    assert slowly.apply(lit(60)).brightness_01 == pytest.approx(0.5, abs=1e-6)
    assert slowly.apply(lit(110)).brightness_01 == 1.0


def test_scene_that_returns_during_a_fade_is_bright_at_once() -> None:
    fades = Fades(FadeTimes(out_ms=200))
    fades.apply(lit(0))
    fades.apply(dark(10))
    assert fades.apply(lit(60)).brightness_01 == 1.0
