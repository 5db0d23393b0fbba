"""Tones and sounds of a study as pages get them: the samples that a sound card here would play."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from typing import Any, Final

import numpy as np

from visavis.lab.errors import DesignError
from visavis.stimuli.audible import TONE_RATE_HZ, Audible, Tone, gain_db_of
from visavis.stimuli.sound import Waveform

PAGE_RATE_HZ: Final = TONE_RATE_HZ
MAX_PAGE_S: Final = 180.0
"""Longest sound that a page loads: 69 MB in stereo."""


@dataclass(frozen=True, eq=False)
class SoundStore:
    """The sounds of a study; `assets` maps names, the SHA-256 of files, to their content."""

    sound_of: Callable[[Audible], Waveform]
    assets: dict[str, bytes] = field(default_factory=dict)

    def describe(self, audible: Audible, *, is_simulated: bool = False) -> dict[str, Any]:
        """Return what a page must know about a sound; simulated people need no file.

        Raises:
            DesignError: its file cannot be played.
        """
        sound = self.sound_of(audible)
        gain_db = gain_db_of(audible, sound)
        description = {
            "title": sound.name,
            "sound_sha256": sound.sha256,
            "length_s": sound.duration_s,
            "gain_db": gain_db,
            "channels": sound.samples.shape[1],
        }
        if is_simulated:
            return description | {"sound": "", "bytes": 0}
        name, data = _file_of(sound, gain_db)
        self.assets[name] = data
        return description | {"sound": name, "bytes": len(data)}


def require_fit(audible: Audible, seconds: float) -> None:
    """Refuse a sound that is too long for a page, which loads it whole.

    Raises:
        DesignError: saying how long it may be.
    """
    if seconds > MAX_PAGE_S:
        name = "Tone" if isinstance(audible, Tone) else audible.file
        raise DesignError(
            f"{name}: {seconds:.0f} s of sound are more than a page loads before it begins; "
            f"{MAX_PAGE_S:g} s at most. Cut it, or let it be heard in the laboratory"
        )


@lru_cache(maxsize=256)
def _file_of(sound: Waveform, gain_db: float) -> tuple[str, bytes]:
    """Return samples as they leave a card, one channel after another, and their hash."""
    loud = sound.at_rate(PAGE_RATE_HZ).samples * np.float32(10 ** (gain_db / 20))
    data = loud.T.astype("<f4").tobytes()
    return sha256(data).hexdigest(), data
