"""What a session will do, as data: trials in blocks, made before anything runs."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from visavis.lab.chance import generator
from visavis.protocol.plan.steps import Scalar


@dataclass(frozen=True)
class Trial:
    """One trial as planned.

    `trial_id` is unique in the session ("P1" practice, "T01" ...); `number` counts from 1 within
    its kind; `block` is the block's index from 0; `factors` are the condition; `seed` feeds
    everything random within the trial (stimulus, simulated participant), so a repeated trial
    repeats.
    """

    trial_id: str
    number: int
    block: int
    is_practice: bool
    factors: Mapping[str, Scalar]
    seed: int

    def rng(self, stream: int) -> np.random.Generator:
        """Return a random generator for one purpose in this trial."""
        return generator(self.seed, stream)


@dataclass(frozen=True)
class Block:
    """Trials between two breaks; every block begins at a checkpoint.

    `instruction` is read to the participant at its start and again after an interruption;
    `calibrate` asks for calibration and validation first; `questionnaires` are asked at its end.
    """

    index: int
    name: str
    instruction: str
    trials: tuple[Trial, ...]
    calibrate: bool = True
    questionnaires: tuple[str, ...] = ()

    @property
    def is_practice(self) -> bool:
        """Whether its trials are practice."""
        return any(trial.is_practice for trial in self.trials)


@dataclass(frozen=True)
class SessionPlan:
    """Everything planned for one session; written to the manifest before the first trial."""

    study: str
    study_version: str
    participant_index: int
    group: str
    seed: int
    blocks: tuple[Block, ...]
    questionnaires: tuple[str, ...] = ()
    parameters: Mapping[str, Scalar] = field(default_factory=dict)

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Every trial, practice included, in planned order."""
        return tuple(t for b in self.blocks for t in b.trials)


def name_after_block(questionnaire: str, block: Block) -> str:
    """Return the name under which a questionnaire asked after a block is recorded."""
    return f"{questionnaire}@{block.index}"
