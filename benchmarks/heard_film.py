"""Watch and hear one film of the study gestures: is its sound the speech, when are words said?

    python -m benchmarks.heard_film [FILM] [--sheet PICTURE] [--json]

Of a film of the first part of the speech (that of docs/pictures, or FILM), decoded again: how far
its sound is from the recording (cross-correlation; limit half a picture), how alike both are (limit
.95), how much louder it is while words are said than in the pauses between (limit 10 dB), and by
how much the mouth of the script opens where it is loud (correlation with loudness). A sheet has a
picture of every half second, above the spectrogram with the words. Exits with 1 where a limit is
missed.
"""

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import av
import numpy as np
from PIL import Image, ImageDraw
from scipy.signal import correlate, spectrogram

from visavis.experiments.gestures.clips import mouth, speech_file
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.speaking.speech import Utterance, speech_of
from visavis.stimuli.sound import part_of
from visavis.stimuli.text_font import font_for

FILM = Path(__file__).parents[1] / "docs/pictures/gestures_heard.webm"
RATE_HZ = 48_000
STEP_S = 0.01
SHEET_EVERY_S = 0.5
COLUMNS = 11
TILE_PX = (120, 160)
SPECTRUM_PX = 150
TOP_HZ = 6000.0
MIN_ALIKE = 0.95
MIN_LOUDER_DB = 10.0


@dataclass
class FilmSound:
    """What a film was found to hold."""

    pictures: int
    seconds: float
    late_ms: float
    alike: float
    louder_in_words_db: float
    words: int
    mouth_with_loudness: float

    @property
    def is_well(self) -> bool:
        """Whether every limit is kept."""
        frame_ms = 1000 * self.seconds / self.pictures
        return (
            abs(self.late_ms) <= frame_ms / 2
            and self.alike >= MIN_ALIKE
            and self.louder_in_words_db >= MIN_LOUDER_DB
        )


def decoded(path: Path) -> tuple[list[Image.Image], Vector, Vector]:
    """Return pictures, their times, and the sound (48 kHz, one channel)."""
    with av.open(str(path)) as film:
        frames = [
            (float(f.time or 0.0), f.to_ndarray(format="rgb24")) for f in film.decode(video=0)
        ]
    with av.open(str(path)) as film:
        blocks = [np.asarray(f.to_ndarray(), np.float64).ravel() for f in film.decode(audio=0)]
    pictures = [Image.fromarray(image) for _, image in frames]
    return pictures, np.array([t for t, _ in frames]), np.concatenate(blocks)


def loudness_db(sound: Vector) -> Vector:
    """Return the level every `STEP_S`."""
    step = round(STEP_S * RATE_HZ)
    blocks = sound[: len(sound) // step * step].reshape(-1, step)
    return np.asarray(10 * np.log10((blocks**2).mean(axis=1) + 1e-10))


def measure(path: Path) -> FilmSound:
    """Return what is found in a film of the speech's first part."""
    pictures, times, sound = decoded(path)
    seconds = len(pictures) * float(times[-1]) / (len(pictures) - 1)
    speech = speech_of(speech_file())
    first_part = part_of(speech.sound, 0.0, seconds).at_rate(RATE_HZ)
    speech_samples = first_part.samples[:, 0].astype(np.float64)
    product = correlate(sound, speech_samples, mode="full", method="fft")
    late = int(np.argmax(product)) - (len(speech_samples) - 1)
    own = sound[max(late, 0) :]
    count = min(len(own), len(speech_samples))
    alike = float(np.corrcoef(own[:count], speech_samples[max(-late, 0) :][:count])[0, 1])
    level = loudness_db(sound)
    at_s = (np.arange(len(level)) + 0.5) * STEP_S
    words = words_within(speech.words, seconds)
    in_word = np.any([(at_s >= w.start_s) & (at_s < w.end_s) for w in words], axis=0)
    power = 10 ** (level / 10)
    louder_db = 10 * np.log10(power[in_word].mean() / power[~in_word].mean())
    jaw = np.array([mouth().at(t)[0] for t in at_s])
    together = float(np.corrcoef(jaw, np.maximum(level, -60.0))[0, 1])
    return FilmSound(
        len(pictures),
        seconds,
        1000 * late / RATE_HZ,
        alike,
        float(louder_db),
        len(words),
        together,
    )


def words_within(words: tuple[Utterance, ...], seconds: float) -> list[Utterance]:
    """Return the words that are said in so many seconds."""
    return [word for word in words if word.end_s <= seconds]


def draw_sheet(path: Path, film: Path) -> None:
    """Draw pictures of a film, and below them its spectrogram with the words."""
    pictures, times, sound = decoded(film)
    chosen = [
        int(np.argmin(np.abs(times - t))) for t in np.arange(0.0, times[-1] + 1e-6, SHEET_EVERY_S)
    ]
    rows = -(-len(chosen) // COLUMNS)
    width = COLUMNS * TILE_PX[0]
    sheet = Image.new("RGB", (width, rows * TILE_PX[1] + SPECTRUM_PX + 40), (255, 255, 255))
    for k, index in enumerate(chosen):
        place = (k % COLUMNS * TILE_PX[0], k // COLUMNS * TILE_PX[1])
        sheet.paste(pictures[index].resize(TILE_PX), place)
    hz, _, power = spectrogram(sound, RATE_HZ, nperseg=1024, noverlap=512)
    shade = 10 * np.log10(power[hz <= TOP_HZ][::-1] + 1e-12)
    grey = np.clip(255 * (1 - (shade - shade.max() + 70) / 70), 0, 255).astype(np.uint8)
    top = rows * TILE_PX[1]
    sheet.paste(Image.fromarray(grey).resize((width, SPECTRUM_PX)).convert("RGB"), (0, top))
    draw = ImageDraw.Draw(sheet)
    scale = width / (len(sound) / RATE_HZ)
    for k, word in enumerate(words_within(speech_of(speech_file()).words, len(sound) / RATE_HZ)):
        x = word.start_s * scale
        draw.line((x, top, x, top + SPECTRUM_PX + 4), (200, 60, 30))
        where = (x + 2, top + SPECTRUM_PX + 3 + 17 * (k % 2))
        draw.text(where, word.text, (20, 20, 20), font_for(word.text, 12))
    sheet.save(path, quality=85)


def main(arguments: list[str]) -> int:
    """Print what was found."""
    parser = argparse.ArgumentParser(prog="benchmarks.heard_film", description=__doc__)
    parser.add_argument("film", nargs="?", type=Path, default=FILM)
    parser.add_argument("--sheet", type=Path, help="draw a contact sheet with the spectrogram")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    film_sound = measure(options.film)
    if options.sheet:
        draw_sheet(options.sheet, options.film)
    if options.json:
        print(json.dumps(asdict(film_sound), indent=2))
        return not film_sound.is_well
    print(f"{film_sound.pictures} pictures in {film_sound.seconds:.2f} s, {film_sound.words} words")
    print(f"sound late by {film_sound.late_ms:.1f} ms (limit half a picture)")
    print(f"alike the recording {film_sound.alike:.3f} (limit {MIN_ALIKE:g})")
    print(f"louder in words by {film_sound.louder_in_words_db:.1f} dB (limit {MIN_LOUDER_DB:g})")
    print(f"mouth opens with loudness, correlation {film_sound.mouth_with_loudness:.2f}")
    return not film_sound.is_well


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
