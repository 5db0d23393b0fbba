"""Flat stimuli on a page without a browser: simulated people, forged replies, and bundles."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Files

from tests.sessions import lab_in
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DesignError
from visavis.protocol.plan.session_plan import Trial
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.film_store import film_store
from visavis.running.page.other_hosts.bundle import steps_of_place
from visavis.running.page.perform import perform_new
from visavis.running.page.replies import check_reply
from visavis.running.page.steps import PageError, PageStep, Reply
from visavis.running.page.trial import perform_on_page
from visavis.running.picture_store import PictureStore
from visavis.running.sessions.session_request import simulated_request
from visavis.stimuli.flat import Image
from visavis.study.trial import TrialScript

HEAD = """
from visavis import Factor, Grating, Image, Keys, Race, Shape, Staircase, Study, Text

study = Study("flats", factors=[Factor("ink", ["red", "green"])], on="browser", uses=(),
              calibrate=False, repetitions=3)
"""
STUDY = (
    HEAD
    + """
@study.trial
def trial(t):
    cross = yield t.show(Text("+"), frames=12)
    yield t.dark(0.1)
    keys = Keys("r", "g", right=t.ink[0])
    answer = yield t.show(Text("x", colour=t.ink), seconds=0.2, until=keys, limit_s=2)
    t.row["said"] = answer.option
    t.row["cross_ms"] = None if t.is_read else cross.ms

@study.answer
def answer(seen, response, rng):
    return Race({seen.stimuli[0].colour[0]: 2.0}, noise=0.1, other_s=0.3)
"""
)
STAIRCASE = (
    HEAD
    + """
RULE = Staircase("level", start=0.5, step=0.1, down=1)

@study.trial
def trial(t):
    level = t.staircase(RULE)
    answer = yield t.show(Text("x", colour=t.ink), until=Keys("r", "g"), limit_s=2)
    level.take(answer.option == t.ink[0])

@study.answer
def answer(seen, response, rng):
    return Race({seen.stimuli[0].colour[0]: 2.0}, noise=0.1)
"""
)
SHOWN = {
    "shown_ms": 0.0,
    "parts": [{"on_ms": 1.0, "off_ms": 2.0, "frames": 1, "dropped": 0}] * 3,
    "screen": {"px_per_mm": None, "distance_mm": None},
    "outside": 0,
    "answer": {"option": "r", "at_ms": 2.0, "by": "keys"},
}


def request_of(text: str, folder: Path, index: int = 0) -> Any:
    (folder / "flats.py").write_text(text, "utf-8")
    study = find_study(str(folder / "flats.py"))
    config = lab_in(folder, EXAMPLE)
    label = f"S{index + 1:02d}B"
    return simulated_request(study, study.experiment({}), config, label=label, index=index, seed=1)


def step_and_script(text: str, folder: Path) -> tuple[PageStep, Any, TrialScript]:
    experiment = request_of(text, folder).experiment
    trial = Trial("T1", 1, 0, False, {"ink": "red"}, 1)
    script = TrialScript(trial, experiment.settings)
    performing = perform_on_page(script, experiment.study.trial_plan, lambda image: {})
    step = next(performing)
    assert isinstance(step, PageStep)
    return step, performing, script


def test_a_simulated_person_sees_what_the_page_shows_and_presses_in_their_time(
    tmp_path: Path,
) -> None:
    rows = Recording(perform_new(request_of(STUDY, tmp_path))).trials()
    assert 6 == len(rows)
    assert (rows["answer"] == rows["ink"].str[0]).all()
    assert (rows["said"] == rows["answer"]).all()
    assert (rows["answer_ms"] > 400).all()
    assert {12} == set(rows["stimulus_frames"])
    lasted_ms = (rows["stimulus2_off_ns"] - rows["stimulus2_on_ns"]) / 1e6
    assert lasted_ms.to_numpy() == pytest.approx(200.0, abs=0.1)
    cross_ms = (rows["stimulus_off_ns"] - rows["stimulus_on_ns"]) / 1e6
    assert (rows["cross_ms"] == cross_ms).all()
    gap_ms = (rows["stimulus2_on_ns"] - rows["stimulus_off_ns"]) / 1e6
    assert gap_ms.to_numpy() == pytest.approx(100.0, abs=0.1)


def test_every_visitor_has_a_staircase_of_their_own(tmp_path: Path) -> None:
    first, second = (
        Recording(perform_new(request_of(STAIRCASE, tmp_path, index))).trials()
        for index in range(2)
    )
    expected = 0.5 - 0.1 * np.arange(6)
    assert first["level_level"].to_numpy() == pytest.approx(expected, abs=1e-9)
    assert second["level_level"].to_numpy() == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, ""),
        ({"parts": []}, "parts are what was shown"),
        ({"parts": SHOWN["parts"][:1]}, "the key answers to was not shown"),
        ({"parts": [*SHOWN["parts"], *SHOWN["parts"]]}, "6 parts were shown, not 4"),
        ({"parts": [{"on_ms": 2, "off_ms": 1, "frames": 1, "dropped": 0}] * 3}, "was there"),
        ({"answer": {"option": "q", "at_ms": 2.0, "by": "keys"}}, "'q' is none of its keys"),
        ({"answer": {"option": "r", "at_ms": 2.0, "by": "magic"}}, "none of its keys"),
        ({"screen": {"px_per_mm": 4, "distance_mm": 1}}, "distance_mm is 1"),
        ({"screen": {"px_per_mm": "4"}}, "px_per_mm is not a number"),
        ({"outside": -1}, "outside counts nothing"),
    ],
)
def test_a_forged_reply_about_light_is_refused(
    change: dict[str, Any], says: str, tmp_path: Path
) -> None:
    step, _, _ = step_and_script(STUDY, tmp_path)
    if not says:
        check_reply(step, SHOWN | change)
        return
    with pytest.raises(PageError, match=says):
        check_reply(step, SHOWN | change)


def test_what_is_shown_up_to_an_answer_is_one_step_and_sizes_that_were_not_measured_say_so(
    tmp_path: Path,
) -> None:
    step, performing, script = step_and_script(STUDY, tmp_path)
    assert ["+", "", "x", ""] == [
        "".join(item["text"] for item in part["items"]) for part in step.content["parts"]
    ]
    performing.send(Reply(SHOWN, 0, lambda ms: round(ms * 1e6)))
    assert 37.6 == round(script.row["px_per_deg"], 1)
    assert 0.354 == script.row["size_error_01"]


def test_a_time_that_is_not_known_yet_is_no_number(tmp_path: Path) -> None:
    early = (
        HEAD
        + """
@study.trial
def trial(t):
    shown = yield t.show(Text("+"), seconds=0.5)
    t.row["until"] = None if t.is_read else shown.off_ns
"""
    )
    with pytest.raises(DesignError, match=r"off_ns of what .* is not known yet"):
        step_and_script(early, tmp_path)


def test_a_bundle_has_the_steps_that_a_server_shows_and_refuses_a_staircase(
    tmp_path: Path,
) -> None:
    request = request_of(STUDY, tmp_path)
    steps = steps_of_place(request, film_store(request.experiment), 0)
    assert ["card", "text", *["show"] * 6] == [step.kind for step in steps]
    deep = tmp_path / "deep"
    deep.mkdir()
    level = STAIRCASE.replace('Text("x"', 'Text(f"{level.level:.2f}"')
    request = request_of(level, deep)
    with pytest.raises(DesignError, match="depends on answers"):
        steps_of_place(request, film_store(request.experiment), 0)


def test_a_picture_is_sent_upright_and_without_its_loss(tmp_path: Path) -> None:
    exif = Files.Exif()
    exif[0x0112] = 6
    Files.new("RGB", (40, 20), (1, 2, 3)).save(tmp_path / "turned ü.jpg", exif=exif)
    store = PictureStore((), tmp_path)
    description = store.describe(Image("turned ü.jpg", width_deg=3))
    assert (20, 40) == (description["width_px"], description["height_px"])
    assert store.assets[description["picture"]].startswith(b"\x89PNG")
    assert description["bytes"] == len(store.assets[description["picture"]])
