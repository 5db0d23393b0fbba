"""A microphone behind sounddevice's interface, into which a simulated person speaks.

Whoever presses the control `voice` says a word: a breath before, where the body tells its next
press ahead, then tones of a larynx that rise over 15 ms, for `word_s`. Not modelled: speech,
the room's echo, other people, a microphone's filters and its level control.
"""

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import Body, ForeseeableHand, Hand
from visavis.devices.drivers.voice.spec import VOICE
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.sound_card import (
    BLOCK,
    RATE_HZ,
    SINCE_BOOT_S,
    SimulatedPortAudio,
    SimulatedStream,
)
from visavis.devices.sim.wire_noise import WireNoise
from visavis.lab.clock import NS_PER_S, Clock

PITCH_HZ: Final = 120.0
HARMONICS: Final = np.arange(1, 25)
WEIGHTS: Final = sum(
    share / (1.0 + ((PITCH_HZ * HARMONICS - formant_hz) / width_hz) ** 2)
    for share, formant_hz, width_hz in ((1.0, 500.0, 150.0), (0.4, 1500.0, 200.0))
)
"""Of the tones of a vowel without a place, by two formants."""
PHASES: Final = np.pi * HARMONICS**2 / HARMONICS.size
"""Schroeder's (1970, 10.1109/TIT.1970.1054411): the level is even between two pulses, as it is of
vowels, which ring."""
RISE_S: Final = 0.015
FADE_S: Final = 0.03
BREATH_S: Final = 0.2
CLICK_S: Final = 0.003
NOISE_STREAM: Final = 0x3C


class SimulatedMicrophone(SimulatedPortAudio):
    """The part of sounddevice that `VoiceKey` uses; levels are of full scale, as root mean square.

    `mouth` is the part of the body's presses that are spoken, where others are not.

    Faults: late_start, disconnect, loss (blocks that were not taken in time; the next one reports
    an overflow), burst (blocks are held back and all come when the window ends), silence (no block
    comes).
    """

    def __init__(
        self,
        clock: Clock,
        body: Body,
        *,
        faults: FaultSchedule | None = None,
        latency_ms: float = 20.0,
        drift_ppm: float = 0.0,
        seed: int = 0,
        noise_db: float = -60.0,
        voice_db: float = -25.0,
        word_s: float = 0.3,
        clicks_ns: Sequence[int] = (),
        mouth: Hand | None = None,
    ) -> None:
        super().__init__(clock, faults=faults, latency_ms=latency_ms, drift_ppm=drift_ppm)
        self.noise_db, self.voice_db = noise_db, voice_db
        self._clicks_s = [t_ns / NS_PER_S for t_ns in clicks_ns]
        self._body, self._mouth = body, body if mouth is None else mouth
        self._noise = WireNoise([seed, NOISE_STREAM], body)
        self._word_s, self._last_words_s = word_s, [-np.inf, -np.inf]
        """How long a word lasts, and when the last two began."""

    def InputStream(self, **options: Any) -> "SimulatedInput":  # noqa: N802 - sounddevice's name
        """Open the input."""
        if self.is_active("late_start") or self.is_active("disconnect"):
            raise self.PortAudioError("Device unavailable")
        return SimulatedInput(self, options["callback"])

    def sound(self, block: int) -> npt.NDArray[np.float32]:
        """Return a block (n, 1) by its number since the card was switched on, in order."""
        card_s = (block * BLOCK + np.arange(BLOCK)) / RATE_HZ
        t_s = (card_s - SINCE_BOOT_S) / self.rate
        self.hear_until(round(float(t_s[-1]) * NS_PER_S))
        rng = self._noise.rng()
        samples = _gain(self.noise_db) * rng.normal(size=BLOCK)
        for began_s in self._last_words_s:
            samples += _gain(self.voice_db) * self._word(t_s, began_s)
        samples += _gain(self.noise_db + 8) * self._breath(t_s) * rng.normal(size=BLOCK)
        for click_s in self._clicks_s:
            samples[(t_s >= click_s) & (t_s < click_s + CLICK_S)] += _gain(self.voice_db)
        return samples.astype(np.float32)[:, None]

    def hear_until(self, t_ns: int) -> None:
        """Take what the body says up to a session time."""
        for at_ns, control, value in self._mouth.presses(t_ns):
            if control == VOICE and value > 0.5:
                self._last_words_s = [self._last_words_s[-1], at_ns / NS_PER_S]

    def _word(self, t_s: npt.NDArray[np.float64], began_s: float) -> npt.NDArray[np.float64]:
        ended_s = began_s + self._word_s
        if t_s[-1] < began_s or t_s[0] > ended_s + 10 * FADE_S:
            return np.zeros(BLOCK)
        since_s = t_s - began_s
        phases = 2 * np.pi * PITCH_HZ * np.outer(HARMONICS, since_s) + PHASES[:, None]
        tones = WEIGHTS @ np.sin(phases) / np.sqrt(np.square(WEIGHTS).sum() / 2)
        rise = np.clip(since_s / RISE_S, 0.0, 1.0)
        fade = np.exp(-np.maximum(t_s - ended_s, 0.0) / FADE_S)
        word: npt.NDArray[np.float64] = tones * rise * fade
        return word

    def _breath(self, t_s: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        next_ns = self._body.next_press_ns() if isinstance(self._body, ForeseeableHand) else None
        if next_ns is None:
            return np.zeros(BLOCK)
        ahead_s = next_ns / NS_PER_S - t_s
        return np.where((ahead_s > 0) & (ahead_s < BREATH_S), 1.0, 0.0)


class SimulatedInput(SimulatedStream):
    """An input stream; its time advances at every access."""

    def __init__(self, card: SimulatedMicrophone, callback: Callable[..., None]) -> None:
        super().__init__(card, callback)
        self._microphone = card

    @property
    def latency(self) -> float:
        """Seconds from the first sample of a block to its arrival."""
        return self._card.latency_s + BLOCK / RATE_HZ

    def start(self) -> None:
        """Begin to hear; what was said before is gone."""
        super().start()
        heard_s = self._block * BLOCK / RATE_HZ - SINCE_BOOT_S
        self._microphone.hear_until(round(heard_s / self._card.rate * NS_PER_S))

    def _blocks_due(self) -> int:
        now_s = self._card.card_s(self._card.clock.now_ns()) - self._card.latency_s
        return int(np.floor(now_s * RATE_HZ / BLOCK + 1e-6))

    def _catch_up(self) -> None:
        while self.active and self._block < self._blocks_due():
            if self._card.is_active("burst"):
                return
            samples = self._microphone.sound(self._block)
            first_s = self._block * BLOCK / RATE_HZ
            now_s = self._card.card_s(self._card.clock.now_ns())
            times = SimpleNamespace(currentTime=now_s, inputBufferAdcTime=first_s)
            status = SimpleNamespace(input_overflow=self._misses_block)
            self._block += 1
            if self._card.is_active("silence"):
                continue
            self._misses_block = self._card.is_active("loss")
            if not self._misses_block:
                self._callback(samples, BLOCK, times, status)


def _gain(level_db: float) -> float:
    return float(10.0 ** (level_db / 20.0))
