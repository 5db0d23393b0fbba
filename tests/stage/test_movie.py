import io
import shutil
import struct
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from visavis.stage.errors import StageError
from visavis.stage.movie import film_program, open_movie, picture_times_ns

SIZE = (64, 48)


def frames(n=5):
    for k in range(n):
        frame = np.full((SIZE[1], SIZE[0], 3), 40 * k, dtype=np.uint8)
        frame[:, : 8 * k] = (200, 30, 30)
        yield frame


@pytest.mark.parametrize(
    ("count", "seconds", "rate_hz"),
    [(6, 6, 1), (12, 0.5, 24), (2, 0.5, 4), (7, 1, 7), (240, 1, 240), (1, 0, 25), (3, 2.5, 1)],
)
def test_a_film_has_as_many_pictures_as_its_time_holds(count, seconds, rate_hz):
    times = picture_times_ns(5, 5 + round(seconds * 1e9), rate_hz)
    assert count == len(times)
    assert 5 == times[0]
    assert all(abs(t - 5 - k * 1e9 / rate_hz) < 1 for k, t in enumerate(times))


def chunks(data, start, end):
    """Yield (name, start of the content, length) of RIFF chunks, entering lists."""
    while start + 8 <= end:
        name, length = data[start : start + 4], struct.unpack_from("<I", data, start + 4)[0]
        yield name, start + 8, length
        if name == b"LIST":
            yield from chunks(data, start + 12, start + 8 + length)
        start += 8 + length + length % 2


def test_film_holds_every_frame_where_its_index_says(tmp_path):
    path = tmp_path / "film.avi"
    with open_movie(path, SIZE, 25) as film:
        for frame in frames():
            film.add(frame)
    data = path.read_bytes()
    assert data[:4] + data[8:12] == b"RIFFAVI "
    assert struct.unpack_from("<I", data, 4)[0] == len(data) - 8
    found = list(chunks(data, 12, len(data)))
    assert 5 == sum(name == b"00dc" for name, _, _ in found)
    movi = data.index(b"movi")
    at, length = next((a, n) for name, a, n in found if name == b"idx1")
    for k, expected in enumerate(frames()):
        _, _, offset, size = struct.unpack_from("<4sIII", data, at + 16 * k)
        start = movi + offset + 8
        got = np.asarray(Image.open(io.BytesIO(data[start : start + size])))
        assert np.abs(got.astype(int) - expected).mean() < 3
    assert length == 16 * 5
    main = next(a for name, a, _ in found if name == b"avih")
    period_us, _, _, _, total = struct.unpack_from("<5I", data, main)
    assert (40_000, 5) == (period_us, total)


def test_film_never_replaces_a_file(tmp_path):
    path = tmp_path / "film.avi"
    path.write_bytes(b"precious")
    with pytest.raises(StageError, match="exists already"):
        open_movie(path, SIZE, 25)
    assert path.read_bytes() == b"precious"


@pytest.mark.parametrize("name", ["film.avi", "film.mp4"])
def test_a_film_that_is_given_up_leaves_no_file_and_can_be_made_again(name, tmp_path):
    try:
        film_program(tmp_path / name)
    except StageError as problem:
        pytest.skip(str(problem))
    film = open_movie(tmp_path / name, SIZE, 25)
    film.add(next(iter(frames())))
    film.__exit__(KeyError, KeyError("no camera"), None)
    assert [] == list(tmp_path.iterdir())
    with open_movie(tmp_path / name, SIZE, 25) as film:
        film.add(next(iter(frames())))
    assert [name] == [path.name for path in tmp_path.iterdir()]


def test_frame_of_another_size_is_refused(tmp_path):
    with (
        open_movie(tmp_path / "film.avi", SIZE, 25) as film,
        pytest.raises(StageError, match="64 × 48"),
    ):
        film.add(np.zeros((10, 10, 3), dtype=np.uint8))


def test_unknown_ending_is_refused_with_those_that_work(tmp_path):
    with pytest.raises(StageError, match=r"\.avi, \.mp4 or \.webm"):
        open_movie(tmp_path / "film.gifv", SIZE, 25)


def decoded(program, path):
    """Return a film's frames as a player shows them, and what the program says of it."""
    command = [program, "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command, capture_output=True, check=True)
    raw = np.frombuffer(done.stdout, np.uint8)
    return raw.reshape(-1, SIZE[1], SIZE[0], 3), done.stderr.decode()


@pytest.mark.parametrize("name", ["film.mp4", "film.WEBM"])
def test_film_of_the_program_shows_every_frame_in_its_colours(name, tmp_path):
    try:
        program = film_program(tmp_path / name)
    except StageError as problem:
        pytest.skip(str(problem))
    with open_movie(tmp_path / name, SIZE, 25) as film:
        for frame in frames():
            film.add(frame)
    seen, told = decoded(program, tmp_path / name)
    assert 5 == len(seen)
    for expected, got in zip(frames(), seen, strict=True):
        flat = expected[:, -8:].astype(float)  # away from the edge, where colour is halved
        assert np.abs(got[:, -8:] - flat).max() <= 4
    red = seen[4][10:-10, 4:20].reshape(-1, 3).mean(0)
    assert (200, 30, 30) == pytest.approx(red, abs=4)
    assert "yuv420p(tv, bt709" in told
    assert "25 fps" in told


def test_film_the_program_cannot_write_is_refused_with_its_words(tmp_path):
    try:
        film_program(tmp_path / "film.mp4")
    except StageError as problem:
        pytest.skip(str(problem))
    film = open_movie(tmp_path / "no folder" / "film.mp4", SIZE, 25)
    with pytest.raises(StageError, match="No such file"):
        film.close()


def test_without_ffmpeg_the_way_out_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(StageError, match=r"visavis\[films\].* or name the film \.avi"):
        open_movie(tmp_path / "film.mp4", SIZE, 25)
