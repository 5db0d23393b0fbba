"""A session's page in a headset: where one stands, what both eyes see, hands, how it is served."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from typer.testing import CliRunner

from tests.cli.test_view import page as page
from tests.cli.test_view_flat import Page
from tests.cli.test_view_flat import page as flat
from tests.running.page.test_browser import PATIENCE_S, npm_script
from tests.running.page.test_serving import COMMAND
from visavis.cli.app import app
from visavis.cli.commands import view
from visavis.cli.viewer.page import CODE
from visavis.lab.eye_height import MIN_EYE_M
from visavis.lab.geometry import Vector, rotate
from visavis.recording.cached import CachedRecording

flat = flat  # a fixture
HEADSETS = Path(__file__).parents[1] / "running" / "page" / "headsets"
SIDE_PX = 160
"""An eye of the headset of the tests sees 90° on so many pixels."""
EYES_M = (-0.032, 0.032)
OWN_HEIGHT_M = 1.6
AHEAD = np.array([0.0, 0.0, -1.0])
BUTTON = "#enter-vr:not([disabled])"


# ---- what is refused ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--lan"], "say --headset, too"),
        (["--headset", "--rerun", "a.rrd"], "give it without --headset"),
    ],
)
def test_options_that_do_not_fit_a_headset_are_refused(words: list[str], problem: str) -> None:
    result = CliRunner().invoke(app, ["view", "nothing", *words])
    assert problem in str(result.exception)


@pytest.mark.parametrize(
    ("owner", "name", "instead", "problem"),
    [
        (view, "is_on_page", lambda _: True, "no place to stand in"),
        (CachedRecording, "stream_names", ("gaze",), "no stream of the head"),
    ],
    ids=["on a page", "without a head"],
)
def test_a_session_in_which_nobody_stood_anywhere_is_refused(
    page: Path,
    owner: Any,
    name: str,
    instead: Any,
    problem: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    session = next(page.parent.glob("simulated/duel/sub-*/ses-001"))
    monkeypatch.setattr(owner, name, instead)
    result = CliRunner().invoke(app, ["view", str(session), "--headset"])
    assert problem in str(result.exception)


def test_eyes_are_so_high_over_a_floor_as_in_recordings() -> None:
    (code,) = (file for file in CODE if file.name == "headset.js")
    assert f"const LOWEST_EYE_M = {MIN_EYE_M};" in code.read_text("utf-8")


# ---- what both eyes see -------------------------------------------------------------------------


def open_page(browser: Any, page: Path, *scripts: str) -> tuple[Any, list[str]]:
    """Return a page with a headset's button, opened after scripts, and what goes wrong on it."""
    tab = browser.new_context(viewport={"width": 900, "height": 300}).new_page()
    problems: list[str] = []
    tab.on("pageerror", lambda error: problems.append(str(error)))
    for script in scripts:
        tab.add_init_script(script)
    tab.goto(page.as_uri())
    tab.wait_for_selector("body[data-ready]", timeout=PATIENCE_S * 1000)
    tab.evaluate("viewer.content.header.headset = true; viewer.headset = new Headset(viewer)")
    return tab, problems


def put_on(browser: Any, page: Path, which: str) -> tuple[Any, list[str]]:
    """Return a page with a headset of the tests put on, and what goes wrong on it."""
    emulator = [npm_script("iwer", "build/iwer.min.js")] if which == "emulator" else []
    scripts = [(HEADSETS / f"{name}.js").read_text("utf-8") for name in ("seldom", which)]
    tab, problems = open_page(browser, page, *emulator, *scripts)
    tab.locator(BUTTON).click()
    look(tab)
    return tab, problems


def look(tab: Any) -> None:
    """Wait until the headset has had new pictures."""
    frames = tab.evaluate("viewer.headset.frames")
    tab.wait_for_function(f"viewer.headset.frames > {frames + 2}", timeout=PATIENCE_S * 1000)


def pictures(tab: Any) -> npt.NDArray[np.int64]:
    """Return what the left and the right eye see: (2, rows from below, columns, colours)."""
    look(tab)
    picture = tab.evaluate("drive.picture()")
    both = np.array(picture["bytes"]).reshape(SIDE_PX, 2, SIDE_PX, 4)
    return both.transpose(1, 0, 2, 3)[..., :3]


def yaw_of(turn: Sequence[float]) -> float:
    """Return how far a head is turned about the vertical, to the left, in radians."""
    facing = rotate(np.array(turn), AHEAD)
    return float(np.arctan2(-facing[0], -facing[2]))


def turn_of(yaw_rad: float) -> Vector:
    return np.array([np.cos(yaw_rad / 2), 0.0, np.sin(yaw_rad / 2), 0.0])


def pixels(place_m: Sequence[float], head_m: Vector, yaw_rad: float) -> Vector:
    """Return column and row from below (2, 2) of a place for each eye of a level head."""
    places = []
    for eye_m in EYES_M:
        eye = head_m + rotate(turn_of(yaw_rad), np.array([eye_m, 0.0, 0.0]))
        x, y, z = rotate(turn_of(-yaw_rad), np.array(place_m) - eye)
        places.append([SIDE_PX / 2 * (1 + x / -z), SIDE_PX / 2 * (1 + y / -z)])
    return np.array(places)


@pytest.mark.slow  # a browser
@pytest.mark.parametrize("own_yaw_deg", [0.0, 15.0])
def test_both_eyes_see_a_flat_stimulus_from_where_the_participant_s_head_was(
    flat: Page, browser: Any, own_yaw_deg: float
) -> None:
    tab, problems = put_on(browser, flat.file, "standard")
    row = flat.recording.trials().iloc[0]
    scene = flat.scene(row, "square")
    head = tab.evaluate(
        "t => { viewer.show.gaze = false; viewer.seek(t); viewer.headset.stand = null;"
        "return viewer.streams.headAt(t); }",
        scene["t0"] + 0.1,
    )
    look(tab)  # and stands there; then they turn
    turn = turn_of(np.radians(own_yaw_deg)).tolist()
    tab.evaluate("turn => drive.head([0, 1.6, 0], turn)", turn)
    yaw_rad = yaw_of(head["turn"]) + np.radians(own_yaw_deg)
    expected = pixels(scene["flat"]["sheets"][-1]["at"], np.array(head["at"]), yaw_rad)
    middles = []
    for picture in pictures(tab):
        is_red = (picture[..., 0] > 200) & (picture[..., 1:] < 60).all(axis=-1)
        rows, columns = np.nonzero(is_red)
        middles.append([columns.mean() + 0.5, rows.mean() + 0.5])
    assert np.allclose(expected, middles, atol=1.0)
    parallax = expected[0, 0] - expected[1, 0]
    assert parallax > 2.0
    assert parallax == pytest.approx(middles[0][0] - middles[1][0], abs=0.6)
    assert not problems


@pytest.mark.slow  # a browser
def test_people_stand_before_the_participant_s_place_as_one_s_own_height_shows_them(
    page: Path, browser: Any
) -> None:
    tab, problems = put_on(browser, page, "standard")
    head, agents = tab.evaluate(
        """() => { const scene = viewer.header.scenes.find(s => s.agents.length);
        const facing = t => Math.abs(rotate(viewer.streams.headAt(t).turn, [0, 0, -1])[0]);
        let t = scene.t0; // when they faced aside most
        for (let s = t; s < scene.t1; s += 0.1) if (facing(s) > facing(t)) t = s;
        viewer.show.gaze = false; viewer.seek(t); viewer.headset.stand = null;
        return [viewer.streams.headAt(t), scene.agents.map(a => a.at)]; }"""
    )
    assert len(agents) == 2
    eye_m = np.array([head["at"][0], OWN_HEIGHT_M, head["at"][2]])
    assert eye_m[1] > head["at"][1] + 0.3  # they sat
    assert abs(yaw_of(head["turn"])) > 0.1
    both = pictures(tab)
    tab.evaluate("viewer.show.people = false")
    differs = (np.abs(both - pictures(tab)) > 20).any(axis=-1)
    for agent in agents:
        for is_there, up_m in ((True, 0.0), (False, 0.35)):
            places = pixels(np.add(agent, [0.0, up_m, 0.0]), eye_m, yaw_of(head["turn"]))
            for eye, (column, line) in enumerate(places):
                near = differs[
                    eye, int(line) - 1 : int(line) + 2, int(column) - 1 : int(column) + 2
                ]
                assert is_there == near.any(), (agent, eye, up_m)
    assert not problems


WATCH_PEOPLE = """() => { const d = viewer.drawing, draw = d.drawPeople; window.visible = null;
    d.drawPeople = function (cast, visible, ...rest) { window.visible = visible;
        draw.call(d, cast, visible, ...rest); }; }"""


@pytest.mark.slow  # a browser
@pytest.mark.parametrize(("aside_m", "is_seen"), [(0.0, False), (0.55, False), (0.65, True)])
def test_the_participant_is_seen_by_who_has_left_their_place(
    page: Path, browser: Any, aside_m: float, is_seen: bool
) -> None:
    tab, _ = put_on(browser, page, "standard")
    tab.evaluate(WATCH_PEOPLE)
    tab.evaluate("m => drive.head([m, 1.6, 0], [Math.SQRT1_2, 0, Math.SQRT1_2, 0])", aside_m)
    look(tab)
    assert is_seen == tab.evaluate("visible.includes(viewer.sceneAt(viewer.t).data.participant)")


@pytest.mark.slow  # a browser
def test_gaze_is_a_point_where_it_ends_and_a_line_to_it(page: Path, browser: Any) -> None:
    tab, _ = put_on(browser, page, "standard")
    begin, end, models = tab.evaluate(
        """() => { let t = viewer.header.scenes[0].t0;
        while (!viewer.streams.gazeAt(t)?.valid) t += 0.02;
        viewer.seek(t); const gaze = viewer.streams.gazeAt(t);
        const seenFrom = m => viewer.headset.gazeOf(viewer.session, add(gaze.from, [m, 0, 0]))
            .map(thing => [...thing.model]);
        return [gaze.from, gazeEnd(gaze), [seenFrom(0), seenFrom(0.65)]]; }"""
    )
    for (point, line), begins_m in zip(models, (1.0, 0.1), strict=True):
        assert np.allclose(end, point[12:15], atol=1e-5)
        first, along = np.array(line[12:15]), np.array(line[4:7])
        assert np.allclose(end, first + along, atol=1e-5)
        assert begins_m == pytest.approx(np.linalg.norm(first - begin), abs=1e-3)


@pytest.mark.slow  # a browser
def test_words_come_after_whoever_turns_away_from_them(page: Path, browser: Any) -> None:
    tab, _ = put_on(browser, page, "standard")
    before = tab.evaluate("viewer.headset.ahead")
    for yaw_deg, stay in ((43.0, True), (49.0, False)):
        tab.evaluate("turn => drive.head([0, 1.6, 0], turn)", turn_of(np.radians(yaw_deg)).tolist())
        look(tab)
        assert stay == (before == tab.evaluate("viewer.headset.ahead"))


SHIFT = """metres => { const begins = viewer.header.trials[1].t0, of = viewer.streams,
    headAt = of.headAt.bind(of); of.headAt = t => { const head = headAt(t);
        return t < begins ? head : {...head, at: add(head.at, [metres, 0, 0])}; };
    viewer.seek(begins + 0.1); }"""


@pytest.mark.slow  # a browser
@pytest.mark.parametrize(("metres", "is_moved"), [(0.5, False), (0.75, True)])
def test_who_stands_elsewhere_than_the_next_trial_begins_is_brought_there(
    page: Path, browser: Any, metres: float, is_moved: bool
) -> None:
    tab, _ = put_on(browser, page, "standard")
    tab.evaluate("window.before = viewer.headset.stand")
    tab.evaluate(SHIFT, metres)
    look(tab)
    assert is_moved == tab.evaluate("before !== viewer.headset.stand")


# ---- hands --------------------------------------------------------------------------------------


@pytest.mark.slow  # a browser
@pytest.mark.timeout(600)
@pytest.mark.parametrize("which", ["standard", "emulator"])
def test_hands_play_step_stand_anew_and_leave(which: str, page: Path, browser: Any) -> None:
    tab, problems = put_on(browser, page, which)
    time = "viewer.t - viewer.header.trials[0].t0"
    assert "T01   0.0 of" in tab.evaluate("viewer.headset.words.text")
    tab.evaluate("drive.press('right')")
    tab.wait_for_function(f"{time} > 0.3", timeout=PATIENCE_S * 1000)
    assert tab.evaluate("viewer.playing")
    tab.evaluate("drive.release('right'); drive.press('left')")
    tab.wait_for_function("!viewer.playing")
    tab.evaluate("drive.release('left')")
    stands = tab.evaluate(time)
    look(tab)
    assert stands == tab.evaluate(time)
    tab.evaluate("drive.stick('right', 0.65, 0)")
    look(tab)
    assert stands == tab.evaluate(time)
    tab.evaluate("drive.stick('right', 0.75, 0)")
    look(tab)
    assert stands + 5 == pytest.approx(tab.evaluate(time))  # once, however long it is held
    for across, by_s in ((0.45, 5), (0.75, 5), (0.35, 5), (0.75, 10)):  # it has to come back
        tab.evaluate("x => drive.stick('right', x, 0)", across)
        look(tab)
        assert stands + by_s == pytest.approx(tab.evaluate(time))
    tab.evaluate("drive.stick('right', 0, 0)")
    look(tab)
    tab.evaluate("window.before = viewer.headset.stand; drive.stick('right', 0, -1)")
    look(tab)
    assert tab.evaluate("before !== viewer.headset.stand")
    before = tab.evaluate("viewer.trialAt(viewer.t)?.id || 'T01'")
    tab.evaluate("window.before = viewer.headset.stand; drive.stick('left', 1, 0)")
    look(tab)
    assert before < tab.evaluate("viewer.trialAt(viewer.t).id")
    assert tab.evaluate("before !== viewer.headset.stand")
    frames = tab.evaluate("viewer.frames")
    tab.evaluate("drive.upper('right', 1)")
    tab.wait_for_function("!viewer.headset.isWorn", timeout=PATIENCE_S * 1000)
    tab.wait_for_function(f"viewer.frames > {frames}", timeout=PATIENCE_S * 1000)
    tab.locator(BUTTON).wait_for()
    assert not problems


# ---- the button, and how the page is served -----------------------------------------------------


@pytest.mark.slow  # a browser
@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("", "no headset is connected: join one to this computer"),
        ("Object.defineProperty(navigator, 'xr', {value: undefined})", "has no WebXR: take the"),
        ("Object.defineProperty(window, 'isSecureContext', {value: false})", "not secure: open"),
    ],
    ids=["no headset", "no WebXR", "not secure"],
)
def test_a_browser_that_enters_no_headset_says_why_and_what_to_do(
    page: Path, browser: Any, script: str, words: str
) -> None:
    tab, problems = open_page(browser, page, script)
    tab.wait_for_function("document.getElementById('vr-note').textContent")
    assert words in tab.inner_text("#vr-note")
    assert tab.locator("#enter-vr").is_disabled()
    assert not problems


@pytest.mark.slow  # a browser
def test_a_page_without_headset_has_no_button(page: Path, browser: Any) -> None:
    tab = browser.new_page()
    tab.goto(page.as_uri())
    tab.wait_for_selector("body[data-ready]", timeout=PATIENCE_S * 1000)
    assert not tab.locator("#enter-vr").is_visible()


@pytest.mark.slow  # a browser
@pytest.mark.timeout(600)
@pytest.mark.skipif(os.name == "nt", reason="Windows ends no process by SIGTERM")
def test_a_page_for_a_headset_is_served_by_a_code_and_nothing_of_it_is_left(
    page: Path, browser: Any, tmp_path: Path
) -> None:
    session = next(page.parent.glob("simulated/duel/sub-*/ses-001"))
    words = ["view", str(session), "--trial", "T01", "--headset"]
    server = subprocess.Popen(
        [sys.executable, *COMMAND, *words],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1", "TMPDIR": str(tmp_path), "COLUMNS": "200"},
    )
    assert server.stdout is not None
    lines: list[str] = []
    try:
        for line in server.stdout:
            lines.append(line)
            if "Ctrl-C" in line:
                break
        text = "".join(lines)
        (address,) = re.findall(r"^ +(http://localhost:\d+)$", text, re.M)
        ((first, second),) = re.findall(r"^ +(\d{3}) (\d{3})$", text, re.M)
        (file,) = tmp_path.glob("visavis-*/*.html")
        tab = browser.new_page()
        assert 404 == tab.goto(f"{address}/key/{file.name}").status
        tab.goto(address)
        tab.fill("#code", f"{(int(first) + 1) % 1000:03d} {second}")
        tab.click("#go")
        tab.get_by_text("This is not the code.").wait_for(timeout=PATIENCE_S * 1000)
        tab.fill("#code", f"{first} {second}")
        tab.keyboard.press("Enter")
        tab.wait_for_selector("body[data-ready]", timeout=PATIENCE_S * 1000)
        assert tab.evaluate("isSecureContext")
        assert tab.locator("#enter-vr").is_visible()
    finally:
        server.send_signal(signal.SIGTERM)
        words, _ = server.communicate(timeout=60)
    assert 0 == server.returncode, words
    assert [] == list(tmp_path.glob("visavis-*"))
