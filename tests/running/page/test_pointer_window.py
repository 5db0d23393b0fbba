"""A window after the pointer on a page: sent, recorded, measured, and never called gaze."""

import contextlib
from pathlib import Path
from typing import Any

import pytest
from PIL import Image as Files
from typer.testing import CliRunner

from tests.running.page.test_browser import (
    PATIENCE_S,
    Server,
    playwright_error,
    state_of,
    step_on,
)
from tests.running.page.test_browser import server as server
from tests.sessions import lab_in
from visavis.cli.main import app
from visavis.lab.clock import StopWatch
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DesignError
from visavis.protocol.plan.session_plan import Trial
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.film_store import film_store
from visavis.running.page.other_hosts.bundle import steps_of_place
from visavis.running.page.perform import perform_new as perform_page
from visavis.running.page.replies import check_reply
from visavis.running.page.steps import PageError, PageStep, Reply
from visavis.running.page.trial import perform_on_page
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.study.information import facts_in_event, information_on_page
from visavis.study.measures import TrialRecord
from visavis.study.trial import TrialScript
from visavis.testing import check_study

STUDY = """
from visavis import Compare, Factor, Image, Keys, Study, pointer_at

study = Study("windows", "S", factors=[Factor("side", ["left", "right"])], on="browser", uses=(),
              calibrate=False, repetitions=2, measures=[*pointer_at("door", "lamp")],
              compare=[Compare("door_pointer_ms", within="side")])

@study.trial
def trial(t):
    yield t.show(Image("room.png", width_deg=12, areas="room.yaml"), until=Keys("f", "j"),
                 limit_s=4, reveal="pointer", window_deg=3)
"""
AREAS = "door: {rectangle: [0, 0, 200, 300]}\nlamp: {rectangle: [200, 0, 200, 300], salience: 9}\n"
SCREEN = {"px_per_mm": 4.0, "distance_mm": 600.0}


def study_in(folder: Path, text: str = STUDY) -> Any:
    (folder / "windows.py").write_text(text, "utf-8")
    (folder / "room.yaml").write_text(AREAS, "utf-8")
    picture = Files.new("L", (400, 300))
    picture.putdata([255 * ((i % 400) // 8 % 2) for i in range(400 * 300)])  # stripes
    picture.convert("RGB").save(folder / "room.png")
    return find_study(str(folder / "windows.py"))


def request_of(folder: Path, text: str = STUDY) -> Any:
    study = study_in(folder, text)
    config = lab_in(folder, EXAMPLE)
    return simulated_request(study, study.experiment({}), config, label="S01B", index=0, seed=1)


def reply_of(path: Any) -> dict[str, Any]:
    part = {"on_ms": 1000.0, "off_ms": 3000.0, "frames": 120, "dropped": 0, "pointer": path}
    at = {"shown_ms": 900.0, "hidden_ms": 0.0}
    return {**at, "parts": [part], "screen": SCREEN, "outside": 0, "view_px": [1200, 800]}


def test_time_of_the_window_on_areas_follows_from_its_recorded_path(tmp_path: Path) -> None:
    study = study_in(tmp_path)
    experiment = study.experiment({})
    script = TrialScript(Trial("T1", 1, 0, False, {"side": "left"}, 1), experiment.settings)
    performing = perform_on_page(script, study.study.trial_plan, lambda image: {})
    step = next(performing)
    assert isinstance(step, PageStep)
    assert {"window_deg": 3.0, "blur_deg": 0.375} == step.content["parts"][0]["reveal"]
    # 12 degrees are 252 mm or 1008 px around the middle, at 600: the left half is the door
    path = [[1500.0, 590.0, 400.0], [2000.0, 50.0, 400.0], [2200.0, 610.0, 400.0]]
    path.append([2500.0, 590.0, 400.0])
    reply = Reply({**reply_of(path), "answer": None}, 0, lambda ms: round(ms * 1e6))
    event = performing.send(reply)
    assert "pointer_window" == event.name
    row = {**script.row, "trial_id": "T1"}
    record = TrialRecord(row, None, events=((event.name, event.payload),))
    measured = {m.column: m.of(record) for m in study.study.analysis.measures if m.of}
    assert pytest.approx(1000, abs=10) == measured["door_pointer_ms"]
    assert pytest.approx(0.5, abs=0.01) == measured["door_pointer_share_01"]
    assert (500, 2) == (measured["door_pointer_first_ms"], measured["door_pointer_entries"])
    assert pytest.approx(300, abs=10) == measured["lamp_pointer_ms"]
    assert not any(m.needs_gaze for m in study.study.analysis.measures)


@pytest.mark.parametrize("path", [None, [[1.0, 2.0]], [["a", 1, 2]], [[0.0, 1.0, 2.0]] * 20_001])
def test_a_forged_path_is_refused(path: Any, tmp_path: Path) -> None:
    study = study_in(tmp_path)
    script = TrialScript(
        Trial("T1", 1, 0, False, {"side": "left"}, 1), study.experiment({}).settings
    )
    step = next(perform_on_page(script, study.study.trial_plan, lambda image: {}))
    assert isinstance(step, PageStep)
    check_reply(step, reply_of([]))
    with pytest.raises(PageError, match=r"path|not a number"):
        check_reply(step, reply_of(path))


def test_a_bundle_shows_windows_after_the_pointer(tmp_path: Path) -> None:
    request = request_of(tmp_path)
    steps = steps_of_place(request, film_store(request.experiment), 0)
    assert 4 == sum("reveal" in step.content["parts"][0] for step in steps if step.kind == "show")


def test_simulated_people_uncover_what_is_salient(tmp_path: Path) -> None:
    request = request_of(tmp_path)
    recording = Recording(perform_page(request))
    rows = request.study.measure(recording).rows
    assert rows["lamp_pointer_ms"].sum() > 0
    assert (rows["door_pointer_ms"] + rows["lamp_pointer_ms"] <= 4100).all()
    assert not any("gaze" in c for c in rows if "pointer" in c)
    # Participants were told of it, in the words of what a page records.
    information = information_on_page(request.experiment, ())
    assert any("pointer" in line for line in information.lines)
    facts = frozenset().union(
        *(
            facts_in_event(n, p)
            for n, p in recording.events()[["name", "payload"]].itertuples(index=False)
        )
    )
    assert "pointer" in facts


def test_simulated_people_press_when_the_pointer_has_come_to_what_they_look_for(
    tmp_path: Path,
) -> None:
    rule = """
from visavis import WhenGazeOn

@study.answer
def answer(seen, response, rng):
    return WhenGazeOn("f", "door", seconds=0.1, other_s=0.4)
"""
    request = request_of(tmp_path, STUDY.replace("repetitions=2", "repetitions=9") + rule)
    rows = request.study.measure(Recording(perform_page(request))).rows
    presses = rows[rows["answer_ms"].notna()]
    assert 500 == pytest.approx(
        (presses["answer_ms"] - presses["door_pointer_first_ms"]).median(), abs=20
    )
    silent = rows[rows["answer_ms"].isna()]
    assert silent["door_pointer_first_ms"].isna().all()
    assert len(presses) > len(silent) > 0


def test_such_a_study_is_sound_and_its_power_can_be_simulated(tmp_path: Path) -> None:
    study_in(tmp_path)
    check_study(tmp_path / "windows.py")


def test_a_window_after_the_pointer_is_refused_before_a_monitor_at_plan_already(
    tmp_path: Path,
) -> None:
    text = STUDY.replace('on="browser", uses=(),', "")
    with pytest.raises(DesignError, match='is for pages; write on="browser" in the study'):
        perform_new(request_of(tmp_path, text))
    (tmp_path / "lab_config.yaml").write_text(SCREEN_EXAMPLE.read_text("utf-8"), "utf-8")
    words = ["plan", str(tmp_path / "windows.py"), "--config", str(tmp_path / "lab_config.yaml")]
    assert "is for pages" in str(CliRunner().invoke(app, words).exception)
    wrong = STUDY.replace('"pointer", w', '"mouse", w')
    with pytest.raises(DesignError, match="reveal is 'mouse'"):
        study_in(tmp_path, wrong).experiment({})


GREY = """([x, y]) => {
    const canvas = document.querySelector("canvas.flat[data-part='0']");
    if (!canvas) return []; // the trial has gone on
    const ratio = devicePixelRatio;
    const data = canvas.getContext("2d").getImageData((x - 20) * ratio, y * ratio, 40, 1).data;
    return [...data].filter((_, i) => i % 4 === 0);
}"""


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_browser_shows_the_picture_within_the_window_and_records_where_it_was(
    server: Server, browser: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    study_in(server.root)
    address = server.start("run", "windows.py", "--participant", "1", "--set", "repetitions=1")
    page = browser.new_context(viewport={"width": 1200, "height": 800}).new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(address)
    watch, greys = StopWatch(), []
    while "Thank you" not in state_of(page)["text"]:
        assert watch.elapsed_s() < PATIENCE_S, state_of(page)
        with contextlib.suppress(playwright_error()):  # a page may go on between two looks at it
            if page.query_selector("canvas.flat[data-part='0']"):
                page.mouse.move(500, 400)
                page.wait_for_timeout(200)
                sharp, veiled = (page.evaluate(GREY, [x, 400]) for x in (500, 750))
                if sharp and veiled:
                    greys.append((max(sharp) - min(sharp), max(veiled) - min(veiled)))
                page.mouse.move(700, 400)
                page.wait_for_timeout(100)
                page.keyboard.press("f")
            elif page.query_selector(".slider input[type=range]") and page.query_selector("#far"):
                page.fill("#far", "60")
                page.eval_on_selector(
                    ".slider input", "e => { e.value = 324; e.dispatchEvent(new Event('input')); }"
                )
                step_on(page)
            else:
                step_on(page)
        page.wait_for_timeout(30)
    output = server.end()
    # A busy processor may draw later than it is looked at.
    assert any(sharp > 200 and veiled < 150 for sharp, veiled in greys), greys
    assert [] == problems
    session = server.root / "data/simulated/windows/sub-S01B/ses-001"
    recording = Recording(session)
    assert "complete" == recording.status, output
    events = recording.events()
    assert 2 == (events["name"] == "pointer_window").sum()
    monkeypatch.chdir(server.root)
    result = CliRunner().invoke(app, ["analyse", "data/simulated/windows"])
    assert 0 == result.exit_code, result.output
