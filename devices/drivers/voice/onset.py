"""Find where somebody begins and stops to speak in blocks of sound, above a room's noise.

The level is that of frames of 1 ms, without what lies below the voice. The noise floor is a low
quantile of the levels of the last seconds in which nothing was loud.
"""

from collections import deque
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from visavis.lab.clock import NS_PER_MS, NS_PER_S

FRAMES_A_SECOND: Final = 1000
LOWEST_HZ: Final = 80.0
"""Hum and rumble below it count little."""
SILENCE_DB: Final = -90.0
"""No floor is lower, relative to full scale: some microphones send zeros while nobody speaks."""
FLOOR_WINDOW: Final = 300
FLOOR_FROM: Final = 30
FLOOR_QUANTILE_01: Final = 0.2
"""The floor is this quantile of up to 300 levels of 10 ms; nothing is pressed before there are 30.
"""
FRAMES_OF_FLOOR: Final = 10
HOLE_NS: Final = 12 * NS_PER_MS
"""A voice may be quiet for so long between two pulses: the period of the deepest voices."""
LOOK_BACK_NS: Final = 4 * NS_PER_MS
RISE_SHARE_01: Final = 2 / 3
"""A voice that rises slowly began before it was loud: where it rose above this share of the
threshold (in dB), at most so long before. A breath stays below it more often than not.
"""
LOUD_SHARE_01: Final = 0.5
"""Share of a sound's frames that are loud; two clicks one after the other have less."""
ROOM_AGAIN_NS: Final = 10 * NS_PER_S
"""What lasts longer is no voice, but a room that has become louder."""


class Turn(NamedTuple):
    """A voice that began or ended, by the card's clock."""

    t_card_ns: int
    is_down: bool


class OnsetDetector:
    """Turn blocks of one channel into onsets and ends of a voice.

    An onset is the first sample of a sound that is loud for `least_ms`, from where it rose above
    a share of the threshold; an end is `release_ms` after its last loud frame.
    """

    def __init__(
        self, rate_hz: float, *, threshold_db: float, least_ms: float, release_ms: float
    ) -> None:
        self._samples = max(1, round(rate_hz / FRAMES_A_SECOND))
        self._frame_ns = round(self._samples * NS_PER_S / rate_hz)
        self._sample_ns = NS_PER_S / rate_hz
        self._threshold_db = threshold_db
        self._least_ns = round(least_ms * NS_PER_MS)
        self._release_ns = round(release_ms * NS_PER_MS)
        pole = float(np.exp(-2 * np.pi * LOWEST_HZ / rate_hz))
        self._b, self._a = np.array([1.0, -1.0]) * (1 + pole) / 2, np.array([1.0, -pole])
        self._memory = np.zeros(1)
        self._rest = np.zeros(0)
        self._floor_db: deque[float] = deque(maxlen=FLOOR_WINDOW)
        self._quiet_powers: list[float] = []
        self._began_ns: int | None = None
        self._loud_frames = 0
        self._last_loud_ns = self._judged_ns = 0
        self._rises_ns: deque[int] = deque(maxlen=LOOK_BACK_NS // NS_PER_MS + 1)
        self.is_down = False

    @property
    def floor_db(self) -> float | None:
        """The room's noise relative to full scale; None until enough of it was heard."""
        if len(self._floor_db) < FLOOR_FROM:
            return None
        place = int(FLOOR_QUANTILE_01 * len(self._floor_db))
        return max(SILENCE_DB, float(np.partition(np.array(self._floor_db), place)[place]))

    @property
    def final_until_ns(self) -> int:
        """The card's time before which nothing turns any more."""
        if self._began_ns is not None and not self.is_down:
            return min(self._began_ns, self._judged_ns - LOOK_BACK_NS)
        return self._judged_ns - LOOK_BACK_NS

    def feed(self, samples: npt.NDArray[np.float32], t_card_ns: int) -> list[Turn]:
        """Take a block (n,) whose first sample was converted at `t_card_ns`; return what turned."""
        high, self._memory = lfilter(self._b, self._a, samples, zi=self._memory)
        first_ns = t_card_ns - round(self._rest.size * self._sample_ns)
        high = np.concatenate((self._rest, high))
        n = high.size // self._samples
        frames, self._rest = high[: n * self._samples], high[n * self._samples :]
        powers = np.square(frames.reshape(n, self._samples)).mean(axis=1)
        floor_db = self.floor_db
        if floor_db is None:
            loud_power = rise_power = np.inf
        else:
            loud_power = 10 ** ((floor_db + self._threshold_db) / 10)
            rise_power = 10 ** ((floor_db + RISE_SHARE_01 * self._threshold_db) / 10)
        turns: list[Turn] = []
        for k, power in enumerate(powers.tolist()):
            t_ns = first_ns + k * self._frame_ns
            if power > rise_power:
                self._rises_ns.append(t_ns)
            self._judge(t_ns, power, power > loud_power, turns)
        return turns

    def _judge(self, t_ns: int, power: float, is_loud: bool, turns: list[Turn]) -> None:
        end_ns = self._judged_ns = t_ns + self._frame_ns
        is_apart = t_ns - self._last_loud_ns > HOLE_NS
        if not self.is_down and is_apart:
            self._began_ns = None
        if is_loud:
            if self._began_ns is None:
                self._began_ns = min(at for at in self._rises_ns if at >= t_ns - LOOK_BACK_NS)
                self._loud_frames = 0
            self._loud_frames += 1
            self._last_loud_ns = end_ns
        lasted_ns = 0 if self._began_ns is None else end_ns - self._began_ns
        if is_loud and not self.is_down:
            is_dense = self._loud_frames * self._frame_ns >= LOUD_SHARE_01 * lasted_ns
            if self._began_ns is not None and lasted_ns >= self._least_ns and is_dense:
                self.is_down = True
                turns.append(Turn(self._began_ns, True))
            elif lasted_ns >= 2 * self._least_ns:
                self._began_ns = None  # a rattle, whose clicks begin no voice
        elif self.is_down and end_ns - self._last_loud_ns >= self._release_ns:
            self.is_down, self._began_ns = False, None
            turns.append(Turn(self._last_loud_ns + self._release_ns, False))
        if lasted_ns > ROOM_AGAIN_NS if self.is_down else not is_loud:
            self._hear_room(power)

    def _hear_room(self, power: float) -> None:
        self._quiet_powers.append(power)
        if len(self._quiet_powers) == FRAMES_OF_FLOOR:
            mean = max(float(np.mean(self._quiet_powers)), 1e-30)
            self._floor_db.append(10 * float(np.log10(mean)))
            self._quiet_powers.clear()
