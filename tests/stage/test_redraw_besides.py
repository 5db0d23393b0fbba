"""Boards and own bodies are drawn again with a frame; what was never drawn is drawn, too."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import visavis.running.sessions.perform
from tests.faults.sessions import CONFIG
from tests.sessions import opened, perform, request_in
from tests.stage.sessions import NowAndThen
from visavis.cli.redraw import redraw
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import UsageError
from visavis.recording.cached import CachedRecording
from visavis.recording.folder import study_dir
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.study_folder import settle, wanted_settings
from visavis.stage.drawn_stage import Display, default_views
from visavis.stage.errors import StageError
from visavis.stage.own_body import OwnBody
from visavis.stage.renderer import LIGHTEST, Quality, Renderer
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.dressing.picture_of import picture_of


@pytest.fixture(autouse=True)
def draws() -> None:
    """Skip where nothing draws."""
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))


def settled(folder: Path, study: Any) -> None:
    at = study_dir(folder, study.name, is_simulated=True)
    settle(at, wanted_settings(at, study, is_simulated=True), seed_given=False)


@pytest.mark.parametrize("every", [7])
def test_boards_and_own_body_are_drawn_again(
    every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[NowAndThen] = []

    def build(config: Any, experiment: Any, rig: Any, clock: Any, viewers: Any) -> NowAndThen:
        body = OwnBody(default_casting("male_01"), rig.others["body_tracker"].segments)
        display = Display(default_views, lambda: (48, 54), experiment.people_count)
        stage = NowAndThen(
            picture_of,
            lambda: Renderer(quality=LIGHTEST),
            display,
            clock,
            viewers=viewers,
            every=every,
            own_body=body,
        )
        made.append(stage)
        return stage

    monkeypatch.setattr(visavis.running.sessions.perform, "build_stage", build)
    study = opened("duel")
    config = load_config(CONFIG, OPTION_MODELS)
    worn = config.display.model_copy(update={"own_body": "male"})
    config = config.model_copy(update={"data_root": tmp_path, "display": worn})
    settled(tmp_path, study)
    request = simulated_request(
        study,
        study.experiment({"repetitions": 1, "practice": 0}),
        config,
        label="S01B",
        index=0,
        seed=3,
    )
    recording = CachedRecording(perform_new(request))
    (stage,) = made
    drawn = recording.stream_arrays("drawn")
    stage.close()
    frames = drawn["frame"].tolist()
    asked = [e for e in recording.events()["payload"] if "asked_ns" in e]
    boards = [
        i
        for i, t in enumerate(drawn["t_scene_ns"])
        if any(e["asked_ns"] < t < e["answered_ns"] for e in asked)
    ]
    assert len(boards) > 2
    rows = [*boards[:2], boards[-1], *np.linspace(3, len(frames) - 1, 4).astype(int).tolist()]
    for i in rows:
        again = redraw(study, recording, frames[i])
        for old, new in zip(stage.kept[i][1], again, strict=True):
            assert np.abs(old.astype(int) - new.astype(int)).max() <= 1


def test_a_frame_of_a_session_in_which_nothing_was_drawn_is_drawn(tmp_path: Path) -> None:
    study = opened("duel")
    settled(tmp_path, study)
    recording = perform("duel", tmp_path, repetitions=1, practice=0)
    start_ns = int(recording.trials().iloc[0]["t_start_ns"])
    frames = recording.stream_arrays("frames")
    at = int(np.searchsorted(frames["t_host_ns"], start_ns)) + 20
    left, right = redraw(study, recording, int(frames["frame_index"][at]))
    assert left.shape == right.shape
    assert len(np.unique(left.reshape(-1, 3), axis=0)) > 500
    with pytest.raises(UsageError, match="has no frame 999999"):
        redraw(study, Recording(recording.path), 999_999)


def test_a_figure_is_drawn_again_as_it_was_moulded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[NowAndThen] = []

    def build(config: Any, experiment: Any, rig: Any, clock: Any, viewers: Any) -> NowAndThen:
        display = Display(default_views, lambda: (48, 54), experiment.people_count)
        stage = NowAndThen(
            picture_of,
            lambda: Renderer(quality=LIGHTEST),
            display,
            clock,
            viewers=viewers,
            every=37,
        )
        made.append(stage)
        return stage

    monkeypatch.setattr(visavis.running.sessions.perform, "build_stage", build)
    study = opened("moulding_lab")
    config = load_config(CONFIG, OPTION_MODELS).model_copy(update={"data_root": tmp_path})
    settled(tmp_path, study)
    request = simulated_request(study, study.experiment({}), config, label="S01B", index=0, seed=3)
    recording = CachedRecording(perform_new(request))
    (stage,) = made
    drawn = recording.stream_arrays("drawn")
    stage.close()
    spans = recording.trials()[["mould_on_ns", "mould2_off_ns"]].to_numpy()
    rows = [
        i for i, t in enumerate(drawn["t_scene_ns"]) if any(on + 1e8 < t < off for on, off in spans)
    ]
    assert len(rows) > 6
    for i in rows[:: max(1, len(rows) // 6)]:
        again = redraw(study, recording, int(drawn["frame"][i]))
        for old, new in zip(stage.kept[i][1], again, strict=True):
            assert np.abs(old.astype(int) - new.astype(int)).max() <= 1


WINDOWS = """
from visavis import Factor, Shape, Study

study = Study("windows", "S", factors=[Factor("seen", ["gaze", "around gaze"])], calibrate=False)

@study.trial
def trial(t):
    yield t.show(Shape("rectangle", 40, colour="red"), 3, reveal=t.seen, window_deg=20, blur_deg=0)
"""


def test_frames_that_were_drawn_with_a_window_after_gaze_redraw_with_it_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[NowAndThen] = []

    def build(_: object, experiment: Any, *arguments: Any) -> NowAndThen:
        display = Display(default_views, lambda: (48, 54), experiment.people_count)
        quality = Quality(samples=0)
        made.append(
            NowAndThen(
                picture_of,
                lambda: Renderer(quality=quality),
                display,
                arguments[-2],
                viewers=arguments[-1],
                every=9,
            )
        )
        return made[0]

    monkeypatch.setattr(visavis.running.sessions.perform, "build_stage", build)
    (tmp_path / "windows.py").write_text(WINDOWS, "utf-8")
    study = find_study(str(tmp_path / "windows.py"))
    about = request_in(tmp_path, study, EXAMPLE)
    recording = Recording(perform_new(about))
    (stage,) = made
    stage.close()
    frames = recording.stream_arrays("drawn")["frame"].tolist()
    shares = []
    for (_, images), frame in zip(stage.kept, frames, strict=True):
        is_red = images[0][..., 0] > 200
        if 0 < is_red.mean() < 0.9:
            again = redraw(study, recording, frame)
            assert all((a == b).all() for a, b in zip(again, images, strict=True))
            shares.append(round(float(is_red.mean()), 2))
    assert len(set(shares)) > 2
