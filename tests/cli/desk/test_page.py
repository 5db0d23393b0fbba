"""The desk's page in a real browser: what an operator reads, presses and types."""

import asyncio
import contextlib
import os
import re
import signal
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.desk.test_link import Glancing, seen
from tests.cli.test_operator_screen import STATUS
from tests.commands import COMMANDS, RunningCommand
from tests.faults.sessions import lab
from tests.running.page.test_browser import faults_for_people
from visavis.cli.desk import server as desk_server
from visavis.cli.desk.link import About, SessionLink
from visavis.cli.desk.server import DeskServer
from visavis.devices.contracts import Fault
from visavis.lab.clock import StopWatch
from visavis.lab.config_files import EXAMPLE
from visavis.protocol.session.operator import (
    Action,
    BodyContact,
    Command,
    SessionStatus,
    UnattendedOperator,
)
from visavis.protocol.session.states import SessionState
from visavis.recording.reader import Recording
from visavis.stimuli.scenes.station_crowd import CrowdFrame, CrowdScene, station_crowd

REPOSITORY = Path(__file__).resolve().parents[3]
PATIENCE_S = 120.0
WIDTHS_PX = (1366, 820, 390, 320, 2560)
VIEWS = ("view", "above")
DECODES = "src => Object.assign(new Image(), { src }).decode().then(() => true)"
FINDINGS = [
    {"level": "ok", "subject": "clock", "found": "steps of 1 ns", "remedy": ""},
    {"level": "missing", "subject": "disk", "found": "0.2 GB are free", "remedy": "free space"},
]
DOCTOR = {
    "made_wall_iso": "2026-01-01T09:00:00+00:00",
    "count": {"missing": 1, "warning": 0, "ok": 1},
    "findings": FINDINGS,
}

pytestmark = [
    pytest.mark.slow,  # a browser
    pytest.mark.timeout(600),
]


@pytest.fixture
def address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Serve a desk beside the test, as a terminal of its own would."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(desk_server, "_run_doctor", lambda lab: DOCTOR)
    found: list[str] = []
    stops: list[Any] = []
    listens = threading.Event()

    async def serve() -> None:
        desk = DeskServer(lab(tmp_path))
        found.append(await desk.start())
        running = asyncio.create_task(desk.run())
        stops.append((asyncio.get_running_loop(), running))
        listens.set()
        with contextlib.suppress(asyncio.CancelledError):
            await running

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    assert listens.wait(PATIENCE_S)
    yield found[0]
    loop, running = stops[0]
    loop.call_soon_threadsafe(running.cancel)
    thread.join()


@contextlib.contextmanager
def session(root: Path, *, is_blind: bool = False) -> Iterator[SessionLink]:
    """Let a session go on for the desk."""
    about = About("stare", "S07H", 1, str(root), is_simulated=True, is_blind=is_blind)
    with SessionLink(UnattendedOperator(), about, root) as link:
        yield link


def opened(browser: Any, address: str, **options: Any) -> Any:
    page = browser.new_page(**options)
    page.set_default_timeout(PATIENCE_S * 1000)
    page.goto(address)
    return page


def wait_for(page: Any, place: str, text: str) -> None:
    """Wait until a place says something."""
    page.locator(place).filter(has_text=text).first.wait_for()


def command(link: SessionLink) -> Command:
    watch = StopWatch()
    while watch.elapsed_s() < PATIENCE_S:
        commands = list(link.poll())
        if commands:
            assert 1 == len(commands)
            return commands[0]
    raise AssertionError("nothing was asked for")


def test_the_page_says_what_the_terminal_says(address: str, browser: Any, tmp_path: Path) -> None:
    addresses: list[str] = []
    problems: list[str] = []
    with session(tmp_path) as link:
        link.show(replace(seen(True), flags=("left_eye_lost",), prompt="Break."))
        page = browser.new_page()
        page.on("request", lambda request: addresses.append(request.url))
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(address)
        for place, text in (
            ("#f-participant", "S07H"),
            ("#f-trial", "T05"),
            ("#f-condition", "AD, place left_far"),
            ("#f-done", "5 of 73"),
            ("#f-left", "10 s"),
            ("#f-session", "about 20 min"),
            ("#streams", "119.9 Hz"),
            ("#streams", "nothing yet"),
            ("#calibration", "accuracy 0.80°"),
            ("#faults", "check the cable"),
            ("#flags", "left_eye_lost"),
            ("#messages", "noted in T05: sneezed"),
            ("#prompt", "Break."),
            ("#above-text", "Looks at right close."),
            ("#rehearsal", "SIMULATED"),
        ):
            wait_for(page, place, text)
    assert [] == problems
    assert all(url.startswith((address.split("#")[0], "data:")) for url in addresses)


def test_no_fault_is_green_only_where_nothing_was_missed(
    address: str, browser: Any, tmp_path: Path
) -> None:
    health = STATUS.health["eye_tracker"]
    whole = replace(STATUS, faults=(), health={"headset": replace(health, gaps=0)})
    holes = {"headset": replace(health, gaps=380, longest_gap_ms=222.0)}
    with session(tmp_path) as link:
        link.show(whole)
        page = opened(browser, address)
        wait_for(page, "#faults .good", "No faults.")
        link.show(replace(whole, health=holes))
        wait_for(page, "#faults .look", "No fault now, but headset: 380 gaps, longest 222 ms.")
        assert 0 == page.locator("#faults .good").count()


def test_a_streams_rate_stands_beside_the_one_promised(
    address: str, browser: Any, tmp_path: Path
) -> None:
    health = STATUS.health["eye_tracker"]
    promised = {"eye_tracker": replace(health, nominal_rate_hz=120.0), "responses": health}
    with session(tmp_path) as link:
        link.show(replace(STATUS, health=promised))
        page = opened(browser, address)
        wait_for(page, "#streams", "119.9 of 120 Hz")
        wait_for(page, "#streams tr:last-child", "119.9 Hz")  # who promises none


def test_areas_of_interest_and_gaze_stand_in_both_views(
    address: str, browser: Any, tmp_path: Path
) -> None:
    with session(tmp_path) as link:
        link.show(seen(True))
        page = opened(browser, address)
        wait_for(page, "#view-of", "in outline")
        assert (1, 1) == tuple(page.locator(f"#{place} .area").count() for place in VIEWS)
        places = [
            float(page.locator(f"#view .{part}").get_attribute("cx")) for part in ("head", "gaze")
        ]
        assert [0.4, 0.75] == places
        wait_for(page, "#above-text", "Looks at right close.")
        wait_for(page, "#above-key", "areas of interest")


def test_the_picture_that_the_participant_sees_is_shown(
    address: str, browser: Any, tmp_path: Path
) -> None:
    glancing = Glancing()
    with session(tmp_path) as link:
        page = opened(browser, address)
        watch = StopWatch()
        while not page.locator("#view image").count() and watch.elapsed_s() < PATIENCE_S:
            link.show(replace(seen(True), glance=glancing))
            page.wait_for_timeout(50)
        wait_for(page, "#view-of", "left eye")
        source = page.locator("#view image").get_attribute("href")
        assert page.evaluate(DECODES, source)
        assert (1, 1) == tuple(page.locator(f"#view .{part}").count() for part in ("area", "gaze"))


def test_contacts_and_vibrations_are_seen_and_said(
    address: str, browser: Any, tmp_path: Path
) -> None:
    shown_crowd = CrowdFrame(
        CrowdScene("crowd_1", (), crowd=station_crowd(1)), 0, np.empty((0, 3)), np.empty(0)
    )
    touch = BodyContact("armband_left_forearm", "left_hand", 7, vibrates=True)
    status = replace(seen(True), scene_frame=shown_crowd, contacts=(touch,), contacts_begun=3)
    with session(tmp_path) as link:
        link.show(status)
        page = opened(browser, address)
        wait_for(page, "#above-text", "Left hand touches person 8, its band vibrates. 3 contacts")
        assert len(station_crowd(1)) - 1 == page.locator("#above .person").count()
        assert [1, 1] == [
            page.locator(f"#above .{part}").count() for part in ("touched", "contact")
        ]
        link.show(replace(status, contacts=()))
        page.locator("#above .touched").wait_for(state="detached")
        assert 0 == page.locator("#above .contact").count()


def test_no_button_moves_when_something_waits_or_breaks(
    address: str, browser: Any, tmp_path: Path
) -> None:
    calm = replace(STATUS, faults=())
    away = "Waiting for eye_tracker: in 42 s the session ends, to be resumed."
    shown_as = (
        (
            replace(calm, state=SessionState.PAUSED, prompt="Paused.", can_go_on=True),
            "look",
            "Paused.",
            True,
        ),
        (replace(STATUS, state=SessionState.PAUSED, waiting=away), "bad", away, False),
        (STATUS, "bad", "eye_tracker: disconnected", False),
        (calm, "good", "Goes on by itself.", False),
    )
    with session(tmp_path) as link:
        link.show(calm)
        for width in WIDTHS_PX:
            page = opened(browser, address, viewport={"width": width, "height": 900})
            wait_for(
                page, "#f-done", "5 of 73"
            )  # before its first news the page says the same, and less
            wait_for(page, "#prompt", "Goes on by itself.")
            places = {page.locator("#do-flag").bounding_box()["y"]}
            for status, kind, words, is_asked in shown_as:
                link.show(status)
                wait_for(page, "#prompt", words)
                assert f"state {kind}" == page.locator("#f-state").get_attribute("class")
                assert is_asked == page.locator("#do-advance").is_enabled()
                places.add(page.locator("#do-flag").bounding_box()["y"])
            assert len(places) <= 2  # it may have grown once, and never shrinks
            page.close()


def test_no_button_moves_when_the_first_news_of_a_session_comes(
    address: str, browser: Any, tmp_path: Path
) -> None:
    with session(tmp_path) as link:
        page = opened(browser, address, viewport={"width": WIDTHS_PX[0], "height": 900})
        wait_for(page, "#prompt", "Goes on by itself.")
        before = page.locator("#do-flag").bounding_box()["y"]
        link.show(replace(STATUS, faults=(), condition=""))
        wait_for(page, "#f-done", "5 of 73")
        assert pytest.approx(before, abs=1) == page.locator("#do-flag").bounding_box()["y"]


def test_a_blinded_condition_stays_hidden(address: str, browser: Any, tmp_path: Path) -> None:
    with session(tmp_path, is_blind=True) as link:
        link.show(replace(STATUS, condition=""))
        wait_for(opened(browser, address), "#f-condition", "hidden")


def test_a_session_on_a_participants_page_is_shown_and_not_commanded(
    address: str, browser: Any, tmp_path: Path
) -> None:
    about = About("films", "S07H", 1, str(tmp_path), is_simulated=True, is_blind=False, commands=())
    told = replace(
        STATUS,
        health={},
        faults=(),
        calibration=replace(STATUS.calibration, accuracy_deg=None),
        trials=replace(STATUS.trials, left_s=0.0),
    )
    with SessionLink(UnattendedOperator(), about, tmp_path) as link:
        link.show(told)
        page = opened(browser, address)
        wait_for(page, "#f-done", "5 of 73")
        wait_for(page, "#session", "goes on at the participant's page")
        assert 0 == page.locator("#session button").count()
        wait_for(page, "#prompt", "Goes on by itself.")
        page.keyboard.press("f")
        page.wait_for_timeout(300)
        assert [] == list(link.poll())


def test_every_button_and_key_asks_for_what_the_terminals_keys_do(
    address: str, browser: Any, tmp_path: Path
) -> None:
    with session(tmp_path) as link:
        link.show(replace(STATUS, prompt="Paused.", can_go_on=True))
        page = opened(browser, address)
        page.wait_for_selector("#do-advance:visible")
        for action in (
            Action.PAUSE,
            Action.FLAG,
            Action.REPEAT,
            Action.RECALIBRATE,
            Action.CHECK_DRIFT,
            Action.SILENCE,
        ):
            page.click(f"#do-{action}")
            assert Command(action) == command(link)
        page.click("#do-advance")
        assert Command(Action.ADVANCE) == command(link)
        page.keyboard.press("Space")
        assert Command(Action.ADVANCE) == command(link)
        page.keyboard.press("p")
        assert Command(Action.PAUSE) == command(link)
        page.keyboard.press("n")
        page.keyboard.type("p s <b>x</b>")  # keys are text now
        page.keyboard.press("Enter")
        assert Command(Action.NOTE, "p s <b>x</b>") == command(link)
        page.click("#do-skip")
        page.click("#ask-yes")  # not without a reason
        page.fill("#ask-text", "fell asleep")
        page.click("#ask-yes")
        assert Command(Action.SKIP, "fell asleep") == command(link)
        page.keyboard.press("w")
        page.get_by_label("the participant is unwell").check()
        page.fill("#ask-text", "dizzy")
        page.click("#ask-yes")
        assert Command(Action.REASON, "dizzy", "unwell") == command(link)
        page.click("#do-abort")
        page.click("#ask-no")
        page.keyboard.press("Escape")
        page.click("#ask-yes")
        assert Command(Action.ABORT) == command(link)


def test_one_of_two_sessions_is_chosen_and_commanded(
    address: str, browser: Any, tmp_path: Path
) -> None:
    other = About("stare", "S08J", 1, str(tmp_path), is_simulated=True, is_blind=False)
    with session(tmp_path) as link, SessionLink(UnattendedOperator(), other, tmp_path) as second:
        link.show(STATUS)
        second.show(replace(STATUS, trial_id="T09"))
        page = opened(browser, address)
        for label, trial, its in (("S08J", "T09", second), ("S07H", "T05", link)):
            page.get_by_role("button", name=f"{label} · stare").click()
            wait_for(page, "#f-trial", trial)
            wait_for(page, "#f-participant", label)
            page.click("#do-pause")
            assert Command(Action.PAUSE) == command(its)


def test_a_page_may_be_closed_and_the_next_session_appears_by_itself(
    address: str, browser: Any, tmp_path: Path
) -> None:
    page = opened(browser, address)
    wait_for(page, "#session", "No session goes on")
    wait_for(page, "#findings", "Not ready: 1 thing missing.")
    wait_for(page, "#findings", "free space")
    with session(tmp_path) as link:
        link.show(STATUS)
        wait_for(page, "#f-trial", "T05")
        page.close()
        link.show(replace(STATUS, trial_id="T06"))
        page = opened(browser, address)
        wait_for(page, "#f-trial", "T06")
        page.reload()
        wait_for(page, "#f-trial", "T06")
    wait_for(page, "#session", "No session goes on")


@pytest.mark.parametrize("width", WIDTHS_PX)
def test_everything_fits_at_every_width(
    width: int, address: str, browser: Any, tmp_path: Path
) -> None:
    long = Fault("armband_left_upper_arm", "blocking", "no data for 12 s", "look at " + "x" * 60)
    busy: SessionStatus = replace(seen(True), faults=(long,), prompt="Go on? " * 9)
    with session(tmp_path) as link:
        link.show(busy)
        page = opened(browser, address, viewport={"width": width, "height": 800})
        wait_for(page, "#faults", "no data for 12 s")
        assert width == page.evaluate("() => document.documentElement.scrollWidth")
        heights = page.evaluate(
            "() => [...document.querySelectorAll('#session button')].map(b => b.offsetHeight)"
        )
        assert min(h for h in heights if h) >= 44  # a finger's width, WCAG 2.5.5


def test_the_desk_shuts_nobody_out(address: str, browser: Any, tmp_path: Path) -> None:
    with session(tmp_path) as link:
        link.show(seen(True))
        page = opened(browser, address)
        wait_for(page, "#f-participant", "S07H")
        assert [] == faults_for_people(page)


@pytest.mark.parametrize("width_px", [320, 2560])
def test_firefox_shows_the_desk_and_what_comes(
    width_px: int, address: str, other_browser: Any, tmp_path: Path
) -> None:
    window = other_browser
    window.size(width_px, 900)
    with session(tmp_path) as link:
        link.show(seen(True))
        window.goto(address)
        place = "document.querySelector('#f-participant')"
        window.wait_for(f"{place}?.textContent.includes('S07H')", 30.0)
        assert width_px >= window.evaluate("document.documentElement.scrollWidth")


def started(root: Path, *arguments: str) -> RunningCommand:
    return COMMANDS.start(
        *["-u", "-m", "visavis.cli.main", *arguments],
        cwd=root,
        env=os.environ
        | {"XDG_CACHE_HOME": str(root / "cache"), "PYTHONPATH": str(REPOSITORY), "COLUMNS": "200"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )


def address_told(process: RunningCommand) -> str:
    assert process.stdout is not None
    said = []
    for line in process.stdout:
        said.append(line)
        found = re.search(r"http://\S+", line)
        if found:
            return found.group()
    raise AssertionError("".join(said))


def test_a_session_in_real_time_is_commanded_and_outlives_a_killed_desk(
    browser: Any, tmp_path: Path
) -> None:
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    # Nothing is calibrated before its first trial, and it lasts until somebody ends it.
    study = [str(REPOSITORY / "tests/studies/greeting.py"), "--set", "repetitions=50"]
    running = started(tmp_path, "run", *study, "--participant", "1", "--devices", "sim")
    desks = [started(tmp_path, "desk")]
    try:
        page = opened(browser, address_told(desks[0]))
        wait_for(page, "#f-state", "trial")
        page.click("#do-note")
        page.fill("#ask-text", "coughed")
        page.keyboard.press("Enter")
        wait_for(page, "#messages", "coughed")
        page.click("#do-pause")
        wait_for(page, "#f-state", "paused")
        desks[0].send_signal(signal.SIGKILL)
        wait_for(page, "#notice", "The desk is closed; the session goes on without it.")
        page.close()
        desks.append(started(tmp_path, "desk"))
        page = opened(browser, address_told(desks[1]))
        wait_for(page, "#f-state", "paused")
        page.click("#do-advance")
        page.locator("#f-state").filter(has_not_text="paused").wait_for()
        page.click("#do-abort")
        page.click("#ask-yes")
        wait_for(page, ".verdict", "Keep them here.")
        wait_for(page, ".verdict .remedy code", "visavis resume")
        wait_for(
            page, ".verdict > ul.findings", "planned trials complete"
        )  # what is wrong is not folded away
        wait_for(page, "#people", "visavis resume")
        said, _ = running.communicate(timeout=PATIENCE_S)
        assert 3 == running.returncode, said
        assert "Traceback" not in said
    finally:
        for process in (running, *desks):
            process.kill()
            process.wait()
            assert process.stdout is not None
            process.stdout.close()
    path = tmp_path / "data/simulated/greeting/sub-S01B/ses-001"
    events = Recording(path).events()
    actions = [e["action"] for e in events.loc[events["name"] == "operator", "payload"]]
    assert ["note", "pause", "advance", "abort"] == actions
