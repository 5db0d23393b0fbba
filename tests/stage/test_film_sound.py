"""Films with sound: a clap seen and heard at once is so again when the film is decoded."""

from pathlib import Path

import numpy as np
import pytest

from visavis.stage.errors import StageError
from visavis.stage.film_sound import add_sound
from visavis.stimuli.sound import Waveform

av = pytest.importorskip("av")
RATE_HZ = 30
CLAPS_S = (0.5, 1.2, 2.9)
CODECS = {".webm": "libvpx-vp9", ".mp4": "libx264"}


def silent_film(path: Path) -> None:
    with av.open(str(path), "w") as film:
        stream = film.add_stream(CODECS[path.suffix], rate=RATE_HZ)
        stream.width = stream.height = 64
        stream.pix_fmt = "yuv420p"
        for k in range(4 * RATE_HZ):
            is_clap = k in [round(clap * RATE_HZ) for clap in CLAPS_S]
            image = np.full((64, 64, 3), 255 if is_clap else 0, np.uint8)
            film.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        film.mux(stream.encode())


def claps(rate_hz: int) -> Waveform:
    samples = np.zeros((4 * rate_hz, 1), np.float32)
    for clap in CLAPS_S:
        first = round(clap * rate_hz)
        samples[first : first + rate_hz // 100] = 0.9
    return Waveform("claps", samples, rate_hz)


def seen_s(path: Path) -> list[float]:
    with av.open(str(path)) as film:
        return [f.time for f in film.decode(video=0) if f.to_ndarray(format="gray").mean() > 128]


def heard_s(path: Path) -> list[float]:
    samples, first_s = [], None
    with av.open(str(path)) as film:
        for frame in film.decode(audio=0):
            first_s = frame.time if first_s is None else first_s
            samples.append(np.asarray(frame.to_ndarray(), np.float64).reshape(-1))
            rate_hz = frame.sample_rate
    loud = np.flatnonzero(np.abs(np.concatenate(samples)) > 0.3)
    begins = loud[np.diff(loud, prepend=-rate_hz) > rate_hz // 4]
    assert first_s is not None
    return [float(first_s + k / rate_hz) for k in begins]


@pytest.mark.parametrize("ending", CODECS)
@pytest.mark.parametrize("rate_hz", [22_050, 48_000])
def test_a_clap_is_heard_within_a_frame_of_its_picture(
    tmp_path: Path, ending: str, rate_hz: int
) -> None:
    silent, path = tmp_path / f"silent{ending}", tmp_path / f"film{ending}"
    silent_film(silent)
    add_sound(silent, path, claps(rate_hz))
    assert seen_s(path) == pytest.approx(CLAPS_S, abs=1e-3)
    assert heard_s(path) == pytest.approx(CLAPS_S, abs=1 / RATE_HZ / 2)


@pytest.mark.parametrize("ending", CODECS)
def test_the_same_film_and_sound_give_the_same_bytes(tmp_path: Path, ending: str) -> None:
    silent = tmp_path / f"silent{ending}"
    silent_film(silent)
    for name in "ab":
        add_sound(silent, tmp_path / f"{name}{ending}", claps(22_050))
    assert (tmp_path / f"a{ending}").read_bytes() == (tmp_path / f"b{ending}").read_bytes()


def test_motion_jpeg_carries_no_sound(tmp_path: Path) -> None:
    with pytest.raises(StageError, match="carry no sound"):
        add_sound(tmp_path / "a.avi", tmp_path / "b.avi", claps(8000))
