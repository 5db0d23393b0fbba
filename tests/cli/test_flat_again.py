"""Flat stimuli are seen again: in a frame that is drawn anew, and in a film."""

from pathlib import Path

import numpy as np
import pytest

from tests.sessions import request_in
from visavis.cli.film.film import pictures_of
from visavis.cli.film.on_page import FilmPictures, page_picture
from visavis.cli.recorded_trial import recorded_trial
from visavis.cli.redraw import redraw
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DataError
from visavis.recording.cached import CachedRecording
from visavis.results.flat_again import read_colour, read_items_text
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.page.perform import perform_new as perform_page
from visavis.running.page.seen_trial import seen_trial
from visavis.running.sessions.perform import perform_new
from visavis.stimuli.dots import step_at
from visavis.stimuli.flat import Dots, Grating, Image, Shape, Text
from visavis.stimuli.flat_pixels import moving_pixels

STUDY = """
from visavis import Factor, Grating, Shape, Study, Text

study = Study("again", factors=[Factor("ink", ["red"])], calibrate=False)

@study.trial
def trial(t):
    yield t.show(Shape("rectangle", 8, colour=t.ink), seconds=0.3, background="white")
    yield t.show([Grating(6), Text("ä 'x'", at_deg=(6, 0))], seconds=0.3, background=(9, 9, 9))
"""
"""A red square on white, then a grating and a text."""


def test_a_description_in_an_event_is_read_back_whole() -> None:
    items = (
        Text("a 'quoted'\n\"line\"", colour=(1, 2, 3)),
        Image("ä b😀.png", width_deg=3),
        Shape("cross", 2, line_deg=0.2),
        Grating(3, 2, 0.5, mask="circle"),
        Dots(0.3, 90, lifetime_s=0.2, seed=5),
    )
    assert items == read_items_text(str(items))
    assert (items[0],) == read_items_text(str(items[:1]))
    assert ("grey", (1, 2, 3)) == (read_colour("grey"), read_colour("(1, 2, 3)"))


@pytest.mark.parametrize("text", ["(Text(", "(open('x'),)", "(Text('x'),)", "(Text(text=f()),)"])
def test_a_text_that_describes_none_is_no_stimulus(text: str) -> None:
    with pytest.raises(DataError, match="no flat stimuli"):
        read_items_text(text)


def performed(
    file: Path, text: str, lab: Path = SCREEN_EXAMPLE
) -> tuple[OpenedStudy, CachedRecording]:
    """Return a study, by its file, and a session of it."""
    file.write_text(text, "utf-8")
    study = find_study(str(file))
    request = request_in(file.parent, study, lab)
    return study, CachedRecording(perform_new(request))


def test_a_frame_is_drawn_again_with_what_was_shown(tmp_path: Path) -> None:
    study, recording = performed(tmp_path / "again.py", STUDY)
    row = recording.trials().iloc[0]
    frames = recording.stream_arrays("frames", part=1)

    def frame_after(t_ns: int) -> int:
        return int(frames["frame_index"][np.searchsorted(frames["t_host_ns"], t_ns + 100_000_000)])

    square, _ = redraw(study, recording, frame_after(int(row["stimulus_on_ns"])))
    height, width, _ = square.shape
    assert [255, 0, 0] == square[height // 2, width // 2].tolist()
    assert [255, 255, 255] == square[5, 5].tolist()
    grating, _ = redraw(study, recording, frame_after(int(row["stimulus2_on_ns"])))
    assert [9, 9, 9] == grating[5, 5].tolist()
    middle = grating[height // 2 - 60 : height // 2 + 60, width // 2 - 60 : width // 2 + 60, 0]
    assert 200 < middle.max()
    assert 60 > middle.min()

    film = pictures_of(study, recorded_trial(recording, str(row["trial_id"])))
    assert 1 == len(film(int(row["stimulus_on_ns"]) + 100_000_000).sheets)
    assert 2 == len(film(int(row["stimulus2_on_ns"]) + 100_000_000).sheets)


ON_PAGE = """
from visavis import Factor, Rating, Shape, Staircase, Study

RULE = Staircase("level", start=0.5, step=0.1, down=1)
study = Study("seen", factors=[Factor("ink", ["red", "blue"])], on="browser", uses=(),
              calibrate=False)

@study.trial
def trial(t):
    level = t.staircase(RULE)
    yield t.show(Shape("rectangle", 10 * level.level, colour=t.ink), 0.3, background="white")
    yield t.ask(Rating("liked", 1, 7))
    level.take(True)
"""


def test_a_film_of_a_page_shows_what_was_lit_and_then_what_was_asked(tmp_path: Path) -> None:
    (tmp_path / "seen.py").write_text(ON_PAGE, "utf-8")
    study = find_study(str(tmp_path / "seen.py"))
    request = request_in(tmp_path, study, EXAMPLE)
    recording = CachedRecording(perform_page(request))
    rows = recording.trials()
    for (_, row), size_deg in zip(rows.iterrows(), (5.0, 4.0), strict=True):
        trial = seen_trial(study, recording, dict(row))
        shown, asked = trial.steps
        (part,) = shown.parts
        assert (row["stimulus_on_ns"], row["stimulus_off_ns"]) == (part.on_ns, part.off_ns)
        assert size_deg == pytest.approx(part.scene.items[0].width_deg)
        assert ["liked"] == [question.name for question in asked.questions]
        films = FilmPictures(trial.store, 100, lambda *of: np.zeros((1, 1, 3), np.uint8))
        lit = page_picture(shown, part.on_ns, films, (640, 360))
        assert {"red": [255, 0, 0], "blue": [0, 80, 255]}[row["ink"]] == lit[180, 320].tolist()
        assert [255, 255, 255] == lit[5, 320].tolist()
        assert [0, 0, 0] == lit[5, 5].tolist()  # beside a window of 1280 by 800
        wide_px = int((lit[180, 40:600, 1] < 200).sum())
        assert wide_px == pytest.approx(39.6 * size_deg * 576 / 1280, rel=0.03)


STUDY_WITH_REPEAT = """
from visavis import Factor, Shape, Study

study = Study("again", factors=[Factor("ink", ["red"])], on="browser", uses=(), calibrate=False)

@study.trial
def trial(t):
    yield t.show(Shape("rectangle", 5, colour=t.ink), 0.3)
    yield t.repeat("to see it twice", at_most=1)
"""


def test_of_a_trial_that_was_performed_again_the_last_attempt_is_seen(tmp_path: Path) -> None:
    (tmp_path / "again.py").write_text(STUDY_WITH_REPEAT, "utf-8")
    study = find_study(str(tmp_path / "again.py"))
    recording = CachedRecording(perform_page(request_in(tmp_path, study, EXAMPLE)))
    attempts = [dict(row) for _, row in recording.trials().iterrows()]
    assert 2 == len(attempts)
    for row in attempts:
        trial = seen_trial(study, recording, row)
        assert [row["stimulus_on_ns"]] == [p.on_ns for step in trial.steps for p in step.parts]
        assert "" == trial.problem


MOVING = """
from visavis import Dots, Factor, Study, Text

study = Study("moving", factors=[Factor("way", [0])], calibrate=False)

@study.trial
def trial(t):
    yield t.show(Text("+"), seconds=0.2)
    yield t.show([Dots(0.5, t.way, lifetime_s=0.2), Text("+")], seconds=0.3)
    yield t.wait(0.2)
    yield t.show(Dots(0.5, t.way), seconds=0.1)
"""


def test_moving_dots_are_drawn_again_as_they_stood_in_their_frame(
    tmp_path: Path,
) -> None:
    study, recording = performed(tmp_path / "moving.py", MOVING)
    row = recording.trials().iloc[0]
    trial = recorded_trial(recording, str(row["trial_id"]))
    events = recording.events()
    shown = list(events.loc[events["name"] == "shown", "payload"])
    (dots, _), (other,) = (read_items_text(shown[k]["option_items"]) for k in (1, 2))
    assert dots.seed is not None
    assert dots.seed != other.seed  # each showing has its own
    on_ns = int(row["stimulus2_on_ns"])
    assert abs(shown[1]["moves_since_ns"] - on_ns) < 3_000_000
    film = pictures_of(study, trial)
    frame_ns = 1e9 / 60
    for frame in (0, 7, 12, 25):  # the last while the trial waits
        t_ns = on_ns + round((frame + 0.9) * frame_ns)  # it stays as it is up to the next one
        sheet = film(t_ns).sheets[0]
        high, wide = sheet.pixels.shape[:2]
        step = step_at(dots, frame / 60)
        assert (moving_pixels(dots, (wide, high), step) == sheet.pixels).all(), frame
    frames = recording.stream_arrays("frames", part=1)
    k = int(np.searchsorted(frames["t_host_ns"], on_ns + 100_000_000))
    first, again = (redraw(study, recording, int(frames["frame_index"][i]))[0] for i in (k, k))
    (later, _) = redraw(study, recording, int(frames["frame_index"][k + 6]))
    assert (first == again).all()
    assert (first != later).any()
