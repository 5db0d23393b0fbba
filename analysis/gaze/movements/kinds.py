"""Eye movements as found in a recording: a kind for every sample, and events in order."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.events import Fixations
from visavis.analysis.gaze.stamps import Times
from visavis.lab.geometry import Vector


class Movement(IntEnum):
    """What the eyes do at a sample; `UNKNOWN` where it cannot be determined.

    Numbered as in the labelled recordings of Andersson et al. (2017). `OSCILLATION` is the
    wobble of the eye after a saccade.
    """

    UNKNOWN = 0
    FIXATION = 1
    SACCADE = 2
    OSCILLATION = 3
    PURSUIT = 4
    BLINK = 5


Detector = Literal["engbert_kliegl", "nystrom_holmqvist", "i2mc"]
Kinds = npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class Movements:
    """Detected eye movements; k events in n samples.

    `movement` (n,) a `Movement` per sample. Per event (k,): `kind`; `first_row` and
    `last_row` among the samples given; `onset_ns` and `duration_ns`, the last sample held one
    step; `amplitude_deg` between its two ends and `peak_deg_s`, of gaze in world; `head_deg_s`
    and `eye_deg_s`, mean speeds of the head and of the eye in it, NaN without a head or where
    unknown; `direction` (k, 3) the mean unit vector of its valid samples.
    `detector` is the one that ran and `why` says how it was chosen; `noise_deg_s` is
    the spread of gaze velocity by medians over the narrowest window, `window_ms` the window used.
    `eye_late_ms` and `slip_01` are what the head put into gaze in world, taken out before movements
    were told apart: by how much the eyes were paired with a later head, and the share of its turns
    that they did not compensate; 0 where neither could be shown.
    """

    movement: Kinds
    kind: Kinds
    first_row: npt.NDArray[np.int64]
    last_row: npt.NDArray[np.int64]
    onset_ns: Times
    duration_ns: Times
    direction: Vector
    amplitude_deg: Vector
    peak_deg_s: Vector
    head_deg_s: Vector
    eye_deg_s: Vector
    detector: Detector
    why: str
    noise_deg_s: float
    window_ms: float
    eye_late_ms: float = 0.0
    slip_01: float = 0.0

    def __len__(self) -> int:
        return int(self.kind.shape[0])

    def share_01(self, kind: Movement) -> float:
        """Return the share of samples of a kind, NaN without samples."""
        return float((self.movement == kind).mean()) if len(self.movement) else np.nan


def fixations_of(movements: Movements) -> Fixations:
    """Return the fixations alone, as the other detectors return theirs."""
    own = movements.kind == Movement.FIXATION
    return Fixations(
        onset_ns=movements.onset_ns[own],
        duration_ns=movements.duration_ns[own],
        first_row=movements.first_row[own],
        last_row=movements.last_row[own],
        direction=movements.direction[own],
        in_fixation=movements.movement == Movement.FIXATION,
        window_ms=movements.window_ms,
    )
