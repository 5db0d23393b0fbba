"""Mix sounds for two ears, block by block; a source's direction is heard by delay and shadow.

A source with a place reaches the nearer ear first and the farther one later and duller. The model
is of a rigid sphere (Brown and Duda 1998, 10.1109/89.709673: Woodworth's delay and a head shadow
of one pole and one zero for each ear), with a level that falls with distance. It has no pinnae and
no room: above and below sound alike, and so do front and back.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from visavis.lab.geometry import Pose, Vector, quat_conjugate, rotate

HEAD_RADIUS_M = 0.0875
SOUND_M_S = 343.0
SHADOW_MIN = 0.1
SHADOW_MIN_DEG = 150.0
"""The weakest gain of high tones at an ear, and the direction, from the ear, where it occurs."""
NEAREST_M = 0.25
"""Sources nearer than this are not louder."""
EARS = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
"""Directions of the ears from the middle of the head, left first; x is to the right."""
EYES_TO_EARS_M = np.array([0.0, 0.0, 0.09])
"""A head's pose is that between the eyes; the ears lie behind it."""
MAX_LATE_S = HEAD_RADIUS_M / SOUND_M_S * (1 + np.pi / 2)
"""The longest delay of the farther ear after the nearer one."""
Samples = npt.NDArray[np.float32]
Places = npt.NDArray[np.int64]
Values = npt.NDArray[np.float64]


@dataclass(eq=False)
class Voice:
    """A sound that is being played; `samples` (n, c) are of the card's rate.

    `at_m` (3,) is its place in the world; None plays it as it is, to both ears.
    """

    number: int
    samples: Samples
    gain: float
    at_m: Vector | None
    loops: bool
    next_sample: int = 0
    ends: bool = False
    late: Values = field(default_factory=lambda: np.zeros(2))
    loud: Values | None = None
    memory: Values = field(default_factory=lambda: np.zeros((2, 1)))


class Mixer:
    """Mix all playing sounds; each `block` continues where the last one ended."""

    def __init__(self, rate_hz: int) -> None:
        self.rate_hz = rate_hz
        self.head: Pose | None = None
        self.voices: list[Voice] = []
        self.clipped_blocks = 0
        """Number of blocks in which the sounds together were louder than the card can play."""

    def block(self, n: int) -> tuple[Samples, list[tuple[Voice, int]]]:
        """Return the next n samples (n, 2), and the sounds that ended, each with a sample index."""
        if not self.voices:  # as most of the time
            return np.zeros((n, 2), np.float32), []
        mix = np.zeros((n, 2))
        over: list[tuple[Voice, int]] = []
        for voice in self.voices:
            mix += self._of(voice, n)
            if voice.ends:
                over.append((voice, n))
            elif not voice.loops and voice.next_sample >= len(voice.samples) + self._tail(voice):
                over.append((voice, max(0, n - (voice.next_sample - len(voice.samples)))))
        ended_ids = {id(voice) for voice, _ in over}
        self.voices = [voice for voice in self.voices if id(voice) not in ended_ids]
        self.clipped_blocks += bool(np.abs(mix).max(initial=0.0) > 1.0)
        return np.clip(mix, -1.0, 1.0).astype(np.float32), over

    def _tail(self, voice: Voice) -> int:
        return 0 if voice.at_m is None else int(np.ceil(MAX_LATE_S * self.rate_hz)) + 1

    def _of(self, voice: Voice, n: int) -> Values:
        if voice.at_m is None:
            to, late, loud = None, np.zeros(2), np.ones(2)
        else:
            far_m, to = self._to(voice.at_m)
            late, loud = self._heard_from(far_m, to)
        loud = loud * voice.gain
        before_late, before_loud = voice.late, voice.loud
        if before_loud is None:
            before_late, before_loud = late, loud
        target = np.zeros(2) if voice.ends else loud
        ramp = np.arange(1, n + 1)[:, None] / n
        at = voice.next_sample + np.arange(n)[:, None] - (before_late + (late - before_late) * ramp)
        out = self._read(voice, at) * (before_loud + (target - before_loud) * ramp)
        if to is not None:
            for ear, (b, a) in enumerate(self._shadows(to)):
                out[:, ear], voice.memory[ear] = lfilter(b, a, out[:, ear], zi=voice.memory[ear])
        voice.late, voice.loud, voice.next_sample = late, target, voice.next_sample + n
        return out

    def _read(self, voice: Voice, at: Values) -> Values:
        """Return the sound at fractional sample positions (n, 2); silence before and after it."""
        samples = voice.samples
        count = len(samples)
        below = np.floor(at).astype(np.int64)
        share = at - below
        channel = np.array([0, samples.shape[1] - 1])
        if voice.at_m is not None and samples.shape[1] == 2:
            samples, channel = samples.mean(axis=1, keepdims=True), np.zeros(2, np.int64)

        def value(index: Places) -> Values:
            if voice.loops:
                here = samples[index % count, channel]
                return np.where(index >= 0, here, 0.0)
            inside = (index >= 0) & (index < count)
            return np.where(inside, samples[np.clip(index, 0, count - 1), channel], 0.0)

        return value(below) * (1.0 - share) + value(below + 1) * share

    def _to(self, at_m: Vector) -> tuple[float, Vector]:
        """Return the distance (m) and direction of a place from the middle of the head."""
        if self.head is None:
            way = at_m
        else:
            turn = quat_conjugate(self.head.orientation_wxyz)
            way = rotate(turn, at_m - self.head.position_m) - EYES_TO_EARS_M
        far_m = float(np.linalg.norm(way))
        return far_m, way / far_m if far_m > 1e-6 else np.array([0.0, 0.0, -1.0])

    def _heard_from(self, far_m: float, to: Vector) -> tuple[Values, Values]:
        """Return each ear's delay after the nearer one, in samples, and its gain."""
        late_s = ear_delays_s(to)
        loud = np.full(2, 1.0 / max(far_m, NEAREST_M))
        return (late_s - late_s.min()) * self.rate_hz, loud

    def _shadows(self, to: Vector) -> Iterator[tuple[Vector, Vector]]:
        for cosine in EARS @ to:
            yield head_shadow(float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))), self.rate_hz)


def ear_delays_s(to: Vector) -> Values:
    """Return the arrival times (2,), s, of a far sound from a direction (3,) at both ears.

    They are relative to the middle of the head, left ear first (Woodworth).
    """
    angle = np.arccos(np.clip(EARS @ to, -1.0, 1.0))
    radius_s = HEAD_RADIUS_M / SOUND_M_S
    direct = -radius_s * np.cos(angle)
    round_head = radius_s * (angle - np.pi / 2)
    late_s: Values = np.where(angle < np.pi / 2, direct, round_head)
    return late_s


def head_shadow(angle_deg: float, rate_hz: int) -> tuple[Vector, Vector]:
    """Return numerator and denominator (2,), (2,) of the filter of a head towards one ear.

    `angle_deg` lies between the ear's own direction and the source. Low tones pass; high ones are
    up to twice as strong at the ear that looks to the source, and a tenth behind the head.
    """
    steep = np.cos(np.radians(min(angle_deg, 180.0) * 180.0 / SHADOW_MIN_DEG))
    alpha = (1 + SHADOW_MIN / 2) + (1 - SHADOW_MIN / 2) * steep
    corner = SOUND_M_S / HEAD_RADIUS_M
    k = rate_hz / corner  # bilinear, by 2·fs / (2·ω0)
    b = np.array([1.0 + alpha * k, 1.0 - alpha * k]) / (1.0 + k)
    return b, np.array([1.0, (1.0 - k) / (1.0 + k)])
