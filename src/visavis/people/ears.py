"""The ears of a simulated person: what reached them, as one sound after another."""

from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.stimuli.sound import Waveform

APART_S: Final = 0.05
"""Silence of this length parts two sounds; a shorter one belongs to a sound."""
Samples = npt.NDArray[np.float32]


class Ears:
    """Take in blocks of samples for both ears, as a sound card puts them out."""

    def __init__(self) -> None:
        self.hears_new = False
        """Whether a sound began since somebody listened for one."""
        self.began_ns = 0
        """When the latest sound began."""
        self._last_ns = -NS_PER_S
        """When the latest block that was no silence was over."""
        self._sounds: list[tuple[int, list[Samples]]] = []

    def hear(self, samples: Samples, rate_hz: int, t_ns: int) -> None:
        """Take in samples (n, 2) that begin at a session time."""
        if not samples.any():
            return
        silence_s = (t_ns - self._last_ns) / NS_PER_S
        is_apart = silence_s >= APART_S or (silence_s > 0 and not self.hears_new)
        if is_apart or not self._sounds:
            self.began_ns, self.hears_new = t_ns, True
            self._sounds.append((rate_hz, []))
        elif silence_s > 0:
            gap = np.zeros((round(silence_s * rate_hz), 2), np.float32)
            self._sounds[-1][1].append(gap)
        self._sounds[-1][1].append(samples.copy())
        self._last_ns = t_ns + round(len(samples) / rate_hz * NS_PER_S)

    def listen(self) -> None:
        """Await the next sound: what still sounds is not it."""
        self.hears_new = False

    @property
    def sounds(self) -> tuple[Waveform, ...]:
        """Every sound that was heard, without silence before and after it."""
        return tuple(_sound(np.concatenate(blocks), rate) for rate, blocks in self._sounds)


def _sound(samples: Samples, rate_hz: int) -> Waveform:
    loud = np.flatnonzero(samples.any(axis=1))
    return Waveform("heard", samples[loud[0] : loud[-1] + 1], rate_hz)
