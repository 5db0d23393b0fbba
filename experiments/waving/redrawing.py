"""Rebuild what a frame of a trial showed from its recording, so that it can be drawn again."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from experiments.waving.design import WavingParameters
from experiments.waving.questions import realism_question, who_question
from experiments.waving.scene import scene_of
from lab.errors import DataError
from protocol.plan import Trial
from protocol.shown import Shown
from stimuli.picture import Panel
from stimuli.scene import SceneFrame
from stimuli.scenes.office import OfficeFrame


def views_of(shown: Shown) -> Iterator[SceneFrame]:
    """Yield the views that a frame may have shown, the likeliest first: without a board, then with
    each question and each choice pointed at.

    Raises:
        DataError: the wave of this version is not the one that was shown.
    """
    name = str(shown.description["scene_name"])
    if not name.startswith("office_"):
        yield shown.view
        return
    plan = shown.recording.manifest.plan
    params = WavingParameters(**plan["parameters"])
    # The scene comes on a frame before the event that names its trial.
    trial = _trial_shown(shown, plan)
    scene = scene_of(trial, params)
    bare = OfficeFrame(
        scene,
        shown.t_scene_ns,
        shown.gaze_direction,
        shown.eye_openness_01,
        start_ns=shown.since_ns,
    )
    for panel in _panels(str(trial.factors["participant_place"])):
        yield replace(bare, panel=panel)


def _panels(participant_place: str) -> Iterator[Panel | None]:
    yield None
    for question in (who_question(participant_place), realism_question()):
        for lit in (None, *range(len(question.meanings))):
            yield replace(question.panel, highlighted=lit)


def _trial_shown(shown: Shown, plan: dict[str, Any]) -> Trial:
    events = shown.recording.events()
    on = events[(events["name"] == "scene_on") & (events["recording_part"] == shown.part)]
    on = on[on["t_ns"] >= shown.since_ns]
    if not len(on):
        raise DataError(f"{shown.recording.path}: no event 'scene_on' tells the trial shown")
    trial_id = on.iloc[0]["payload"]["trial_id"]
    planned = {t["trial_id"]: t for block in plan["blocks"] for t in block["trials"]}
    if trial_id not in planned:
        raise DataError(f"{shown.recording.path}: trial {trial_id} is not in the session's plan")
    return Trial(**planned[trial_id])
