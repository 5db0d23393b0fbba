"""Frames of the crowd, the waving and a lab's own study drawn again from their recordings alone."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import visavis.running.sessions.perform
from tests.faults.sessions import CONFIG
from tests.sessions import STUDIES
from tests.stage.sessions import NowAndThen
from visavis.cli.redraw import redraw
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.config import load_config
from visavis.recording.folder import study_dir
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.study_folder import settle, wanted_settings
from visavis.stage.drawn_stage import Display, default_views
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer
from visavis.stimuli.dressing.picture_of import picture_of

CROWD = {"configurations": 1, "intertrial_s": 0.5, "limit_s": 3.0}
WAVING = {
    "clerk": ["clerk_left"], "participant_place": ["place_3"], "increment": 0.1, "before_s": 0.3,
    "wave_s": 0.6, "after_s": 0.1, "intertrial_s": 0.1, "blocks": 1,
}  # fmt: skip
DUEL = {"repetitions": 1, "practice": 0}


@pytest.mark.parametrize(
    ("study", "parameters", "every"),
    [("crowd", CROWD, 131), ("waving", WAVING, 197), (str(STUDIES / "duel.py"), DUEL, 211)],
    ids=["crowd", "waving", "duel.py"],
)
def test_every_drawn_frame_of_a_study_redraws_as_it_was(
    study: str,
    parameters: dict[str, Any],
    every: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))
    made: list[NowAndThen] = []

    def build(_: object, experiment: Any, *arguments: Any) -> NowAndThen:
        display = Display(default_views, lambda: (48, 54), experiment.people_count)
        stage = NowAndThen(
            picture_of,
            lambda: Renderer(quality=LIGHTEST),
            display,
            arguments[-2],
            viewers=arguments[-1],
            every=every,
        )
        made.append(stage)
        return stage

    monkeypatch.setattr(visavis.running.sessions.perform, "build_stage", build)
    chosen = find_study(study)
    config = load_config(CONFIG, OPTION_MODELS).model_copy(update={"data_root": tmp_path})
    request = simulated_request(
        chosen, chosen.experiment(parameters), config, label="S01B", index=0, seed=3
    )
    folder = study_dir(tmp_path, chosen.name, is_simulated=True)
    settle(folder, wanted_settings(folder, chosen, is_simulated=True), seed_given=False)
    recording = Recording(perform_new(request))
    (stage,) = made
    drawn = recording.stream_arrays("drawn")
    stage.close()
    frames = drawn["frame"].tolist()
    assert len(stage.kept) == len(frames) > 6
    seen = (drawn["level"] >= 0).any(axis=1)
    some = np.linspace(0, seen.sum() - 1, 6).astype(int)
    chosen_rows = sorted({0, len(frames) - 1, *np.flatnonzero(seen)[some].tolist()})
    assert seen[chosen_rows].sum() > 2
    for i in chosen_rows:
        again = redraw(chosen, recording, frames[i])
        for old, new in zip(stage.kept[i][1], again, strict=True):
            assert np.abs(old.astype(int) - new.astype(int)).max() <= 1
