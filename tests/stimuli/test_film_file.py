"""Films of a lab's own files: facts, pictures in step, and what is refused by name."""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.film_in_step import RATE_HZ, TONE_HZ, number_of, striped, write_film
from visavis.lab.errors import DesignError
from visavis.stimuli.film_file import MAX_FILE_BYTES, FilmReader, film_facts
from visavis.stimuli.sound import read_sound

av = pytest.importorskip("av")


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_film(tmp_path_factory.mktemp("film") / "film ü.mp4", 45, is_heard=True)


def test_a_film_says_its_size_its_stamps_and_whether_it_is_heard(film: Path) -> None:
    facts = film_facts(film)
    assert (320, 180) == facts.size_px
    assert facts.has_sound
    assert facts.stamps_s == pytest.approx(np.arange(45) / RATE_HZ, abs=1e-3)
    assert 1.5 == pytest.approx(facts.seconds, abs=0.04)


def test_every_time_shows_the_picture_that_is_due_then(film: Path) -> None:
    reader = FilmReader(film, (160, 90))
    for frame in range(100):
        expected = min(44, int(frame / 60 * RATE_HZ + 1e-6))
        assert expected == number_of(reader.picture_at(frame / 60)), frame


@pytest.mark.parametrize("times_s", [(1.2, 0.4, 1.0, 0.0, 0.1), (9.0, 0.0, 1.4, -1.0)])
def test_a_time_before_the_last_is_found_again(film: Path, times_s: tuple[float, ...]) -> None:
    reader = FilmReader(film, (160, 90))
    for t_s in times_s:
        assert int(np.clip(t_s * RATE_HZ + 1e-6, 0, 44)) == number_of(reader.picture_at(t_s))


def test_one_picture_is_one_object_so_that_it_is_drawn_once(film: Path) -> None:
    reader = FilmReader(film, (160, 90))
    assert reader.picture_at(0.100) is reader.picture_at(0.120)


def test_colours_are_those_that_were_written(tmp_path: Path) -> None:
    path = tmp_path / "red.mp4"
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", rate=RATE_HZ)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        red = np.full((64, 64, 3), (200, 30, 60), np.uint8)
        for _ in range(3):
            file.mux(stream.encode(av.VideoFrame.from_ndarray(red, format="rgb24")))
        file.mux(stream.encode())
    middle = FilmReader(path, (64, 64)).picture_at(0.0)[32, 32].astype(int)
    assert (abs(middle - (200, 30, 60, 255)) <= 4).all()


def test_its_sound_begins_with_its_first_picture(film: Path) -> None:
    sound = read_sound(film)
    assert 1.5 == pytest.approx(sound.duration_s, abs=0.05)
    assert TONE_HZ == pytest.approx(sound.pitch_hz, abs=2.0)
    loud = np.flatnonzero(abs(sound.samples[:, 0]) > 0.05)
    assert loud[0] / sound.rate_hz < 0.03  # a codec smears edges


def test_files_that_are_no_whole_film_are_refused_by_name(film: Path, tmp_path: Path) -> None:
    whole = film.read_bytes()
    (tmp_path / "cut.mp4").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "notes.mp4").write_bytes(b"no film " * 500)
    Image.fromarray(striped(5, (32, 32))).save(tmp_path / "still.png")
    with (tmp_path / "large.mp4").open("wb") as large:
        os.truncate(large.fileno(), MAX_FILE_BYTES + 1)
    write_film(tmp_path / "Film.mp4", 3)
    for name, says in (
        ("cut.mp4", "no film that can be read, or cut short"),
        ("notes.mp4", "no film that can be read"),
        ("still.png", "a picture, not a film; show it by Image"),
        ("large.mp4", "500 MB; a film has 500 at most"),
        ("film.mp4", "did you mean Film.mp4"),
        ("nowhere.mp4", "there is no film"),
    ):
        with pytest.raises(DesignError, match=says):
            film_facts(tmp_path / name)


def test_a_webm_that_was_cut_short_says_how_much_is_left(tmp_path: Path) -> None:
    path = tmp_path / "film.mkv"
    whole = write_film(path, 90).read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(DesignError, match=r"cut short, [01]\.\d+ s of 3\.\d+ s"):
        film_facts(path)
