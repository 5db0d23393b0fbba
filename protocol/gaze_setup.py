"""Calibrate the eye tracker and validate it, as procedures of the session.

Validation shows nine targets (centre, four at 7.5°, four at 15°), waits one second for the gaze
to arrive and takes two seconds of samples at each, the procedure of Schuetz and Fiehler (2022)
with fewer targets. Every attempt is stored.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from devices.contracts import CalibrationOutcome, EyeTracker
from lab.clock import NS_PER_MS
from lab.geometry import (
    Vector,
    direction_from_yaw_pitch_deg,
    quat_conjugate,
    quat_multiply,
    rotate,
)
from lab.schema import SampleBatch
from protocol.experiment import Experiment, ValidationPoint
from protocol.frame_loop import FrameLoop
from protocol.participants import SimulatedParticipant
from protocol.steps import FrameView

TARGET_DISTANCE_M = 2.0
DIAGONAL_15 = 10.65
"""Yaw and pitch (degrees) of a target 15° from the centre on a diagonal."""

TARGETS: tuple[tuple[str, float, float], ...] = (
    ("centre", 0.0, 0.0),
    ("left", 7.5, 0.0),
    ("right", -7.5, 0.0),
    ("up", 0.0, 7.5),
    ("down", 0.0, -7.5),
    ("up_left", DIAGONAL_15, DIAGONAL_15),
    ("up_right", -DIAGONAL_15, DIAGONAL_15),
    ("down_left", DIAGONAL_15, -DIAGONAL_15),
    ("down_right", -DIAGONAL_15, -DIAGONAL_15),
)
"""Name, yaw (left positive) and pitch (up positive) in degrees, head frame."""


@dataclass(frozen=True)
class TargetTiming:
    """How long each target stands, in milliseconds."""

    calibration_arrive_ms: int = 800
    calibration_sample_ms: int = 700
    validation_arrive_ms: int = 1000
    validation_sample_ms: int = 2000


class GazeSetup:
    """Show targets and collect what the eye tracker says meanwhile."""

    def __init__(
        self,
        experiment: Experiment,
        loop: FrameLoop,
        eye_tracker: EyeTracker,
        participant: SimulatedParticipant | None,
        next_frame: Callable[[], FrameView],
        timing: TargetTiming,
    ) -> None:
        self._experiment = experiment
        self._loop = loop
        self._eye_tracker = eye_tracker
        self._participant = participant
        self._next_frame = next_frame
        self._timing = timing

    def calibrate(self) -> CalibrationOutcome:
        """Run one calibration; raises DeviceError when the tracker is gone."""
        timing = self._timing
        self._eye_tracker.begin_calibration()
        for _, yaw_deg, pitch_deg in TARGETS:
            mark_m = self._place_target(yaw_deg, pitch_deg)
            self._frames_for(timing.calibration_arrive_ms)
            end_ns = self._loop.t_ns + timing.calibration_sample_ms * NS_PER_MS
            while self._loop.t_ns < end_ns:
                view = self._next_frame()
                head = self._loop.head
                direction = rotate(quat_conjugate(head.orientation_wxyz), mark_m - head.position_m)
                self._eye_tracker.add_reference(direction / np.linalg.norm(direction), view.t_ns)
        outcome = self._eye_tracker.end_calibration(deadline_s=10.0)
        self._clear_target()
        return outcome

    def validate(self) -> tuple[ValidationPoint, ...]:
        """Show the nine targets and return the samples taken at each."""
        points = []
        for name, yaw_deg, pitch_deg in TARGETS:
            self._place_target(yaw_deg, pitch_deg)
            self._frames_for(self._timing.validation_arrive_ms)
            start_turn = self._loop.head.orientation_wxyz
            pieces: list[Piece] = []
            end_ns = self._loop.t_ns + self._timing.validation_sample_ms * NS_PER_MS
            while self._loop.t_ns < end_ns:
                self._loop.gaze_tap = []
                self._next_frame()
                turn = quat_multiply(quat_conjugate(start_turn), self._loop.head.orientation_wxyz)
                pieces += [_turned(batch, turn) for batch in self._loop.gaze_tap]
            self._loop.gaze_tap = None
            points.append(_point(name, yaw_deg, pitch_deg, pieces))
        self._clear_target()
        return tuple(points)

    def _place_target(self, yaw_deg: float, pitch_deg: float) -> Vector:
        head = self._loop.head
        direction = direction_from_yaw_pitch_deg(yaw_deg, pitch_deg)
        mark_m: Vector = head.position_m + TARGET_DISTANCE_M * rotate(
            head.orientation_wxyz, direction
        )
        self._loop.show_scene(self._experiment.blank(mark_m))
        if self._participant is not None:
            self._participant.look_at([float(x) for x in mark_m], self._loop.t_ns)
        return mark_m

    def _clear_target(self) -> None:
        self._loop.show_scene(self._experiment.blank(None))
        if self._participant is not None:
            self._participant.look_at(None, self._loop.t_ns)

    def _frames_for(self, duration_ms: int) -> None:
        end_ns = self._loop.t_ns + duration_ms * NS_PER_MS
        while self._loop.t_ns < end_ns:
            self._next_frame()


@dataclass(frozen=True)
class Piece:
    """Samples of one batch, directions turned into the head frame at the target's onset."""

    batch: SampleBatch
    combined: Vector
    left: Vector
    right: Vector


def _turned(batch: SampleBatch, turn_wxyz: Vector) -> Piece:
    values = batch.values

    def turned(column: str, valid: str) -> Vector:
        direction = rotate(turn_wxyz, values[column].astype(np.float64))
        kept: Vector = np.where(values[valid][:, None], direction, np.nan)
        return kept

    return Piece(
        batch,
        turned("direction_head", "valid"),
        turned("left_direction_head", "left_valid"),
        turned("right_direction_head", "right_valid"),
    )


def _point(name: str, yaw_deg: float, pitch_deg: float, pieces: list[Piece]) -> ValidationPoint:
    def joined(arrays: list[Vector]) -> Vector:
        return np.concatenate(arrays) if arrays else np.empty((0, 3))

    return ValidationPoint(
        name=name,
        target=direction_from_yaw_pitch_deg(yaw_deg, pitch_deg),
        t_ns=np.concatenate([p.batch.t_device_ns for p in pieces])
        if pieces
        else np.empty(0, dtype=np.int64),
        combined=joined([p.combined for p in pieces]),
        left=joined([p.left for p in pieces]),
        right=joined([p.right for p in pieces]),
    )
