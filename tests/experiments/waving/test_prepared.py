"""No wave is made while somebody looks: all of them are there before the first trial."""

from typing import Any

import pytest

import visavis.experiments.waving.clips as clips
from visavis.experiments.waving.clips import study_wave, wave_of
from visavis.experiments.waving.study import making_of
from visavis.results.opened_study import find_study
from visavis.stimuli.motion.warping.track import Reached


@pytest.fixture
def warped(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    made: list[Any] = []

    def quickly(base: Any, *about: Any) -> Any:
        made.append(about)
        return base, Reached(0.0, 0.0, 0.0)

    study_wave.cache_clear()
    monkeypatch.setattr(clips, "_with_plan", quickly)
    yield made
    study_wave.cache_clear()  # what was made here is no wave of the study


@pytest.mark.parametrize("parameters", [{}, {"clerk": ["clerk_left"], "eye_height_m": 1.5}])
def test_every_wave_is_made_before_the_first_trial(
    parameters: dict[str, Any], warped: list[Any]
) -> None:
    experiment = find_study("waving").experiment(parameters)
    told: list[tuple[int, int]] = []
    experiment.prepare(lambda done, of: told.append((done, of)))
    prepared = len(warped)
    assert 0 < prepared
    assert list(range(told[-1][1] + 1)) == [done for done, _ in told]
    for trial in experiment.plan(0, 1).trials:
        p = experiment.parameters
        wave_of(trial.factors, making_of(p), p["eye_height_m"])
    assert prepared == len(warped)
