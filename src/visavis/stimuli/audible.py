"""What is heard as data: tones and a lab's own sounds, shown like texts and pictures."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.stimuli.sound import MAX_S, Waveform

Ear: TypeAlias = Literal["both", "left", "right"]
TONE_RATE_HZ: Final = 48_000
RAMP_S: Final = 0.005
"""A tone rises and falls for so long, by half a cosine: without, it clicks."""
MIN_HZ, MAX_HZ = 20.0, 20_000.0
MIN_LEVEL_DB: Final = -120.0
MAX_GAIN_DB: Final = 20.0


@dataclass(frozen=True)
@of_kinds()
class Tone:
    """A sinusoidal tone of `frequency_hz` for some seconds, with ramps of 5 ms in them.

    `level_db` is relative to full scale: 0 is the loudest sine that can be played. `ear` is who
    hears it.
    """

    frequency_hz: float
    seconds: float = 0.2
    level_db: float = -20.0
    ear: Ear = "both"

    def __post_init__(self) -> None:
        if not MIN_HZ <= self.frequency_hz <= MAX_HZ:
            raise DesignError(
                f"Tone: frequency_hz is {self.frequency_hz:g}; from {MIN_HZ:g} to {MAX_HZ:g}"
            )
        if not 2 * RAMP_S <= self.seconds <= MAX_S:
            raise DesignError(
                f"Tone: seconds is {self.seconds:g}; from {2 * RAMP_S:g}, for its two ramps, to "
                f"{MAX_S:g}"
            )
        _require_level("Tone", self.level_db)


@dataclass(frozen=True)
@of_kinds(file=str | Path, level_db=float | np.ndarray | None)
class Sound:
    """A sound of a file beside the study's (WAV, FLAC or OGG).

    Without `level_db` it is as loud as it was recorded; with it, its root mean square over the
    whole file is so many decibels relative to that of the loudest sine. `ear` is who hears it: one
    ear gets the mean of both channels.
    """

    file: str
    level_db: float | None = None
    ear: Ear = "both"

    def __post_init__(self) -> None:
        if isinstance(self.level_db, np.ndarray):
            raise DesignError(
                "Sound names a file; samples of your own are Waveform(name, samples, rate_hz), "
                "which t.play plays"
            )
        object.__setattr__(self, "file", str(self.file))
        if not self.file:
            raise DesignError("Sound: name its file, which lies beside the study's")
        if self.level_db is not None:
            _require_level(f"Sound {self.file!r}", self.level_db)


Audible: TypeAlias = Tone | Sound
"""What is heard when it is shown."""


def tone_waveform(tone: Tone) -> Waveform:
    """Return a tone at full scale, for one ear or as one channel for both."""
    count = round(tone.seconds * TONE_RATE_HZ)
    t_s = (np.arange(count) + 0.5) / TONE_RATE_HZ
    edge_s = np.minimum(t_s, t_s[::-1])
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.minimum(edge_s / RAMP_S, 1.0))
    samples = (ramp * np.sin(2 * np.pi * tone.frequency_hz * t_s)).astype(np.float32)
    whole = Waveform(f"{tone.frequency_hz:g} Hz", samples[:, None], TONE_RATE_HZ)
    return at_ear(whole, tone.ear)


def at_ear(sound: Waveform, ear: Ear) -> Waveform:
    """Return a sound as one ear hears it, in silence at the other; of `both` unchanged."""
    if ear == "both":
        return sound
    samples = np.zeros((len(sound.samples), 2), np.float32)
    samples[:, ("left", "right").index(ear)] = sound.samples.mean(axis=1)
    return replace(sound, samples=samples)


def gain_db_of(audible: Audible, sound: Waveform) -> float:
    """Return by how many decibels the samples of a stimulus are played louder than they are.

    Raises:
        DesignError: they would be cut at full scale, or have to be made louder than a card does.
    """
    if isinstance(audible, Tone):
        return audible.level_db
    gain_db = 0.0 if audible.level_db is None else audible.level_db - sound.level_db
    peak_db = sound.peak_db + gain_db
    if peak_db > 0.01:
        highest_db = math.floor(10 * (sound.level_db - sound.peak_db)) / 10
        raise DesignError(
            f"{audible.file}: {peak_db:.1f} dB above full scale, where it would be cut; give it "
            f"level_db={highest_db:g} or less"
        )
    if gain_db > MAX_GAIN_DB:
        raise DesignError(
            f"{audible.file}: {gain_db:.1f} dB louder than it was recorded are more than "
            f"{MAX_GAIN_DB:g}; record it louder, or lower level_db"
        )
    return gain_db


def _require_level(what: str, level_db: float) -> None:
    if not MIN_LEVEL_DB <= level_db <= 0.0:
        raise DesignError(
            f"{what}: level_db is {level_db:g}; decibels relative to full scale, from "
            f"{MIN_LEVEL_DB:g} to 0"
        )
