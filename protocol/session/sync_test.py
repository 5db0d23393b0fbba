"""Perform a synchronisation test: flash a corner, play a click, buzz a band, again and again.

The times of the commands are returned; `visavis.analysis.sync_test` analyses what a sensor
measured.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import moderngl
import numpy as np

from visavis.devices.contracts import Armband, ClockPair, EyeTracker, Headset
from visavis.devices.sync.sensing import Sensor
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.frame import FrameInfo
from visavis.lab.schema import SampleBatch
from visavis.stage.card.targets import EyeTarget

PATCH_PX = 256
PATCH_SHARE = 0.25
"""Share of the picture's width and height that the patch in its lower left corner takes."""
BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
FLASH_FRAMES = 5
BUZZ_MS = 120
SETTLE_NS = 500 * NS_PER_MS
MIN_LOOK_NS, MAX_LOOK_NS = 900 * NS_PER_MS, 1500 * NS_PER_MS
"""How long a target for the eyes stands, at random: nobody can foresee when it moves."""
TARGET_X_01 = (0.3, 0.7)
TARGET_PX = 10
MIN_APART_NS, MAX_APART_NS = 430 * NS_PER_MS, 530 * NS_PER_MS
"""Stimuli follow each other after a random time, so that nothing periodic falls in step."""


class Speaker(Protocol):
    """Something that clicks."""

    def click(self) -> None:
        """Start a click now; returns at once."""
        ...


class Patch:
    """A white or black corner of both eyes' pictures, on the display that paces the frames."""

    def __init__(self, headset: Headset, context: moderngl.Context) -> None:
        self._headset = headset
        self._targets = [EyeTarget(context, (PATCH_PX, PATCH_PX), 0) for _ in range(2)]
        side = round(PATCH_PX * PATCH_SHARE)
        for target, colour in zip(self._targets, (BLACK, WHITE), strict=True):
            target.begin(BLACK)
            target.frame.clear(*colour, 1.0, viewport=(0, 0, side, side))
            target.finish()
        # For the eyes: a spot on the left with a dark corner, one on the right with a bright one.
        self._looks = [EyeTarget(context, (PATCH_PX, PATCH_PX), 0) for _ in TARGET_X_01]
        for target, x_01, colour in zip(self._looks, TARGET_X_01, (BLACK, WHITE), strict=True):
            place = (round(PATCH_PX * x_01) - TARGET_PX // 2, (PATCH_PX - TARGET_PX) // 2)
            target.begin(BLACK)
            target.frame.clear(*colour, 1.0, viewport=(0, 0, side, side))
            target.frame.clear(*WHITE, 1.0, viewport=(*place, TARGET_PX, TARGET_PX))
            target.finish()
        context.finish()

    @property
    def role(self) -> str:
        """Role of what shows it."""
        return self._headset.info.role

    @property
    def frame_ns(self) -> int:
        """How long a frame lasts, nominally."""
        return round(NS_PER_S / self._headset.display_rate_hz)

    def show(self, *, is_lit: bool) -> FrameInfo:
        """Wait for the next frame and show the patch in it; return the frame."""
        return self._show(self._targets[is_lit].texture)

    def show_target(self, *, is_right: bool) -> FrameInfo:
        """Wait for the next frame and show a spot to look at in it; return the frame."""
        return self._show(self._looks[is_right].texture)

    def _show(self, texture: moderngl.Texture) -> FrameInfo:
        frame = self._headset.wait_frame()
        self._headset.submit(frame, (texture, texture))
        self._headset.poll(0.0)
        return frame

    def release(self) -> None:
        """Free the card's memory."""
        for target in (*self._targets, *self._looks):
            target.release()


@dataclass
class StimulusTimes:
    """The times of the commands for stimuli, in ns of session time, and the frames dropped.

    `gaze_ns` are those at which a target for the eyes moved; `begun_ns` and `light_ns` when every
    frame began and its light was to leave. `display_batches` and `gaze_batches` are what display
    and eye tracker delivered, `gaze_pairs` the time exchanges with the tracker.
    """

    picture_ns: list[int] = field(default_factory=list)
    sound_ns: list[int] = field(default_factory=list)
    vibration_ns: list[int] = field(default_factory=list)
    gaze_ns: list[int] = field(default_factory=list)
    frames: int = 0
    dropped_frames: int = 0
    begun_ns: list[int] = field(default_factory=list)
    light_ns: list[int] = field(default_factory=list)
    display_batches: list[SampleBatch] = field(default_factory=list)
    gaze_batches: list[SampleBatch] = field(default_factory=list)
    gaze_pairs: list[ClockPair] = field(default_factory=list)
    frame_ns: int = 0
    flash_ns: int = 0


def perform(
    sensor: Sensor,
    clock: Clock,
    rng: np.random.Generator,
    *,
    patch: Patch,
    speaker: Speaker | None = None,
    band: Armband | None = None,
    eye_tracker: EyeTracker | None = None,
    repeats: int = 60,
    progress: Callable[[int], None] = lambda count: None,
) -> StimulusTimes:
    """Flash, click and buzz `repeats` times each and return when; skip what is missing.

    A flash's time is when its first frame's light should leave by the display's own prediction,
    which is what sessions record; a click's and a buzz's is the moment of the command. With an eye
    tracker a spot then jumps from side to side `repeats` times, to be looked at.
    """
    commands = StimulusTimes(frame_ns=patch.frame_ns, flash_ns=FLASH_FRAMES * patch.frame_ns)

    def frame(*, is_lit: bool, is_right: bool | None = None) -> FrameInfo:
        if is_right is None:
            frame_info = patch.show(is_lit=is_lit)
        else:
            frame_info = patch.show_target(is_right=is_right)
        commands.frames += 1
        commands.begun_ns.append(frame_info.t_ns)
        commands.light_ns.append(frame_info.predicted_display_ns)
        if eye_tracker is not None:
            eye_tracker.poll(0.0)
        commands.dropped_frames += frame_info.dropped
        if band is not None:
            band.keep_alive()
            band.poll(0.0)
        sensor.poll()
        return frame_info

    def wait(ns: int) -> None:
        until_ns = clock.now_ns() + ns
        while clock.now_ns() < until_ns:
            frame(is_lit=False)

    def apart() -> None:
        wait(int(rng.integers(MIN_APART_NS, MAX_APART_NS)))

    wait(SETTLE_NS)
    for repeat in range(repeats):
        commands.picture_ns.append(frame(is_lit=True).predicted_display_ns)
        for _ in range(FLASH_FRAMES - 1):
            frame(is_lit=True)
        apart()
        if speaker is not None:
            commands.sound_ns.append(clock.now_ns())
            speaker.click()
            apart()
        if band is not None:
            commands.vibration_ns.append(clock.now_ns())
            band.set_amplitudes((1.0,) * band.motor_count, BUZZ_MS)
            apart()
        progress(repeat + 1)
    wait(SETTLE_NS)
    for repeat in range(repeats + 1 if eye_tracker is not None else 0):
        is_right = bool(repeat % 2)
        first = frame(is_lit=False, is_right=is_right)
        if repeat:  # the first spot appears anywhere
            commands.gaze_ns.append(first.predicted_display_ns)
        until_ns = clock.now_ns() + int(rng.integers(MIN_LOOK_NS, MAX_LOOK_NS))
        while clock.now_ns() < until_ns:
            frame(is_lit=False, is_right=is_right)
    return commands


class SeenHeadset:
    """A headset into which a simulated photodiode looks: it reads the corner of what is shown."""

    def __init__(self, headset: Headset, look: Callable[[bool, int], None]) -> None:
        self._headset = headset
        self._look = look

    def __getattr__(self, name: str) -> object:
        return getattr(self._headset, name)

    def submit(self, frame: FrameInfo, images: Sequence[object]) -> None:
        """Hand the images over; tell how bright their corner is, and when its light leaves."""
        self._headset.submit(frame, images)
        for image in images[:1]:
            if isinstance(image, moderngl.Texture):
                self._look(_is_corner_lit(image), frame.predicted_display_ns)


class SeenMonitor:
    """A monitor on a virtual clock, at whose corner a simulated photodiode looks.

    It is what a screen display shows its pictures on: each waits for the monitor's next refresh,
    at `k / rate_hz` by the clock, and the photodiode gets the corner's brightness from then on.
    """

    closed = False

    def __init__(self, clock: Clock, rate_hz: float, look: Callable[[bool, int], None]) -> None:
        self._clock = clock
        self._rate_hz = rate_hz
        self._look = look

    def attend(self, until_ns: int) -> None:
        """Pass the time until then; nobody presses a key."""
        self._clock.sleep_until_ns(until_ns)

    def flip(self, image: moderngl.Texture) -> int:
        """Show a picture from the next refresh on; return when that was."""
        refresh = int(self._clock.now_ns() * self._rate_hz / NS_PER_S) + 1
        self._clock.sleep_until_ns(round(refresh * NS_PER_S / self._rate_hz))
        t_ns = self._clock.now_ns()
        self._look(_is_corner_lit(image), t_ns)
        return t_ns


def _is_corner_lit(image: moderngl.Texture) -> bool:
    """Tell whether the lower left pixel, which is a texture's first, is white."""
    return bool(np.frombuffer(image.read(), np.uint8)[:3].mean() > 127)
