"""Show a film to the frame: does every frame show the picture that is due then?

    python -m benchmarks.film_in_step [--minutes 5] [--height 1080] [--json]

A synthetic film (30 pictures a second, H.264, made by PyAV) bears its own numbers in stripes of
black and white. It is read as sessions read it, at 60 frames a second in real time, and every
frame's stripes are compared with the picture that is due by the film's stamps once they are there.
Printed are the largest difference in pictures (limit 1), pictures that no frame showed, and the
time for which the slowest and the usual frame waited for its picture. Exits with 1 where the limit
is missed.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import av
import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.stimuli.film_file import FilmReader

RATE_HZ = 30
DISPLAY_HZ = 60
BITS = 16
TONE_HZ = 440.0
SOUND_HZ = 48_000
MAX_APART = 1


def striped(number: int, size_px: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """Return a picture (h, w, 3) whose upright stripes are the bits of a number."""
    bits = number >> np.arange(BITS)[::-1] & 1
    row = np.repeat(bits * 255, -(-size_px[0] // BITS))[: size_px[0]]
    return np.broadcast_to(row[None, :, None], (size_px[1], size_px[0], 3)).astype(np.uint8)


def number_of(pixels: npt.NDArray[np.uint8]) -> int:
    """Return the number in the stripes of a picture."""
    wide = -(-pixels.shape[1] // BITS)
    middles = pixels[pixels.shape[0] // 2, wide // 2 :: wide, 1][:BITS]
    return int((middles > 127) @ (1 << np.arange(BITS)[::-1]))


def write_film(
    path: Path, pictures: int, size_px: tuple[int, int] = (320, 180), *, is_heard: bool = False
) -> Path:
    """Write a film of so many numbered pictures, with a tone if it is heard."""
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", rate=RATE_HZ, options={"preset": "ultrafast"})
        stream.width, stream.height = size_px
        stream.pix_fmt = "yuv420p"
        sound = file.add_stream("aac", rate=SOUND_HZ, layout="mono") if is_heard else None
        for number in range(pictures):
            image = striped(number, size_px)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        file.mux(stream.encode())
        if sound is not None:
            t_s = np.arange(SOUND_HZ * pictures // RATE_HZ) / SOUND_HZ
            wave = (0.3 * np.sin(2 * np.pi * TONE_HZ * t_s)).astype(np.float32)
            frame = av.AudioFrame.from_ndarray(wave[None], format="fltp", layout="mono")
            frame.sample_rate = SOUND_HZ
            file.mux(sound.encode(frame))
            file.mux(sound.encode())
    return path


def main() -> int:
    """Show the film, and print how it went."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--minutes", type=float, default=5.0)
    arguments.add_argument("--height", type=int, default=1080)
    arguments.add_argument("--json", action="store_true")
    options = arguments.parse_args()
    size_px = (options.height * 16 // 9, options.height)
    pictures = round(60 * options.minutes * RATE_HZ)
    with tempfile.TemporaryDirectory() as folder:
        path = write_film(Path(folder) / "film.mp4", pictures, size_px)
        figures = show(path, size_px)
    figures = {"minutes": options.minutes, "height_px": options.height, **figures}
    print(
        json.dumps(figures) if options.json else "\n".join(f"{k}: {v}" for k, v in figures.items())
    )
    return int(figures["apart_pictures"] > MAX_APART)


def show(path: Path, size_px: tuple[int, int]) -> dict[str, float]:
    """Show a film in real time; return how far its pictures were from those that were due."""
    clock, reader = SystemClock(), FilmReader(path, size_px)
    reader.picture_at(0.0)
    begun_ns, frame_ns = clock.now_ns(), NS_PER_S // DISPLAY_HZ
    apart, waits_ms, seen, frame = 0, [], set[int](), 0
    while frame < round(reader.facts.seconds * DISPLAY_HZ):
        clock.sleep_until_ns(begun_ns + frame * frame_ns)
        asked_ns = clock.now_ns()
        frame = max(frame, (asked_ns - begun_ns) // frame_ns)  # who wakes late shows a later one
        number = number_of(reader.picture_at(frame / DISPLAY_HZ))
        waits_ms.append((clock.now_ns() - asked_ns) / 1e6)
        lit_s = (clock.now_ns() - begun_ns) / NS_PER_S
        seen.add(number)
        apart = max(apart, abs(number - reader.facts.index_at(lit_s)))
        frame += 1
    return {
        "apart_pictures": apart,
        "dropped_pictures": max(seen) + 1 - len(seen),
        "slowest_wait_ms": round(max(waits_ms), 2),
        "median_wait_ms": round(float(np.median(waits_ms)), 2),
    }


if __name__ == "__main__":
    sys.exit(main())
