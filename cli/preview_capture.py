"""What a trial shows, frame by frame: the trial performed in full by a simulated participant."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from cli.perform import perform_new, simulated_request
from cli.studies import Study
from lab.clock import NS_PER_S
from lab.config import LabConfig
from lab.errors import UsageError
from lab.frame import FrameInfo
from lab.geometry import Pose
from protocol.experiment import Experiment
from protocol.plan import SessionPlan, Trial
from stage.contracts import GeometryStage, Stage, Viewer
from stimuli.scene import SceneFrame


@dataclass(frozen=True, eq=False)
class Seen:
    """One frame: what was shown, when its light left the display, where the head was."""

    view: SceneFrame
    t_ns: int
    head: Pose


class _Watching(GeometryStage):
    """A stage that draws nothing and keeps what it was asked to show."""

    def __init__(self, viewers: Sequence[Viewer]) -> None:
        super().__init__(viewers)
        self.frames: list[Seen] = []

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        """Keep the frame and tell every viewer."""
        self.frames.append(Seen(view, frame.predicted_display_ns, head))
        return super().draw(view, frame, head)


class _OneTrial:
    """An experiment whose plan has a single trial."""

    def __init__(self, experiment: Experiment, trial_id: str) -> None:
        self._experiment, self._trial_id = experiment, trial_id

    def __getattr__(self, name: str) -> Any:
        return getattr(self._experiment, name)

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the plan with that trial alone."""
        plan = self._experiment.plan(participant_index, seed, group)
        blocks = tuple(
            replace(
                block,
                trials=tuple(t for t in block.trials if t.trial_id == self._trial_id),
                questionnaires=(),
            )
            for block in plan.blocks
            if any(t.trial_id == self._trial_id for t in block.trials)
        )
        return replace(plan, blocks=blocks, questionnaires=())


def trial_of(experiment: Experiment, number: int, index: int, seed: int) -> Trial:
    """Return a trial of somebody's plan by its number; 0 is the first practice trial.

    Raises:
        UsageError: the plan has no such trial.
    """
    trials = experiment.plan(index, seed).trials
    wanted = [t for t in trials if t.is_practice] if number == 0 else trials
    for trial in wanted:
        if number == 0 or (not trial.is_practice and trial.number == number):
            return trial
    last = max((t.number for t in trials if not t.is_practice), default=0)
    raise UsageError(f"there is no trial {number}; the plan has 1 to {last}, and 0 for practice")


def capture(
    study: Study, config: LabConfig, *, number: int, index: int, seed: int
) -> tuple[Trial, list[Seen]]:
    """Perform one trial on the virtual clock and return it with every frame it showed.

    Nothing is kept of the recording. Raises UsageError when there is no such trial.
    """
    experiment = study.experiment({})
    trial = trial_of(experiment, number, index, seed)
    watching: list[_Watching] = []

    def stage_for(viewers: Sequence[Viewer]) -> Stage:
        watching.append(_Watching(viewers))
        return watching[0]

    with tempfile.TemporaryDirectory(prefix="preview") as folder:
        request = simulated_request(
            study,
            cast(Experiment, _OneTrial(experiment, trial.trial_id)),
            config.model_copy(update={"data_root": Path(folder)}),
            label=f"{index:02d}",
            index=index,
            seed=seed,
        )
        perform_new(replace(request, stage_for=stage_for))
    return trial, lit(watching[0].frames)


def lit(frames: Sequence[Seen]) -> list[Seen]:
    """Return the frames from the first with light to the last."""
    bright = [i for i, seen in enumerate(frames) if seen.view.scene.brightness_01 > 0]
    return list(frames[bright[0] : bright[-1] + 1]) if bright else list(frames)


def spread(frames: Sequence[Seen], rate_hz: int, most_s: float) -> list[Seen]:
    """Return one frame for every picture of a film of `rate_hz`, at most `most_s` long."""
    if not frames:
        return []
    start, step = frames[0].t_ns, NS_PER_S // rate_hz
    until = min(frames[-1].t_ns, start + round(most_s * NS_PER_S))
    chosen, k = [], 0
    for t in range(start, until + 1, step):
        while k + 1 < len(frames) and frames[k + 1].t_ns <= t:
            k += 1
        chosen.append(replace(frames[k], t_ns=t))
    return chosen
