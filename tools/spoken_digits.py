"""Cut recordings of spoken digits to what is said, for the sound check of pages.

    python -m tools.spoken_digits FROM TO

FROM holds 0.wav to 9.wav (16 bit, one channel, any rate); TO gets them at 16 kHz and 8 bits,
without the silence around, as loud as they can be: at 8 kHz "five" and "nine" are hard to tell
apart. Those of `src/visavis/running/page/digits` were spoken by SVOX Pico.
"""

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.io import wavfile

from visavis.stimuli.sound import read_sound

RATE_HZ = 16_000
QUIET_01 = 0.01
AROUND_S = 0.05
LOUD_01 = 0.9


def cut(samples: npt.NDArray[np.float32], rate_hz: int) -> npt.NDArray[np.float32]:
    """Return what is louder than silence, with a little around it."""
    loud = np.flatnonzero(np.abs(samples) > QUIET_01 * np.abs(samples).max())
    around = round(AROUND_S * rate_hz)
    return samples[max(0, loud[0] - around) : loud[-1] + around]


def main(source: Path, target: Path) -> None:
    """Write every digit."""
    target.mkdir(parents=True, exist_ok=True)
    for digit in range(10):
        sound = read_sound(source / f"{digit}.wav").at_rate(RATE_HZ)
        said = cut(sound.samples[:, 0], RATE_HZ)
        bytes_of = np.round(128 + 127 * LOUD_01 * said / np.abs(said).max()).astype(np.uint8)
        wavfile.write(target / f"{digit}.wav", RATE_HZ, bytes_of)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
