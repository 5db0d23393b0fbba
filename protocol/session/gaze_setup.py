"""Calibrate the eye tracker and validate it, as procedures of the session.

Validation shows nine targets (centre, four at 7.5°, four at 15°), waits one second for the gaze
to arrive and takes two seconds of samples at each, the procedure of Schuetz and Fiehler (2022)
with fewer targets. Every attempt is stored.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np

from visavis.devices.contracts import (
    CalibrationOutcome,
    CameraOnHead,
    DriftCorrection,
    EyeTracker,
    LeadsCalibration,
    OnScreen,
    PatientCalibration,
)
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DeviceTimeout
from visavis.lab.geometry import (
    Pose,
    Vector,
    angle_deg,
    direction_from_yaw_pitch_deg,
    quat_conjugate,
    quat_multiply,
    rotate,
    unit,
    yaw_pitch_deg_of,
)
from visavis.lab.rotation_fit import fit_turn
from visavis.lab.schema import SampleBatch
from visavis.protocol.people.simulated_participant import SimulatedParticipant
from visavis.protocol.plan.experiment import Experiment, ValidationPoint
from visavis.protocol.plan.steps import FrameView, GazeView, Unchanged, UpdateAhead
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.protocol.session.head_history import heads_between
from visavis.stimuli.motion.rotations import quat_between

TARGET_DISTANCE_M = 2.0
VERDICT_WITHIN_S = 10.0
"""How long to wait for the result of a calibration."""

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


ON_SCREEN_01 = 0.9
"""How far to the edge of a screen targets may lie."""


def targets_on(display: OnScreen | None) -> tuple[tuple[str, float, float], ...]:
    """Return the targets, drawn together as far as a screen needs to show all of them.

    They keep their middle where the eyes look straight ahead; in a headset nothing is changed.
    """
    if display is None:
        return TARGETS
    view = display.screen.view_from(np.zeros(3))
    shares = [1.0]
    for _, yaw_deg, pitch_deg in TARGETS:
        x, y, z = direction_from_yaw_pitch_deg(yaw_deg, pitch_deg).tolist()
        for tangent, low, high in (
            (x / -z, view.tangent_left, view.tangent_right),
            (y / -z, view.tangent_bottom, view.tangent_top),
        ):
            edge = high if tangent > 0 else low
            if tangent:
                shares.append(max(0.0, ON_SCREEN_01 * edge / tangent))
    share = min(shares)
    return tuple((name, yaw * share, pitch * share) for name, yaw, pitch in TARGETS)


MIN_POINTS_OF_FIT = 5
MAX_RESIDUAL_DEG = 3.0


@dataclass(frozen=True)
class HeadFit:
    """The rotation (3, 3) put on top of a camera's own, its angle, and the error that is left."""

    matrix: Vector
    angle_deg: float
    residual_deg: float


@dataclass(frozen=True)
class DriftCheck:
    """How far gaze lies from a target straight ahead that is looked at.

    `error_deg` is the angle between the mean of valid gaze and the target, `yaw_deg` (left
    positive) and `pitch_deg` (up positive) where gaze lies from it; NaN when too little was seen.
    `correction` is what the tracker said of shifting its gaze; None where nothing was shifted.
    """

    error_deg: float
    yaw_deg: float
    pitch_deg: float
    seen_01: float
    correction: CalibrationOutcome | None = None

    def is_within(self, limit_deg: float) -> bool:
        """Tell whether enough was seen, and gaze lies within a limit."""
        return self.seen_01 >= DRIFT_SEEN_01 and self.error_deg <= limit_deg


DRIFT_SEEN_01 = 0.5
"""The least share of valid gaze by which drift is judged."""


class NextFrame(Protocol):
    """Waits for a frame, as `OperatorDesk.next_frame`."""

    def __call__(self, quiet_until_ns: int = 0, update: UpdateAhead | None = None) -> FrameView:
        """Return the next frame."""
        ...


class GazeSetup:
    """Show targets and collect the eye tracker's samples meanwhile."""

    def __init__(
        self,
        experiment: Experiment,
        loop: FrameLoop,
        eye_tracker: EyeTracker,
        participant: SimulatedParticipant | None,
        next_frame: NextFrame,
        timing: TargetTiming,
    ) -> None:
        self._experiment = experiment
        self._loop = loop
        self._eye_tracker = eye_tracker
        self._participant = participant
        self._next_frame = next_frame
        self._timing = timing
        self._targets = targets_on(loop.screen)
        self.head_fit: HeadFit | None = None
        """The last fit of the camera to the head, for trackers with a camera on the head."""

    def calibrate(self) -> CalibrationOutcome:
        """Run one calibration; raises DeviceError when the tracker is gone.

        A tracker that is calibrated elsewhere, or never, is left as it is: validation measures it.
        """
        if isinstance(self._eye_tracker, CameraOnHead):
            return self._fit_to_head(self._eye_tracker)
        if isinstance(self._eye_tracker, LeadsCalibration):
            return self._follow(self._eye_tracker)
        if "calibration" not in self._eye_tracker.info.capabilities:
            return CalibrationOutcome(True, "this tracker is not calibrated from here")
        timing = self._timing
        self._eye_tracker.begin_calibration()
        for _, yaw_deg, pitch_deg in self._targets:
            mark_m = self._place_target(yaw_deg, pitch_deg)
            self._frames_for(timing.calibration_arrive_ms)
            self._frames_for(timing.calibration_sample_ms, partial(self._add_reference, mark_m))
        outcome = self._verdict()
        self._clear_target()
        return outcome

    def check_drift(self, limit_deg: float) -> DriftCheck:
        """Show one target straight ahead and measure how far gaze lies from it.

        A tracker that can shift its gaze is asked to where the error is within the limit: a larger
        one is a calibration that is lost, not drift.
        """
        timing = self._timing
        mark_m = self._place_target(0.0, 0.0)
        base = self._loop.head.orientation_wxyz
        self._frames_for(timing.calibration_arrive_ms)
        aim = rotate(quat_conjugate(base), mark_m - self._loop.head.position_m)
        samples = self._gaze_for(timing.calibration_sample_ms)
        point = _point("centre", aim / np.linalg.norm(aim), base, mark_m, samples)
        check = _drift(point)
        tracker = self._eye_tracker
        if isinstance(tracker, DriftCorrection) and check.is_within(limit_deg):
            head = self._loop.head
            aim = rotate(quat_conjugate(head.orientation_wxyz), mark_m - head.position_m)
            check = replace(check, correction=tracker.correct_drift(aim / np.linalg.norm(aim)))
        self._clear_target()
        return check

    def _follow(self, tracker: LeadsCalibration) -> CalibrationOutcome:
        """Show each target where the tracker wants it, until it gives its verdict."""
        tracker.lead_calibration()
        target: Vector | None = None
        while (outcome := tracker.calibration_verdict()) is None:
            next_target = tracker.wanted_target()
            if next_target is None and target is not None:
                self._clear_target()
            elif next_target is not None and (
                target is None or not np.array_equal(next_target, target)
            ):
                self._place_mark(next_target)
            target = next_target
            self._next_frame()
        self._clear_target()
        return outcome

    def _add_reference(self, mark_m: Vector, t_ns: int) -> None:
        head = self._loop.head_at(t_ns)
        direction = rotate(quat_conjugate(head.orientation_wxyz), mark_m - head.position_m)
        self._eye_tracker.add_reference(direction / np.linalg.norm(direction), t_ns)

    def _fit_to_head(self, tracker: CameraOnHead) -> CalibrationOutcome:
        """Fit the rotation of the camera on the head, and rotate gaze by it."""
        points = [p for p in self.validate() if np.isfinite(p.combined_head).all(axis=1).any()]
        if len(points) < MIN_POINTS_OF_FIT:
            return CalibrationOutcome(False, "too little gaze to find how the camera sits")
        gaze, aims = [], []
        for point in points:
            is_seen = np.isfinite(point.combined_head).all(axis=1)
            gaze.append(unit(point.combined_head[is_seen].sum(axis=0)))
            aims.append(unit(point.aim_head[is_seen].sum(axis=0)))
        fit = fit_turn(np.array(gaze), np.array(aims))
        left_deg = float(fit.residual_deg.mean())
        if left_deg > MAX_RESIDUAL_DEG:
            return CalibrationOutcome(
                False, f"no way in which the camera may sit explains gaze: {left_deg:.1f}° are left"
            )
        tracker.turn_to_head(fit.matrix)
        self.head_fit = HeadFit(fit.matrix, fit.angle_deg, left_deg)
        return CalibrationOutcome(
            True,
            f"camera turned by {fit.angle_deg:.1f}° on the head, {left_deg:.2f}° are left",
        )

    def _verdict(self) -> CalibrationOutcome:
        """End the calibration; frames go on where the tracker need not be waited for in a call."""
        tracker = self._eye_tracker
        if not isinstance(tracker, PatientCalibration):
            return tracker.end_calibration(VERDICT_WITHIN_S)
        tracker.finish_calibration()
        give_up_ns = self._loop.t_ns + round(VERDICT_WITHIN_S * NS_PER_S)
        while (outcome := tracker.calibration_verdict()) is None:
            if self._loop.t_ns >= give_up_ns:
                raise DeviceTimeout(
                    f"no calibration result within {VERDICT_WITHIN_S:g} s",
                    role=tracker.info.role,
                    remedy="look at the tracker's own program, then calibrate again",
                )
            self._next_frame()
        return outcome

    def validate(self) -> tuple[ValidationPoint, ...]:
        """Show the nine targets and return the samples taken at each."""
        points = []
        for name, yaw_deg, pitch_deg in self._targets:
            mark_m = self._place_target(yaw_deg, pitch_deg)
            base = self._loop.head.orientation_wxyz
            self._frames_for(self._timing.validation_arrive_ms)
            target = rotate(quat_conjugate(base), mark_m - self._loop.head.position_m)
            samples = self._gaze_for(self._timing.validation_sample_ms)
            points.append(_point(name, target / np.linalg.norm(target), base, mark_m, samples))
        self._clear_target()
        return tuple(points)

    def _gaze_for(self, duration_ms: int) -> "_GazeSamples":
        """Let frames pass; return the gaze they brought, each sample with the head of its time."""
        t_ns: list[int] = []
        heads: list[Pose] = []
        batches: list[SampleBatch] = []

        def keep_head(frame_ns: int) -> None:
            t_ns.append(frame_ns)
            heads.append(self._loop.head_at(frame_ns))

        self._loop.gaze_tap = batches
        self._frames_for(duration_ms, keep_head)
        self._loop.gaze_tap = None
        seen_ns = [self._loop.observer.times_ns(batch) for batch in batches]
        at_ns = np.concatenate([np.empty(0, np.int64), *seen_ns])
        return _GazeSamples(batches, *heads_between(t_ns, heads, at_ns))

    def _place_target(self, yaw_deg: float, pitch_deg: float) -> Vector:
        return self._place_mark(direction_from_yaw_pitch_deg(yaw_deg, pitch_deg))

    def _place_mark(self, direction: Vector) -> Vector:
        head = self._loop.head
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

    def _frames_for(
        self, duration_ms: int, each: Callable[[int], None] = lambda t_ns: None
    ) -> None:
        """Let frames pass, and do something at the time of each."""
        end_ns = self._loop.t_ns + duration_ms * NS_PER_MS
        passing = _EachFrame(each)
        with self._loop.leaving_gaze():
            while self._loop.t_ns < end_ns:
                passing(self._next_frame(end_ns, passing))


class _EachFrame(UpdateAhead):
    """Calls a function with the time of each quiet frame; nothing new is shown."""

    def __init__(self, each: Callable[[int], None]) -> None:
        self._each = each

    def __call__(self, view: FrameView) -> None:
        """Call it for one frame."""
        self._each(view.t_ns)

    def ahead(self, t_ns: Sequence[int], heads_m: Vector) -> Unchanged:
        """Return that nothing new is shown."""
        return Unchanged(t_ns)

    def pass_frames(self, pictures: Unchanged, gazes: Sequence[GazeView]) -> None:
        """Call it for as many frames as there are gazes."""
        for t_ns in pictures.t_ns[: len(gazes)]:
            self._each(t_ns)


class _GazeSamples(NamedTuple):
    """Gaze of some frames, with place (n, 3) and orientation (n, 4) of the head at each sample."""

    batches: Sequence[SampleBatch]
    heads_m: Vector
    turns: Vector


def _point(
    name: str, target: Vector, base: Vector, mark_m: Vector, samples: _GazeSamples
) -> ValidationPoint:
    """Put samples and target into one frame: the head's when the target appeared.

    The head may drift while the target stands, so every sample is turned with the target.
    """
    if not samples.batches:
        empty = np.empty((0, 3))
        none = np.empty(0, dtype=np.int64)
        return ValidationPoint(name, target, none, empty, empty, empty, empty, empty)
    values = np.concatenate([batch.values for batch in samples.batches])
    turns = samples.turns
    aims = rotate(quat_conjugate(base), mark_m - samples.heads_m)
    aims_head = rotate(quat_conjugate(turns), rotate(base, aims))
    still = quat_between(aims, np.broadcast_to(target, aims.shape))
    turns = quat_multiply(still, quat_multiply(quat_conjugate(base), turns))

    def in_target_frame(column: str, valid: str) -> Vector:
        direction = rotate(turns, values[column].astype(np.float64))
        valid_direction: Vector = np.where(values[valid][:, None], direction, np.nan)
        return valid_direction

    return ValidationPoint(
        name=name,
        target=target,
        t_ns=np.concatenate([batch.t_device_ns for batch in samples.batches]),
        combined=in_target_frame("direction_head", "valid"),
        left=in_target_frame("left_direction_head", "left_valid"),
        right=in_target_frame("right_direction_head", "right_valid"),
        aim_head=unit(aims_head),
        combined_head=np.where(
            values["valid"][:, None], values["direction_head"].astype(np.float64), np.nan
        ),
    )


def _drift(point: ValidationPoint) -> DriftCheck:
    """Return how far gaze lies from the one target of a drift check."""
    is_seen = np.isfinite(point.combined).all(axis=1)
    seen_01 = float(is_seen.mean()) if is_seen.size else 0.0
    if not is_seen.any():
        return DriftCheck(np.nan, np.nan, np.nan, seen_01)
    gaze = unit(point.combined[is_seen].sum(axis=0))
    yaw_deg, pitch_deg = (
        float(of_gaze - of_target)
        for of_gaze, of_target in zip(
            yaw_pitch_deg_of(gaze), yaw_pitch_deg_of(point.target), strict=True
        )
    )
    return DriftCheck(float(angle_deg(gaze, point.target)), yaw_deg, pitch_deg, seen_01)
