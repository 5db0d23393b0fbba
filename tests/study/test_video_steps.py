"""A lab's own films in a trial: onsets, durations, dropped pictures, sound, and who sees them."""

from pathlib import Path
from typing import Any

import pytest

from benchmarks.film_in_step import RATE_HZ, write_film
from tests.study.test_audible_steps import with_sound
from visavis.cli.quick_tracker import tracker_of
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DesignError
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.film_store import film_store
from visavis.running.quick import quick_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.stimuli.film_file import film_facts
from visavis.study.film_pictures import FilmPictures

pytest.importorskip("av")

STUDY = """
from visavis import Factor, Keys, Race, Study, Text, Video

study = Study("films", "S", factors=[Factor("film", ["one.mp4", "two.mp4"])], calibrate=False)

@study.trial
def trial(t):
    yield t.show(Text("+"), seconds=0.2)
    yield t.show({"film": Video(t.film, width_deg=10)}, name="whole")
    keys = Keys("f", "j", right={"one.mp4": "f", "two.mp4": "j"}[t.film])
    shown = [Video(t.film, width_deg=6, is_heard=False), Text("?")]
    yield t.show(shown, 0.5, until=keys, limit_s=3)

@study.answer
def answer(seen, response, rng):
    film = next(s for s in seen.stimuli if hasattr(s, "file"))
    return Race({"fj"[film.file == "two.mp4"]: 2.0}, noise=0.1, other_s=0.3)
"""


def write_study(folder: Path, text: str = STUDY) -> Path:
    write_film(folder / "one.mp4", 30, is_heard=True)
    write_film(folder / "two.mp4", 30, is_heard=True)
    (folder / "films.py").write_text(text, "utf-8")
    return folder / "films.py"


@pytest.fixture(scope="module", params=["monitor", "headset"])
def recording(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("films")
    keyboard = load_config(SCREEN_EXAMPLE).devices["responses"]
    config = load_config({"monitor": SCREEN_EXAMPLE, "headset": EXAMPLE}[request.param])
    config = config.model_copy(update={"devices": {**config.devices, "responses": keyboard}})
    study = find_study(str(write_study(folder)))
    asked = with_sound(config, folder)
    made = simulated_request(study, study.experiment({}), asked, label="S01", index=0, seed=1)
    return Recording(perform_new(made))


@pytest.mark.slow
def test_a_film_lasts_as_long_as_it_does_and_drops_no_picture(recording: Recording) -> None:
    trials = recording.trials()
    lasts_ms = (trials["whole_off_ns"] - trials["whole_on_ns"]) / 1e6
    assert lasts_ms.to_numpy() == pytest.approx(1000.0, abs=40.0)  # the codec's last frame of sound
    assert {30} == set(trials["whole_film_pictures"])
    assert {0} == set(trials["whole_film_dropped"])


@pytest.mark.slow
def test_a_film_is_heard_with_its_first_picture(recording: Recording) -> None:
    trials = recording.trials()
    apart_ms = (trials["whole_sound_on_ns"] - trials["whole_on_ns"]).abs() / 1e6
    assert (apart_ms < 50).all()
    assert not [name for name in trials if str(name).startswith("stimulus2_sound")]


@pytest.mark.slow
def test_a_film_is_seen_and_answered_and_goes_after_its_seconds(recording: Recording) -> None:
    trials = recording.trials()
    assert trials["answer_is_right"].all()
    lasts_ms = (trials["stimulus2_off_ns"] - trials["stimulus2_on_ns"]) / 1e6
    assert (lasts_ms <= 517.0).all()
    assert (trials["stimulus2_film_pictures"] <= 15).all()


def test_power_lets_the_same_people_see_it(tmp_path: Path) -> None:
    study = find_study(str(write_study(tmp_path)))
    simulated = quick_study(study, study.experiment({}), tracker_of, [0], seed=1)
    assert simulated.trials["answer_is_right"].all()


def test_a_picture_that_no_frame_showed_in_its_time_is_counted(tmp_path: Path) -> None:
    facts = film_facts(write_film(tmp_path / "film.mp4", 30))
    pictures = FilmPictures((facts,), 0)
    for picture in (0, 0, 1, 4, 5):
        pictures.note(round((picture + 0.5) / RATE_HZ * 1e9))
    assert {"a_film_pictures": 4, "a_film_dropped": 2} == pictures.columns("a")


@pytest.mark.parametrize(
    ("step", "told"),
    [
        ('Video("nowhere.mp4", width_deg=3)', "there is no film"),
        ('Video("films.py", width_deg=3)', "no film that can be read"),
        ('Video("one.mp4")', "give width_deg or height_deg"),
        ('Video("one.mp4", width_deg=500)', "width_deg is 500"),
    ],
)
def test_a_film_that_cannot_be_shown_is_told_at_plan(step: str, told: str, tmp_path: Path) -> None:
    text = STUDY.replace("Video(t.film, width_deg=10)", step)
    with pytest.raises(DesignError, match=told):
        _ = find_study(str(write_study(tmp_path, text))).experiment({}).read


def test_a_film_that_few_browsers_play_is_told_at_plan(tmp_path: Path) -> None:
    path = write_study(tmp_path, STUDY.replace("calibrate=False", 'on="browser"'))
    (tmp_path / "two.mp4").write_bytes(write_film(tmp_path / "two.mkv", 30).read_bytes())
    with pytest.raises(DesignError, match=r"two\.mp4: few browsers play such a film"):
        film_store(find_study(str(path)).experiment({}))
