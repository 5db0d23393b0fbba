"""A synthetic film all around, whose pictures bear their numbers in every direction."""

from pathlib import Path

import av
import numpy as np
import numpy.typing as npt

RATE_HZ = 10
SIZE_PX = (1920, 960)
STEP = 5


def picture(number: int, eye: int = 0) -> npt.NDArray[np.uint8]:
    """Return a picture (h, 2 h, 3): grey, the brighter the later in the half that is ahead, the
    darker the later behind; the right eye's has no blue.
    """
    wide, high = SIZE_PX
    pixels = np.full((high, wide, 3), 235 - STEP * number, np.uint8)
    pixels[:, wide // 4 : 3 * wide // 4] = 45 + STEP * number
    pixels[..., 2] //= 1 + 3 * eye
    return pixels


def number_ahead(rgb: npt.NDArray[np.uint8]) -> int:
    """Return the number of a picture from a pixel of its half that is ahead."""
    return round((float(rgb[0]) - 45) / STEP)


def number_behind(rgb: npt.NDArray[np.uint8]) -> int:
    """Return the number of a picture from a pixel of its half that is behind."""
    return round((235 - float(rgb[0])) / STEP)


def write_film_around(
    path: Path, pictures: int, *, axis: int | None = None, is_heard: bool = False
) -> Path:
    """Write a film of so many pictures; with an `axis` two eyes' below (0) or beside (1) each
    other; with a tone if it is heard.
    """
    with av.open(str(path), "w") as file:
        eyes = [1, 1] if axis is None else [2 - axis, 1 + axis]
        options = {"preset": "ultrafast", "crf": "12"}
        stream = file.add_stream("libx264", rate=RATE_HZ, options=options)
        stream.height, stream.width = SIZE_PX[1] * eyes[0], SIZE_PX[0] * eyes[1]
        stream.pix_fmt = "yuv420p"
        sound = file.add_stream("aac", rate=48_000, layout="mono") if is_heard else None
        for number in range(pictures):
            image = picture(number)
            if axis is not None:
                image = np.concatenate([image, picture(number, 1)], axis=axis)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        file.mux(stream.encode())
        if sound is not None:
            t_s = np.arange(48_000 * pictures // RATE_HZ) / 48_000
            wave = (0.3 * np.sin(2 * np.pi * 440 * t_s)).astype(np.float32)
            frame = av.AudioFrame.from_ndarray(wave[None], format="fltp", layout="mono")
            frame.sample_rate = 48_000
            file.mux(sound.encode(frame))
            file.mux(sound.encode())
    return path
