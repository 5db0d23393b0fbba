"""Nothing is computed or loaded for the first time while somebody looks."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lab.config import load_config
from lab.config_files import EXAMPLE
from lab.errors import DeviceError, LabError, SessionAborted
from lab.frame import FrameInfo
from lab.geometry import Pose
from stimuli.scene import Scene, SceneFrame
from visavis.catalogue import SHIPPED, find_study
from visavis.sessions import perform
from visavis.sessions.perform import get_ready
from visavis.sessions.rehearsal import ScenesMet

ROOT = Path(__file__).parents[2]


def met_in_trials(reference: str, root: Path, how: str, **variables: Path) -> list[str]:
    """Return what a fresh process compiled, opened and imported during a study's first trials."""
    command = [
        sys.executable,
        "-m",
        "tests.visavis.first_trials_child",
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


@pytest.mark.slow  # a minute: every kernel of every study is compiled, as on a new computer
@pytest.mark.timeout(900)
def test_trials_meet_nothing_new_even_where_nothing_is_kept_yet(tmp_path: Path) -> None:
    empty = {"NUMBA_CACHE_DIR": tmp_path / "numba", "XDG_CACHE_HOME": tmp_path / "kept"}
    met = {name: met_in_trials(name, tmp_path / name, "ready", **empty) for name in SHIPPED}
    assert {name: [] for name in SHIPPED} == met


@pytest.mark.slow  # a process that loads everything
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
    with pytest.raises(KeyboardInterrupt):
        rehearsed(monkeypatch, SessionAborted("interrupted from the keyboard"))


def test_a_rehearsal_keeps_every_lit_scene_once() -> None:
    head, frame = Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), FrameInfo(0, 0, 0)
    nobody = np.zeros((0, 3)), np.zeros(0)
    lit = SceneFrame(Scene("lit", ()), 0, *nobody)
    again = SceneFrame(Scene("lit", ()), 9, *nobody)
    dark = SceneFrame(Scene("dark", (), brightness_01=0.0), 5, *nobody)
    stage = ScenesMet()
    for view in (dark, lit, again):
        stage.draw(view, frame, head)
    assert list(stage.met.values()) == [lit]


@pytest.mark.slow  # half a minute: a whole rehearsal
def test_what_a_rehearsal_showed_is_expected_by_the_session_s_stage() -> None:
    study = find_study("stare")
    experiment = study.experiment({})
    assert get_ready(study, experiment, load_config(EXAMPLE)) == ""
    shown = perform._READY[experiment]
    assert [11] == [len(view.scene.agents) for view in shown]
