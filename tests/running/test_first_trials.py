"""Nothing is computed or loaded for the first time while somebody looks."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from tests.faults.sessions import TIMING
from tests.running.test_every_study import on_kit, request_for
from tests.store import STORE
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DeviceError, LabError, SessionAborted
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.results.opened_study import find_study
from visavis.running.sessions import perform
from visavis.running.sessions.perform import get_ready
from visavis.stage.contracts import GeometryStage, Viewer
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.scene import SceneFrame
from visavis.study.catalogue import SHIPPED_STUDIES

ROOT = Path(__file__).parents[2]


def met_in_trials(reference: str, root: Path, how: str, **variables: Path) -> list[str]:
    """Return what a fresh process compiled, opened and imported during a study's first trials."""
    command = [
        sys.executable,
        "-m",
        "tests.running.first_trials_child",
        reference,
        root / "data",
        how,
    ]
    set_to = {name: str(folder) for name, folder in variables.items()}
    result = subprocess.run(
        [str(word) for word in command],
        cwd=ROOT,
        env={**os.environ, **set_to},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    met: list[str] = json.loads(result.stdout)
    return met


@pytest.mark.timeout(900)
@pytest.mark.parametrize("study", SHIPPED_STUDIES)
def test_trials_meet_nothing_new_even_where_nothing_is_kept_yet(study: str, tmp_path: Path) -> None:
    # Machine code that is kept is opened by the trial that needs it first: nobody need compile it
    # anew to show that. The waves of waving are made where nothing is kept.
    # Pairs of gestures are of films that the other study of them shows one by one.
    films_of = {"gesture_pairs": "gestures"}.get(study, study)
    empty = {"XDG_CACHE_HOME": STORE.cache(f"first trials of {films_of}", tmp_path)}
    if find_study(study).experiment({}).lives:
        pytest.skip("a page alone shows its figures")
    assert [] == met_in_trials(study, tmp_path / study, "ready", **empty)


def test_what_is_met_in_a_trial_for_the_first_time_is_heard(tmp_path: Path) -> None:
    met = met_in_trials("stare", tmp_path, "unready")
    assert any("see_gaze" in what for what in met)


def rehearsed(monkeypatch: pytest.MonkeyPatch, problem: LabError) -> str:
    """Get stare ready where the rehearsal ends with a problem; return what is said of it."""

    def ends(_: object) -> Path:
        raise problem

    monkeypatch.setattr(perform, "perform_new", ends)
    study = find_study("stare")
    return get_ready(study, study.experiment({}), load_config(EXAMPLE))


def test_a_rehearsal_that_fails_is_told_and_keeps_no_session_from_being_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said = rehearsed(monkeypatch, DeviceError("no such wire", role="eye_tracker"))
    assert "not rehearsed" in said
    assert "no such wire" in said


def test_whoever_ends_a_rehearsal_from_the_keyboard_ends_the_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ended = SessionAborted("interrupted from the keyboard")
    ended.__cause__ = KeyboardInterrupt()  # as a session tells it
    with pytest.raises(KeyboardInterrupt):
        rehearsed(monkeypatch, ended)


class Performed(BaseException):
    """Enough trials have been performed."""


class Watching(GeometryStage):
    """A stage that keeps the first frame of every trial in which people can be seen."""

    def __init__(self, viewers: Sequence[Viewer]) -> None:
        super().__init__(viewers)
        self.lit: list[SceneFrame] = []
        self.is_new = True

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        is_lit = self.is_new and view.scene.brightness_01 > 0 and bool(view.scene.dressed_by)
        if is_lit and picture_of(view).cast:
            self.is_new = False
            self.lit.append(view)
        return super().draw(view, frame, head)


@pytest.mark.parametrize("reference", ["stare", "crowd", "waving"])
def test_what_a_trial_shows_first_is_foreseen(reference: str, tmp_path: Path) -> None:
    made: list[Watching] = []

    def stage_for(viewers: Sequence[Viewer]) -> Watching:
        made.append(Watching(viewers))
        return made[-1]

    def ended(_: str, done: int, __: int) -> None:
        made[0].is_new = True
        if done == 2:
            raise Performed

    request = request_for(on_kit(reference), reference, tmp_path, 0)
    request = replace(request, timing=TIMING, stage_for=stage_for, on_trial=ended, on="lab")
    with pytest.raises(Performed):
        perform.perform_new(request)
    trials = request.experiment.plan(
        request.person.index, request.seed, request.person.group
    ).trials
    for trial, shown in zip(trials, made[0].lit[:2], strict=False):
        foreseen = request.experiment.first_lit(trial)
        assert foreseen is not None
        before, after = picture_of(foreseen), picture_of(shown)
        assert [*map(id, after.cast)] == [*map(id, before.cast)]
        assert after.room is before.room
