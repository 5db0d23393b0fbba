"""A lab's own films on a page without a browser: simulated people, forged replies, bundles."""

from pathlib import Path
from typing import Any

import pytest

from benchmarks.film_in_step import write_film
from tests.running.page.test_flat_on_page import request_of
from visavis.recording.reader import Recording
from visavis.running.film_store import film_store
from visavis.running.page.other_hosts.bundle import files_of, steps_of_place
from visavis.running.page.perform import perform_new
from visavis.running.page.replies import check_reply
from visavis.running.page.steps import PageError, PageStep

pytest.importorskip("av")

STUDY = """
from visavis import Factor, Keys, Race, Study, Text, Video

study = Study("flats", factors=[Factor("film", ["one.mp4", "two.mp4"])], on="browser", uses=(),
              calibrate=False)

@study.trial
def trial(t):
    keys = Keys("f", "j", right={"one.mp4": "f", "two.mp4": "j"}[t.film])
    yield t.show(Video(t.film, width_deg=10), name="whole")
    yield t.wait(0.1)
    yield t.show([Video(t.film, width_deg=6, is_heard=False), Text("?")], until=keys, limit_s=3)

@study.answer
def answer(seen, response, rng):
    film = next(s for s in seen.stimuli if hasattr(s, "file"))
    return Race({"fj"[film.file == "two.mp4"]: 2.0}, noise=0.1, other_s=0.3)
"""
FILM = {"first_ms": 20.0, "first_at_ms": 33.0, "frames": 30, "dropped": 0, "rounds": 1, "stalls": 0}
HEARD = {"on_ms": 12.0, "error_ms": 0.5, "latency_ms": 20.0, "by": "output_timestamp"}
PART = {"on_ms": 10.0, "off_ms": 300.0, "frames": 1, "dropped": 0}
SHOWN = {
    "shown_ms": 0.0,
    "screen": {"px_per_mm": None, "distance_mm": None},
    "outside": 0,
    "answer": {"option": "f", "at_ms": 500.0, "by": "keys"},
}


def request(folder: Path) -> Any:
    write_film(folder / "one.mp4", 30, is_heard=True)
    write_film(folder / "two.mp4", 30)
    return request_of(STUDY, folder)


def test_a_simulated_person_sees_a_film_for_its_seconds(tmp_path: Path) -> None:
    rows = Recording(perform_new(request(tmp_path))).trials().set_index("film")
    assert rows["answer_is_right"].all()
    assert {30} == set(rows["whole_film_pictures"])
    lasts_ms = (rows["whole_off_ns"] - rows["whole_on_ns"]) / 1e6
    assert lasts_ms.to_numpy() == pytest.approx(1100.0, abs=60.0)  # and `t.wait`
    heard = rows["whole_sound_on_ns"].notna()
    assert {"one.mp4": True, "two.mp4": False} == heard.to_dict()
    assert (rows["whole_sound_on_ns"] == rows["whole_on_ns"])[heard].all()


def test_a_bundle_has_each_film_once_and_a_forged_reply_is_refused(tmp_path: Path) -> None:
    asked = request(tmp_path)
    store = film_store(asked.experiment)
    steps = steps_of_place(asked, store, 0)
    (preload,) = (step for step in steps if step.kind == "preload")
    names = [film["film"] for film in preload.content["films"]]
    own = files_of(store, asked.experiment)[2]
    assert {"one.mp4", "two.mp4"} == {own[name].name for name in names}
    (show,) = (s for s in steps if "two.mp4" in str(s.content) and s.kind == "show")
    parts = [PART | {"films": [FILM]}, PART, PART | {"films": [FILM]}]
    check_reply(PageStep("show", show.content), SHOWN | {"parts": parts})
    with pytest.raises(PageError, match="every part with films says how"):
        check_reply(PageStep("show", show.content), SHOWN | {"parts": [PART] * 3})
