"""A stare session as short as one can be, for tests that draw it."""

from dataclasses import replace
from pathlib import Path

from cli.perform import perform_new
from experiments.stare.design import StareParameters
from experiments.stare.study import StareStudy
from lab.config import LabConfig
from protocol.plan import SessionPlan
from recording.reader import Recording
from tests.faults.sessions import request

PARAMETERS = StareParameters(trial_s=6.0, practice_s=2.0, intertrial_s=0.5, repetitions=1)


class Shortest(StareStudy):
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
    experiment = Shortest(PARAMETERS)
    experiment.trials_of_blocks = trials_of_blocks
    path: Path = perform_new(replace(request(config), experiment=experiment))
    return Recording(path)
