"""The contracts of devices, from any maker, on a real or a simulated wire.

A driver is codec (bytes to values, pure) + transport (the wire) + a class as described here. A
simulated device is the same driver on a simulated wire. Life of a device:
closed -> open -> streaming -> open -> closed; a fault is reported, not only raised.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from visavis.devices.body_contract import EYES_DTYPE as EYES_DTYPE
from visavis.devices.body_contract import Body as Body
from visavis.devices.body_contract import ForeseeableHand as ForeseeableHand
from visavis.devices.body_contract import Hand as Hand
from visavis.devices.body_contract import HearingBody as HearingBody
from visavis.devices.body_contract import MovingBody as MovingBody
from visavis.devices.body_contract import OneStretch as OneStretch
from visavis.devices.body_contract import PlanningBody as PlanningBody
from visavis.devices.body_contract import PressesNothing as PressesNothing
from visavis.devices.body_contract import RecallingBody as RecallingBody
from visavis.devices.streams import BAND as BAND
from visavis.devices.streams import BAND_EVENTS as BAND_EVENTS
from visavis.devices.streams import FRAME_TIMING as FRAME_TIMING
from visavis.devices.streams import GAZE as GAZE
from visavis.devices.streams import HAPTICS as HAPTICS
from visavis.devices.streams import HEAD as HEAD
from visavis.devices.streams import HEAD_MEASURED as HEAD_MEASURED
from visavis.devices.streams import NO_DEVICE_TIME as NO_DEVICE_TIME
from visavis.devices.streams import POINTER as POINTER
from visavis.devices.streams import RESPONSES as RESPONSES
from visavis.devices.streams import SOUND as SOUND
from visavis.devices.streams import SOUND_EVENTS as SOUND_EVENTS
from visavis.devices.streams import body_schema as body_schema
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose, Vector
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.lab.screen import FlatScreen
from visavis.stimuli.sound import Waveform

Sink = Callable[[SampleBatch], None]


class DeviceState(StrEnum):
    """Where a device is in its life."""

    CLOSED = "closed"
    OPEN = "open"
    STREAMING = "streaming"
    FAULT = "fault"


@dataclass(frozen=True)
class DeviceInfo:
    """Who a device is; stored in the manifest.

    `gaze_delay_ms` is how late an eye tracker's stamps are, as configured; None: not known.
    """

    role: str
    driver: str
    driver_version: str
    vendor: str
    model: str
    serial: str
    transport: str
    is_simulated: bool
    capabilities: frozenset[str] = field(default_factory=frozenset)
    gaze_delay_ms: float | None = None


@dataclass(frozen=True)
class Fault:
    """Something the operator must know; `remedy` is what to do next.

    `is_uncalibrated` is True for the fault that the device is not calibrated.
    """

    role: str
    severity: Literal["warning", "blocking"]
    message: str
    remedy: str
    is_uncalibrated: bool = False


@dataclass(frozen=True)
class ClockPair:
    """One time exchange: host clock before and after, device clock in between (all ns)."""

    host_send_ns: int
    device_ns: int
    host_receive_ns: int


@dataclass(frozen=True)
class Health:
    """What a device has delivered since `start`.

    `gaps` counts spacings of more than 1.5 nominal periods (irregular streams: 0);
    `last_sample_age_ms` is None before the first sample; `nominal_rate_hz` is the rate the device
    promises, 0 where it promises none.
    """

    state: DeviceState
    received: int
    rate_hz: float
    gaps: int
    longest_gap_ms: float
    last_sample_age_ms: float | None
    reconnects: int = 0
    dropped: int = 0
    clock_offset_ms: float | None = None
    clock_drift_ppm: float | None = None
    battery_01: float | None = None
    nominal_rate_hz: float = 0.0


@runtime_checkable
class Device(Protocol):
    """The life every device shares."""

    @property
    def info(self) -> DeviceInfo:
        """Maker, model and serial number; complete once open."""
        ...

    @property
    def state(self) -> DeviceState:
        """Where it is in its life."""
        ...

    def open(self, deadline_s: float) -> None:
        """Connect; never blocks past the deadline. Raises DeviceError with a remedy."""
        ...

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the streams this device delivers, in a fixed order."""
        ...

    def start(self, sink: Sink) -> None:
        """Begin delivering batches to `sink` from within `poll`."""
        ...

    def poll(self, timeout_s: float) -> int:
        """Take what the wire brought, decode it, hand it to the sink; return the sample count.

        Blocks at most `timeout_s` when nothing is there. Raises DeviceDisconnected once the
        peer is gone; later calls try to reconnect, record the gap and go on.
        """
        ...

    def stop(self) -> None:
        """Stop delivering; the device stays open."""
        ...

    def close(self) -> None:
        """Release everything and leave the hardware safe; idempotent, never raises."""
        ...

    def health(self) -> Health:
        """Report deliveries so far."""
        ...

    def check(self) -> tuple[Fault, ...]:
        """Look for trouble before and during a session."""
        ...

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return the latest time exchanges since open, oldest first; empty when one-way.

        At least a thousand are kept, so that a caller who asks now and then misses none.
        """
        ...


# ---- gaze ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class CalibrationOutcome:
    """The tracker's own verdict on a calibration; accuracy is measured by our validation."""

    succeeded: bool
    message: str
    vendor_accuracy_deg: float | None = None
    vendor_precision_deg: float | None = None


class EyeTracker(Device, Protocol):
    """A device that delivers one stream with the fields of `GAZE`."""

    def begin_calibration(self) -> None:
        """Start collecting; raises DeviceError when the tracker refuses."""
        ...

    def add_reference(self, direction_head: Vector, t_host_ns: int) -> None:
        """Say that the target stood in this direction (unit, head frame) at that time."""
        ...

    def end_calibration(self, deadline_s: float) -> CalibrationOutcome:
        """Stop collecting, wait for the tracker's verdict and return it."""
        ...

    def annotate(self, text: str, t_host_ns: int) -> None:
        """Write a marker into the tracker's own recording."""
        ...


@runtime_checkable
class PatientCalibration(Protocol):
    """An eye tracker whose calibration verdict can be awaited while frames go on.

    Together the two do what `EyeTracker.end_calibration` does in one blocking call.
    """

    def finish_calibration(self) -> None:
        """Stop collecting; the verdict comes while the device is polled."""
        ...

    def calibration_verdict(self) -> CalibrationOutcome | None:
        """Return the tracker's verdict on the calibration begun last; None until it came."""
        ...


@runtime_checkable
class LeadsCalibration(Protocol):
    """An eye tracker that says itself where the next target of its calibration is to stand.

    It sends no gaze meanwhile; `visavis.devices.pump.Pausing` keeps that from being a fault.
    """

    def lead_calibration(self) -> None:
        """Begin; targets and verdict come while the device is polled. Raises DeviceError."""
        ...

    def wanted_target(self) -> Vector | None:
        """Return the direction (unit, head frame) of the target to show now; None for none."""
        ...

    def calibration_verdict(self) -> CalibrationOutcome | None:
        """Return the verdict on the calibration begun last; None until it came."""
        ...


@runtime_checkable
class DriftCorrection(Protocol):
    """An eye tracker that can shift its gaze onto a target that is looked at."""

    def correct_drift(self, direction_head: Vector) -> CalibrationOutcome:
        """Shift gaze onto a direction (unit, head frame) while recording goes on."""
        ...


@runtime_checkable
class CameraOnHead(Protocol):
    """An eye tracker whose camera sits on the head at an unknown angle.

    The angle is fitted from targets once it is worn; it holds until the device is opened anew.
    """

    def turn_to_head(self, matrix: Vector) -> None:
        """Turn gaze by this rotation (3, 3) from now on, on top of the rotation so far."""
        ...


@dataclass(frozen=True)
class SessionName:
    """Names one part of one session, for a device's own recording."""

    study: str
    participant: str
    session: int
    part: int


@runtime_checkable
class OwnRecording(Protocol):
    """A device that keeps a recording of its own beside ours; `close` ends it."""

    def begin_recording(self, name: SessionName, folder: Path) -> None:
        """Begin it under the session's name; files that are fetched at the end go to `folder`.

        It is called once the device is open, before `start`. Raises DeviceError with a remedy.
        """
        ...


# ---- head ---------------------------------------------------------------------------------


class Headset(Device, Protocol):
    """A device that paces the session and delivers one stream with the fields of `HEAD`.

    Its poses are foreseen for a frame's light. A headset that also knows where the head was
    delivers `HEAD_MEASURED` besides.
    """

    @property
    def display_rate_hz(self) -> float:
        """Nominal frames per second."""
        ...

    def wait_frame(self) -> FrameInfo:
        """Block until the next frame may be prepared; poses up to it are delivered by `poll`."""
        ...

    def submit(self, frame: FrameInfo, images: Sequence[object]) -> None:
        """Hand over the eye images drawn for `frame`; an empty sequence shows nothing new."""
        ...


@runtime_checkable
class PoseAtOnce(Protocol):
    """A headset that gives the head's poses of a frame at once and delivers their samples later."""

    def head_foreseen(self) -> Pose | None:
        """Return the head foreseen for the last frame's light, as in its sample; None if lost."""
        ...

    def head_measured(self) -> Pose | None:
        """Return the head at the start of the last frame, as in its sample; None if lost."""
        ...


MAX_FRAMES_HELD = 64
"""Frames whose poses and timing a simulated display may put off."""

MIN_FRAMES_TOGETHER = 3
"""With fewer it is faster to wait for each."""


class FramesAhead(NamedTuple):
    """Coming frames of a display whose head follows plans: for n frames `t_ns` when they begin,
    `light_ns` when their light leaves, and `poses` (n, 2, 7), float32, of the head as measured and
    as foreseen for `foreseen_ns`: position, then orientation. `heads` are the body's own positions
    (n, 3) and orientations (n, 4). All hold while `plan_number` is the body's.
    """

    t_ns: list[int]
    light_ns: list[int]
    foreseen_ns: list[int]
    poses: npt.NDArray[np.float32]
    heads: tuple[Vector, Vector]
    plan_number: int

    def part(self, first: int, end: int) -> "FramesAhead":
        """Return the frames from `first` up to, and without, `end`."""
        heads_m, heads_wxyz = self.heads
        return FramesAhead(
            self.t_ns[first:end],
            self.light_ns[first:end],
            self.foreseen_ns[first:end],
            self.poses[first:end],
            (heads_m[first:end], heads_wxyz[first:end]),
            self.plan_number,
        )


@runtime_checkable
class GazeAhead(Protocol):
    """An eye tracker that can tell samples that are coming, on a simulated wire."""

    def gaze_ahead(self, until_ns: int) -> SampleBatch | None:
        """Return the samples not delivered yet that will have arrived by a coming time, `seq` left
        out (0), as long as the body's plans hold; None where that is not known. It changes nothing.
        """
        ...


@runtime_checkable
class FramesAtOnce(PoseAtOnce, Protocol):
    """A simulated headset that can tell coming frames, and pass several of them at once."""

    def frames_ahead(self, until_ns: int, most: int) -> FramesAhead | None:
        """Return the coming frames before a time, `most` at most; None where they are not known.

        It changes nothing.
        """
        ...

    def holds(self, ahead: FramesAhead) -> bool:
        """Tell whether nothing has changed the body's plans since frames were told."""
        ...

    def pass_frames(self, ahead: FramesAhead, n: int) -> FrameInfo:
        """Wait for each of the first n frames, submit no images meanwhile, and return the last."""
        ...


@runtime_checkable
class LatePose(Protocol):
    """A headset that can predict the head's pose again just before a frame is drawn."""

    def late_head(self) -> Pose | None:
        """Return the head now predicted for the light of the last frame; None if there is none.

        Images submitted for that frame are then reported as drawn from this pose.
        """
        ...


@runtime_checkable
class OnScreen(Protocol):
    """A display through which the world is seen as through a window."""

    @property
    def is_tracked(self) -> bool:
        """Whether the head is where the eye tracker found the eyes, or else at the place."""
        ...

    @property
    def screen(self) -> FlatScreen:
        """The screen as seen from the viewing place."""
        ...

    @property
    def place(self) -> Pose:
        """The viewing place in the world, facing the screen."""
        ...

    def watch(self, batch: SampleBatch) -> None:
        """Take gaze samples, which tell where the eyes are."""
        ...


# ---- responses ----------------------------------------------------------------------------


@runtime_checkable
class ResponseInput(Device, Protocol):
    """Buttons and axes; its first stream has the fields of `RESPONSES`."""

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the controls, indexed by the `control` field."""
        ...


@runtime_checkable
class KeyListener(Protocol):
    """A response device whose keys are received by the participant's window."""

    def hear(self, key: str, is_down: bool) -> None:
        """Take a press or release of a key by its name, now."""
        ...


# ---- haptics ------------------------------------------------------------------------------


PATTERN_NAMES = ("steady", "sine", "square", "ramp")
"""Shapes of a pattern's rate; the index is the code on the wire and in `HAPTICS`."""


@dataclass(frozen=True)
class VibrationPattern:
    """A course of the vibration rate, played on the band's own clock.

    `sine` swings between `low_hz` and `high_hz`, `square` is on at `high_hz` and off by turns,
    both `modulation_hz` times a second; `ramp` rises from low to high; `steady` stays at high.
    """

    name: Literal["steady", "sine", "square", "ramp"]
    duration_ms: int
    low_hz: float = 57.0
    high_hz: float = 126.0
    modulation_hz: float = 10.0


CONTACT_PATTERN = VibrationPattern("sine", 2000)
"""The published contact: a 10 Hz sine within the pilot-tested range of 57 to 126 Hz."""


@runtime_checkable
class Armband(Device, Protocol):
    """Vibration motors; commands are absolute and idempotent, every exit path is silent.

    Commands return their number; the stream `HAPTICS` reports the result under it. They never raise
    because the band is away: such a command is recorded as not acknowledged.
    """

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        ...

    @property
    def rate_range_hz(self) -> tuple[float, float]:
        """Lowest and highest vibration rate the band allows; NaN when it does not say."""
        ...

    def set_amplitudes(
        self,
        amplitudes_01: Sequence[float],
        ttl_ms: int,
        rates_hz: Sequence[float] | None = None,
    ) -> int:
        """Set every motor, 0..1, and its rate; all fall silent after `ttl_ms` without another.

        Without `rates_hz` the amplitude runs through the band's range. An eccentric-mass motor
        has one drive for both: given a rate, any amplitude above 0 only switches it on.
        """
        ...

    def play(
        self, pattern: VibrationPattern, motors: Sequence[int], amplitude_01: float = 1.0
    ) -> int:
        """Start a pattern on these motors (from 0); the other motors fall silent."""
        ...

    def keep_alive(self) -> None:
        """Tell the driver that the experiment loop still runs; every command does so, too.

        After 150 ms without it the driver silences the band and keeps it silent.
        """
        ...

    def silence(self) -> int:
        """Stop every motor now; always allowed, in any state, from any thread; never raises."""
        ...


@runtime_checkable
class BodyTracker(Device, Protocol):
    """A suit or a set of trackers; delivers one stream of the shape `body_schema` says."""

    @property
    def segments(self) -> tuple[str, ...]:
        """Names of the segments, joints of the canonical skeleton ("left_lower_arm")."""
        ...


@runtime_checkable
class SoundOutput(Device, Protocol):
    """Plays sounds to the participant; delivers one stream with the fields of `SOUND`."""

    def prepare(self, sound: Waveform) -> None:
        """Prepare a sound, which may take longer than a frame; call it once open."""
        ...

    def play(
        self,
        sound: Waveform,
        *,
        at_m: Vector | None = None,
        gain_db: float = 0.0,
        loops: bool = False,
    ) -> int:
        """Play a sound as soon as possible; return its number in the stream `SOUND`.

        `at_m` (3,) is its place in the world; its level is as recorded at 1 m from the head. Never
        raises because the output is away: `check` reports such a sound.
        """
        ...

    def hush(self, number: int | None = None) -> None:
        """End a sound, or all of them; never raises."""
        ...

    def hear_from(self, head: Pose) -> None:
        """Say where the participant's head is now."""
        ...


@runtime_checkable
class TriggerOutput(Device, Protocol):
    """Lines to an amplifier; delivers a stream of pulses, a row for each when it ended."""

    def trigger(self, mark: str, t_ns: int) -> bool:
        """Send the code of a mark at this session time, if it has one; return whether it has.

        Never raises: the stream and `check` report a code that did not reach the lines.
        """
        ...
