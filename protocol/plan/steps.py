"""The steps a trial plan yields, and what each frame brings back to it.

A plan is a generator: it yields steps and receives a `FrameView` whenever it asked for the next
frame, so gaze-contingent logic is a plain loop. It returns the trial's result row. The session
aborts a plan by throwing `TrialInterrupted` into it, so `finally` blocks still run and may yield
`Mark`, `Vibrate`, `Silence` and `Reflex`, never `NextFrame`.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import VibrationPattern
from visavis.lab.geometry import Pose
from visavis.stimuli.panels import IN_HEADSET, Surface
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.sound import Waveform

Scalar: TypeAlias = str | int | float | bool
Row: TypeAlias = Mapping[str, Scalar | None]


def finite_or_none(value: float) -> float | None:
    """Return a number for a row; None for NaN and infinity, which journals cannot hold."""
    return float(value) if math.isfinite(value) else None


@dataclass(frozen=True, slots=True)
class Show:
    """Show this from the coming frame on."""

    view: SceneFrame


@dataclass(frozen=True, slots=True)
class Mark:
    """Write an event into the recording at the current frame's time."""

    name: str
    payload: Mapping[str, Scalar | None] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Vibrate:
    """Set the motors of a haptic role, absolute amplitudes 0..1, for at most `ttl_ms`."""

    role: str
    amplitudes_01: tuple[float, ...]
    ttl_ms: int


@dataclass(frozen=True, slots=True)
class Play:
    """Start a pattern on these motors of a haptic role; its other motors fall silent."""

    role: str
    pattern: VibrationPattern
    motors: tuple[int, ...]
    amplitude_01: float = 1.0


@dataclass(frozen=True, slots=True)
class PlaySound:
    """Play a sound from now on; `FrameView.sound_onsets` says when, by its `key`.

    `at_m` is its place in the world; None plays it as it is. A sound that still plays ends with the
    trial.
    """

    key: str
    sound: Waveform
    at_m: tuple[float, float, float] | None = None
    gain_db: float = 0.0
    loops: bool = False


@dataclass(frozen=True, slots=True)
class Hush:
    """Stop all sounds."""


@dataclass(frozen=True, slots=True)
class Silence:
    """Stop every motor of a haptic role now, or of every band when `role` is empty."""

    role: str = ""


@dataclass(frozen=True, slots=True)
class Ask:
    """Ask the participant one question between frames; `options` empty means free text."""

    question_id: str
    prompt: str
    options: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Prompt:
    """Tell the operator what the plan waits for; an empty text clears the line.

    The plan receives None, and `FrameView.went_on` with the frame in which the operator goes on;
    without an operator it receives an `AskReply` at once.
    """

    text: str


@dataclass(frozen=True, slots=True)
class NextFrame:
    """Wait for the next frame; the plan receives a `FrameView`.

    Frames before `quiet_until_ns` that bring nothing but head and gaze need not come back: `update`
    then says what to show after each of them, as the plan would have done. A session in real time
    hands over every frame; a simulated one may pass them without asking the plan.
    """

    quiet_until_ns: int = 0
    update: "Callable[[FrameView], SceneFrame | None] | None" = None


class Pictures(Protocol):
    """What is shown after each of n coming frames, as a plan would say frame by frame.

    Where nothing new is shown after a frame, `is_new` (n,) is false and the rows of the others have
    no meaning: `gaze_direction` (n, m, 3), `eye_openness_01` (n, m) and `gaze_distance_m` (n, m) of
    m agents.
    """

    is_new: npt.NDArray[np.bool_]
    gaze_direction: npt.NDArray[np.float64]
    eye_openness_01: npt.NDArray[np.float64]
    gaze_distance_m: npt.NDArray[np.float64]

    def after(self, i: int) -> SceneFrame:
        """Return what is new after frame i."""
        ...


class Unchanged:
    """Pictures after frames that begin at `t_ns` (n,): nothing new is shown."""

    def __init__(self, t_ns: Sequence[int]) -> None:
        n = len(t_ns)
        self.t_ns = t_ns
        self.is_new = np.zeros(n, np.bool_)
        self.gaze_direction = np.zeros((n, 0, 3))
        self.eye_openness_01 = self.gaze_distance_m = np.zeros((n, 0))

    def after(self, i: int) -> SceneFrame:
        """Raise IndexError: nothing is new after any frame."""
        raise IndexError(i)


class UpdateAhead(ABC):
    """An `update` of `NextFrame` that also tells what it will say of coming frames.

    Where it has a `stop`, a frame comes back to the plan whose gaze (`GazeView`) has samples for
    which `stop` tells the first that the plan has waited for; it returns None without one.
    """

    stop: "Callable[[GazeView], int | None] | None" = None

    def comes_back(self, gaze: "GazeView") -> bool:
        """Tell whether a frame must come back to the plan because of its gaze."""
        return self.stop is not None and self.stop(gaze) is not None

    @abstractmethod
    def __call__(self, view: "FrameView") -> SceneFrame | None:
        """Return what to show after a frame; None without a change."""

    @abstractmethod
    def ahead(self, t_ns: Sequence[int], heads_m: npt.NDArray[np.float64]) -> Pictures | None:
        """Return what is shown after coming frames, given when each begins and where the head is
        in it (n, 3), tracked in all; None where this is not known. It changes nothing.
        """

    @abstractmethod
    def pass_frames(self, pictures: Any, gazes: "Sequence[GazeView]") -> None:
        """Take the first of the frames whose `pictures` were told, as many as there are gazes, as
        if it had been called with each.
        """


class GazeView(NamedTuple):
    """The gaze samples that arrived since the frame before, seen in the scene shown.

    n samples, m agents of the scene shown. `t_ns` (n,) session time of each sample;
    `valid` (n,); `direction_world` (n, 3) unit; `origin_world_m` (n, 3); `angle_deg` (n, m) from
    the gaze ray to each head's centre (NaN when lost); `radius_deg` (n, m) angular radius of
    each head; `pad_limit_deg` (n, m) half the rim-to-rim angular gap from each head to its nearest
    neighbour as seen (0 when they overlap); `hit` (n,) index of the first agent whose head the
    ray meets before any occluder, -1 none, -2 lost.
    """

    t_ns: npt.NDArray[np.int64]
    valid: npt.NDArray[np.bool_]
    direction_world: npt.NDArray[np.float64]
    origin_world_m: npt.NDArray[np.float64]
    angle_deg: npt.NDArray[np.float64]
    radius_deg: npt.NDArray[np.float64]
    pad_limit_deg: npt.NDArray[np.float64]
    hit: npt.NDArray[np.int16]

    @property
    def sample_count(self) -> int:
        """How many samples the frame brought."""
        return len(self.t_ns)


def comes_back(view: "FrameView", update: object) -> bool:
    """Tell whether a quiet frame must come back to the plan."""
    return view.has_news or (isinstance(update, UpdateAhead) and update.comes_back(view.gaze))


class BodyView(NamedTuple):
    """The samples of the body tracker that arrived since the frame before.

    n samples of s segments in the order of `segments`: `t_ns` (n,) arrival in session time,
    `position_m` (n, s, 3) and `orientation_wxyz` (n, s, 4) in world, NaN where not `valid` (n, s).
    """

    segments: tuple[str, ...]
    t_ns: npt.NDArray[np.int64]
    position_m: npt.NDArray[np.float64]
    orientation_wxyz: npt.NDArray[np.float64]
    valid: npt.NDArray[np.bool_]


class SoundOnset(NamedTuple):
    """The start of a sound: its first sample left the card at `on_ns`; None if not reported."""

    key: str
    on_ns: int | None


class FrameView(NamedTuple):
    """The input of one frame: time, head, gaze, buttons pressed, the body (None: no sample).

    A tuple, as one is made for every frame and a frozen dataclass takes six times as long.

    `pressed_ns` are the session times at which `pressed` was heard, between frames too; empty where
    they are unknown. `went_on` is true when the operator confirmed a `Prompt` since the frame
    before. `pointers` are the rays of the tracked controllers, right hand first: from the position
    along −z of the orientation, in world. `head_points` says whether turning the head points at
    things: before a screen it does not. `sound_onsets` are the starts of sounds reported since the
    frame before. `surface` is what the participant looks at.
    """

    index: int  # type: ignore[assignment]  # of the frame, not that of a tuple
    t_ns: int
    head: Pose
    head_valid: bool
    gaze: GazeView
    pressed: tuple[str, ...] = ()
    body: BodyView | None = None
    pointers: tuple[Pose, ...] = ()
    went_on: bool = False
    head_points: bool = True
    pressed_ns: tuple[int, ...] = ()
    sound_onsets: tuple[SoundOnset, ...] = ()
    surface: Surface = IN_HEADSET

    @property
    def has_news(self) -> bool:
        """Whether the frame brought more than head and gaze."""
        return bool(self.pressed or self.body or self.sound_onsets or self.went_on)


@dataclass(frozen=True, slots=True)
class AskReply:
    """The answer to an `Ask`; None when none was given."""

    answer: str | None
    t_ns: int


@dataclass(frozen=True, slots=True)
class Reflex:
    """Answer every sample of the body tracker when it arrives, not only at the next frame.

    `answer` is given what arrived and returns what the bands shall do at once; it may be called
    from the tracker's thread, must not block, and sees every sample that a `FrameView` brings
    later. None ends it. One reflex holds until another takes its place.
    """

    answer: Callable[[BodyView], Sequence[Play | Silence]] | None


@dataclass(frozen=True, slots=True)
class Repeat:
    """Perform this trial again at the end of its block; its row says why and does not count."""

    reason: str


@dataclass(frozen=True, slots=True)
class EndEarly:
    """End the block or the session with this trial; trials that are left are skipped."""

    reason: str
    of: Literal["block", "session"] = "session"


Step: TypeAlias = (
    Show
    | Mark
    | Vibrate
    | Play
    | PlaySound
    | Hush
    | Silence
    | Reflex
    | Ask
    | Prompt
    | NextFrame
    | Repeat
    | EndEarly
)
Plan: TypeAlias = Generator[Step, FrameView | AskReply | None, Row]


class TrialInterrupted(Exception):
    """Thrown into a plan to end it early; `reason` says why."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason
