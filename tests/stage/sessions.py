"""Sessions as short as they can be, drawn now and then, for tests of what was drawn."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tests.faults.sessions import request
from visavis.experiments.stare.study import study
from visavis.lab.config import LabConfig
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new
from visavis.stage.contracts import Viewer
from visavis.stage.drawn_stage import DrawnStage
from visavis.stage.renderer import Image
from visavis.stimuli.scene import SceneFrame
from visavis.study.experiment import StudyExperiment

PARAMETERS = {"trial_s": 6.0, "practice_s": 2.0, "intertrial_s": 0.5, "repetitions": 1}


@dataclass(frozen=True, eq=False)
class Shortest(StudyExperiment):
    """The beginning of a plan: so many trials of each of the first blocks."""

    trials_of_blocks: tuple[int, ...] = (1,)

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the beginning of what the participant would do."""
        whole = super().plan(participant_index, seed, group)
        blocks = tuple(
            replace(block, trials=block.trials[:n], questionnaires=())
            for block, n in zip(whole.blocks, self.trials_of_blocks, strict=False)
        )
        return replace(whole, blocks=blocks, questionnaires=())


def perform_shortest(config: LabConfig, trials_of_blocks: tuple[int, ...] = (1,)) -> Recording:
    """Perform practice, and as many trials of the blocks after it, to the end."""
    experiment = Shortest(study, PARAMETERS, trials_of_blocks)
    path: Path = perform_new(replace(request(config), experiment=experiment))
    return Recording(path)


class NowAndThen(DrawnStage):
    """Draws one frame in many, to be quick; keeps what it drew."""

    def __init__(self, *arguments: object, viewers: Sequence[Viewer], **options: Any) -> None:
        self.every = options.pop("every", 15)
        super().__init__(*arguments, **options)
        self.watching = viewers
        self.kept: list[tuple[SceneFrame, list[Image]]] = []

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        for viewer in self.watching:
            viewer.see(view, frame.predicted_display_ns)
        if frame.index % self.every:
            return ()
        images = super().draw(view, frame, head)
        self.kept.append((view, self.images()))
        return images
