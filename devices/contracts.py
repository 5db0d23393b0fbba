"""What every device promises, whoever made it and whether its wire is real or simulated.

A driver is codec (bytes to values, pure) + transport (the wire) + the class here described. A
simulated device is the same driver on a simulated wire. Life of a device:
closed -> open -> streaming -> open -> closed; a fault is reported, not only raised.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from lab.frame import FrameInfo
from lab.geometry import Vector
from lab.schema import Field, SampleBatch, StreamSchema

Sink = Callable[[SampleBatch], None]


class DeviceState(StrEnum):
    """Where a device is in its life."""

    CLOSED = "closed"
    OPEN = "open"
    STREAMING = "streaming"
    FAULT = "fault"


@dataclass(frozen=True)
class DeviceInfo:
    """Who a device is; stored in the manifest."""

    role: str
    driver: str
    driver_version: str
    vendor: str
    model: str
    serial: str
    transport: str
    is_simulated: bool
    capabilities: frozenset[str] = field(default_factory=frozenset)


@dataclass(frozen=True)
class Fault:
    """Something the operator must know; `remedy` is what to do next."""

    role: str
    severity: Literal["warning", "blocking"]
    message: str
    remedy: str


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
    `last_sample_age_ms` is None before the first sample.
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


@runtime_checkable
class Device(Protocol):
    """The life every device shares."""

    @property
    def info(self) -> DeviceInfo:
        """Who this is; complete once open."""
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
        """Return every time exchange since open, oldest first; empty when one-way."""
        ...


# ---- gaze ---------------------------------------------------------------------------------

GAZE = StreamSchema(
    name="gaze",
    nominal_rate_hz=120.0,
    fields=(
        Field("direction_head", "f4", "1", "head", (3,), "combined gaze, unit vector; NaN if lost"),
        Field("origin_m", "f4", "m", "head", (3,), "where the combined ray starts"),
        Field("valid", "?", "", description="the combined ray may be used"),
        Field("eyes_used", "u1", "", description="bit 0 left, bit 1 right, in the combined ray"),
        Field("confidence_01", "f4", "1", description="the tracker's own confidence"),
        Field("left_direction_head", "f4", "1", "head", (3,), "left eye, unit vector; NaN if lost"),
        Field("left_valid", "?", ""),
        Field("left_pupil_mm", "f4", "mm", description="diameter; NaN if unknown"),
        Field("right_direction_head", "f4", "1", "head", (3,), "right eye; NaN if lost"),
        Field("right_valid", "?", ""),
        Field("right_pupil_mm", "f4", "mm", description="diameter; NaN if unknown"),
    ),
)
"""Canonical gaze: head frame, metres, right-handed, y up, −z forward; validity apart from value.

A driver whose device runs at another rate replaces `nominal_rate_hz` and keeps the fields.
"""


@dataclass(frozen=True)
class CalibrationOutcome:
    """What the tracker itself says of a calibration; accuracy is measured by our validation."""

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


# ---- head ---------------------------------------------------------------------------------

HEAD = StreamSchema(
    name="head",
    nominal_rate_hz=90.0,
    fields=(
        Field("position_m", "f4", "m", "world", (3,), "midpoint between the eyes"),
        Field("orientation_wxyz", "f4", "1", "world", (4,), "unit quaternion, −z forward"),
        Field("valid", "?", "", description="tracking was good"),
    ),
)


FRAME_TIMING = StreamSchema(
    name="frame_timing",
    nominal_rate_hz=90.0,
    fields=(
        Field("frame", "i8", "", description="index of the frame, as in FrameInfo"),
        Field("pose_seq", "i8", "", description="row of the head stream it was drawn from"),
        Field("predicted_display_ns", "i8", "ns", description="when its light was to leave"),
        Field("t_submitted_ns", "i8", "ns", description="both images handed over; -1 if never"),
        Field("skipped", "u4", "", description="frames the display went on without, before it"),
        Field("timing_known", "?", "", description="the runtime's own account follows"),
        Field("presents", "u4", "", description="times the runtime showed it"),
        Field("mispresented", "u4", "", description="times shown at another sync than planned"),
        Field("runtime_dropped", "u4", "", description="times the one before was shown again"),
        Field("reprojection_flags", "u4", "", description="the runtime's own flags"),
        Field("render_gpu_ms", "f4", "ms", description="the runtime's own; NaN if unknown"),
    ),
)
"""What became of every frame, by the headset runtime's own account, one row per frame, delivered
with the frame after it; a headset's second stream, of those that know."""


class Headset(Device, Protocol):
    """A device that paces the session and delivers one stream with the fields of `HEAD`."""

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


# ---- responses ----------------------------------------------------------------------------

RESPONSES = StreamSchema(
    name="responses",
    nominal_rate_hz=0.0,
    fields=(
        Field("control", "u2", "", description="index into the device's list of controls"),
        Field("value_01", "f4", "1", description="1 pressed, 0 released, or an axis"),
    ),
)


POINTER = StreamSchema(
    name="pointer",
    nominal_rate_hz=0.0,
    fields=(
        Field("hand", "u1", "", description="0 left, 1 right"),
        Field("position_m", "f4", "m", "world", (3,), "where the ray starts"),
        Field("orientation_wxyz", "f4", "1", "world", (4,), "the ray runs along −z of it"),
        Field("valid", "?", "", description="the controller is tracked"),
    ),
)
"""Where a controller points; a response device's second stream, of those that know."""


@runtime_checkable
class ResponseInput(Device, Protocol):
    """Buttons and axes; its first stream has the fields of `RESPONSES`."""

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the controls, indexed by the `control` field."""
        ...


# ---- haptics ------------------------------------------------------------------------------


PATTERN_NAMES = ("steady", "sine", "square", "ramp")
"""Courses a pattern's rate can take; the index is the code on the wire and in `HAPTICS`."""


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

    Commands return the number under which `HAPTICS` tells what became of them. They never raise
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
        """Say that the experiment loop still runs; every command says it, too.

        Without it for 150 ms the driver silences the band and lets it stay so.
        """
        ...

    def silence(self) -> int:
        """Stop every motor now; always allowed, in any state, from any thread; never raises."""
        ...


HAPTICS = StreamSchema(
    name="haptics",
    nominal_rate_hz=0.0,
    fields=(
        Field("command", "u4", "", description="number of the command, from 0, per start"),
        Field("kind", "u1", "", description="0 set, 1 pattern, 2 silence, 3 keep-alive"),
        Field("t_commanded_ns", "i8", "ns", description="when the experiment asked"),
        Field(
            "t_sent_ns", "i8", "ns", description="when the last byte left; NO_DEVICE_TIME: never"
        ),
        Field("acknowledged", "?", "", description="the band confirmed; else lost or one-way"),
        Field("amplitudes_01", "f4", "1", shape=(4,), description="per motor; NaN if not there"),
        Field("rates_hz", "f4", "Hz", shape=(4,), description="vibration rate asked; NaN if none"),
        Field("duration_ms", "f4", "ms", description="time to live, or a pattern's length"),
        Field("pattern", "u1", "", description="index into PATTERN_NAMES; 255 none"),
        Field("low_hz", "f4", "Hz", description="lowest rate of a pattern; NaN if none"),
        Field("modulation_hz", "f4", "Hz", description="swings per second; NaN if none"),
    ),
)
"""One row per command, delivered when it is acknowledged or given up; `t_host_ns` is the arrival
of the acknowledgement (or the giving up), `t_device_ns` the band's own time of applying it, or
`NO_DEVICE_TIME` when that is unknown."""

NO_DEVICE_TIME = -(2**63)
"""Stands in `t_device_ns` where the device told no time, in `t_sent_ns` of what was never sent."""

BAND = StreamSchema(
    name="band",
    nominal_rate_hz=0.0,
    fields=(
        Field("event", "u1", "", description="index into BAND_EVENTS"),
        Field("battery_01", "f4", "1", description="charge; NaN if unknown"),
        Field("temperature_c", "f4", "", description="degrees Celsius; NaN if unknown"),
    ),
)
"""What a band tells of itself: about once a second, and whenever something happens."""

BAND_EVENTS = (
    "report",
    "boot",
    "dead_man",
    "expired",
    "battery_low",
    "battery_good",
    "too_hot",
    "cool_again",
    "pattern_ended",
)
"""Events of the `BAND` stream by code: a regular report, started anew, silenced for want of
frames, silenced at the end of a time to live, and so on."""


# ---- the moving body ----------------------------------------------------------------------


def body_schema(segments: Sequence[str], rate_hz: float) -> StreamSchema:
    """Return the stream of a body tracker: every segment, every sample, in a fixed order."""
    n, listed = len(segments), " ".join(segments)
    return StreamSchema(
        name="body",
        nominal_rate_hz=rate_hz,
        fields=(
            Field("position_m", "f4", "m", "world", (n, 3), f"origins of: {listed}"),
            Field("orientation_wxyz", "f4", "1", "world", (n, 4), "identity in a T-pose to −z"),
            Field("valid", "?", "", shape=(n,), description="segment was tracked"),
        ),
    )


@runtime_checkable
class BodyTracker(Device, Protocol):
    """A suit or a set of trackers; delivers one stream of the shape `body_schema` says."""

    @property
    def segments(self) -> tuple[str, ...]:
        """Names of the segments, joints of the canonical skeleton ("left_lower_arm")."""
        ...


# ---- the simulated body -------------------------------------------------------------------

EYES_DTYPE = np.dtype(
    [
        ("left_direction_head", "f8", (3,)),
        ("right_direction_head", "f8", (3,)),
        ("openness_01", "f8"),
        ("pupil_mm", "f8"),
    ]
)
"""What a simulated eye tracker's camera would see of two eyes at an instant."""


class Body(Protocol):
    """What simulated sensors measure: one body, so that eyes, head and hands agree.

    Times are session nanoseconds; calls come with non-decreasing times.
    """

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return true eye states, shape (n,), dtype `EYES_DTYPE`; directions converge on the
        point looked at and are unit vectors in the head frame.
        """
        ...

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return position (3,) in metres and orientation (4,) (w, x, y, z) in world."""
        ...

    def stretch(self) -> int:
        """Return the number of the present stretch of behaviour (a trial, a validation).

        Simulators draw their noise from (their seed, stretch), anew whenever it changes, so
        that a stretch performed again gives the same samples.
        """
        ...

    def fit(self) -> int:
        """Return how the headset sits; it changes when it is taken off and put on again.

        The systematic error of a simulated eye tracker is drawn from (its seed, fit).
        """
        ...

    def presses(self, until_ns: int) -> Iterator[tuple[int, str, float]]:
        """Yield (t_ns, control, value) of response-device actions since the last call."""
        ...


@runtime_checkable
class MovingBody(Body, Protocol):
    """A body whose limbs are tracked and whose skin feels an armband."""

    def segments(
        self, names: Sequence[str], t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return true positions (t, n, 3) and orientations (t, n, 4) of segments in world."""
        ...

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Take in what the motors of the band worn as `role` do from `t_ns` on."""
        ...
