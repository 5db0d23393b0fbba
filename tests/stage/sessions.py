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

PARAMETERS = StareParameters(trial_s=2.0, practice_s=2.0, intertrial_s=0.5, repetitions=1)


class Training(StareStudy):
    """One practice trial; nothing is asked within the plan."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the beginning of what the participant would do."""
        whole = super().plan(participant_index, seed, group)
        block = replace(whole.blocks[0], trials=whole.blocks[0].trials[:1], questionnaires=())
        return replace(whole, blocks=(block,), questionnaires=())


def perform_training(config: LabConfig) -> Recording:
    """Perform it to its end."""
    path: Path = perform_new(replace(request(config), experiment=Training(PARAMETERS)))
    return Recording(path)
