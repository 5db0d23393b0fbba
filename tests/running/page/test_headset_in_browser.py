"""The same page in a headset: stereo figures, a board pressed by rays, streams, interruptions."""

import base64
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.running.page.test_browser import PATIENCE_S, Server, npm_script, state_of, until
from tests.running.page.test_browser import server as server
from tests.running.page.test_headset_studies import IN_HEADSET
from visavis.lab.clock import NS_PER_MS, StopWatch
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.running.page.desk import LOST_FLAG
from visavis.running.page.server import SITE

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # a browser

FILES = Path(__file__).parent / "headsets"
STREAMS = ("head", "frame_timing", "pointer", "responses")


ASKING_IN_HEADSET = """
from visavis import Factor, Rating, Study

study = Study("apart", factors=[Factor("place", [1, 2])], on="browser", uses=(), calibrate=False,
              xr="required")


@study.trial
def trial(t):
    yield t.ask(Rating("answer", 1, 9))
"""


def open_study(
    server: Server, browser: Any, which: str, text: str = IN_HEADSET
) -> tuple[Any, list[str]]:
    """Return a page before a headset, after the consent, at the step that enters VR."""
    (server.root / "apart.py").write_text(text, "utf-8")
    return before_a_headset(browser, server.start("run", "apart.py", "--participant", "1"), which)


def before_a_headset(browser: Any, address: str, which: str) -> tuple[Any, list[str]]:
    """Return the page at an address, at the step that enters VR, and what goes wrong on it."""
    # The emulator draws as large as the window; without a graphics card that is slow.
    page = browser.new_context(viewport={"width": 200, "height": 150}).new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    if which == "emulator":
        page.add_init_script(npm_script("iwer", "build/iwer.min.js"))
    for name in ("seldom", which, "people"):
        page.add_init_script(path=FILES / f"{name}.js")
    page.goto(address)
    until(page, "Put the headset on")
    return page, problems


def recording_of(server: Server) -> Recording:
    """Return the recording of the session, as far as it is on the disk."""
    return Recording(session_dir(server.root / "data", "apart", "S01B", 1, is_simulated=True))


def payloads(recording: Recording, name: str) -> list[dict[str, Any]]:
    """Return what a recording's events of a name say."""
    events = recording.events()
    return list(events.loc[events["name"] == name, "payload"])


def page_events(server: Server, kind: str) -> list[dict[str, Any]]:
    """Return what the journal says of a kind of events of the page."""
    return [p for p in payloads(recording_of(server), "page_event") if p["kind"] == kind]


def wait(page: Any, condition: str | Callable[[], bool]) -> None:
    """Wait for a condition; the page's policy forbids the browser's own way."""
    watch = StopWatch()
    while not (page.evaluate(condition) if isinstance(condition, str) else condition()):
        assert watch.elapsed_s() < PATIENCE_S, (condition, state_of(page))
        page.wait_for_timeout(50)


def enter(page: Any) -> None:
    """Enter VR by the page's button, say how one feels, and see the first trial's figures."""
    page.locator("#main button:not(.quiet):not([disabled])").click()
    say_how_one_feels(page)
    wait(page, "() => worn.board.texts().includes('Continue')")  # what to do
    press(page, "Continue")
    figures(page)


def say_how_one_feels(page: Any) -> None:
    """Answer the question before and after VR on the board."""
    wait(page, "() => window.worn && worn.board.texts().includes('10')")
    press(page, "0")
    press(page, "Continue")
    wait(page, "() => !worn.board.texts().includes('10')")


def figures(page: Any) -> None:
    """Wait until figures have been seen for as many rounds as answers need."""
    page.wait_for_selector("fieldset input:not([disabled])", timeout=PATIENCE_S * 1000)


def press(page: Any, text: str, nth: int = 0) -> None:
    page.evaluate("([text, nth]) => person.press(text, nth)", [text, nth])


def answer_trial(page: Any, trial: int) -> None:
    """See a trial's figures, answer by rays, and go on."""
    figures(page)
    press(page, str(trial + 2))
    press(page, str(trial + 3), 1)
    assert page.locator("#main button:not(.quiet)").is_enabled()
    press(page, "Continue")
    page.wait_for_selector("input:checked", state="detached", timeout=PATIENCE_S * 1000)


@pytest.mark.parametrize("which", ["standard", "emulator"])
def test_a_study_runs_from_consent_to_thanks_in_a_headset(
    which: str, server: Server, browser: Any
) -> None:
    page, problems = open_study(server, browser, which)
    assert "Clear the floor" in state_of(page)["text"]
    enter(page)
    for trial in range(2):
        answer_trial(page, trial)
    say_how_one_feels(page)
    until(page, "Thank you", steps=False)
    assert page.evaluate("worn.isPresenting()")
    press(page, "Leave VR")
    wait(page, "() => !worn.isPresenting()")
    output = server.end()
    recording = recording_of(server)
    rows = recording.trials()
    assert list(rows["status"]) == ["complete"] * 2, output
    assert [list(rows[name]) for name in ("lively", "heavy")] == [[2, 3], [3, 4]]
    assert {*rows["lively_by"], *rows["heavy_by"]} == {"ray"}
    assert {*rows["seen_in"]} == {"headset"}
    assert (rows["live_rounds"] >= 2).all()
    # What the headset sent: frames are numbered, presses timed, rays where the hand pointed.
    (entry,) = payloads(recording, "headset_entered")
    assert entry["entered"] is True
    assert set(entry["controllers"]) == {"left", "right"}
    assert [0, 0] == [p["rating"] for p in payloads(recording, "discomfort")]
    assert set(STREAMS) == set(recording.stream_names)
    head, timing, presses = (recording.stream_arrays(n) for n in STREAMS if n != "pointer")
    assert list(head["seq"]) == list(timing["seq"])
    assert (np.diff(head["t_host_ns"]) >= 0).all()
    assert np.nanmedian(head["position_m"][:, 1]) == pytest.approx(1.6, abs=0.01)
    drawn = timing["drawn"]  # rows of frames that were left out say nothing
    assert head["valid"][drawn].all()
    assert np.isnan(head["position_m"][~drawn]).all()
    triggers = presses["value_01"][presses["control"] == 7]
    assert (triggers == 1 - np.arange(len(triggers)) % 2).all()  # pressed, released, pressed
    assert len(triggers) >= 17
    # Nothing acknowledged is missing or doubled, and the journal says which rows came with what.
    for name in STREAMS:
        batches = [p for p in page_events(server, "stream") if p["stream"] == name]
        numbers = [n for p in batches for n in range(p["seq0"], p["seq0"] + p["rows"])]
        assert numbers == list(recording.stream_arrays(name)["seq"])
    # Answers are dated by the same clock as the presses that gave them.
    pressed_ns = presses["t_host_ns"][(presses["control"] == 7) & (presses["value_01"] == 1)]
    answers = payloads(recording, "answered")
    for answer in answers:
        assert np.abs(pressed_ns - answer["answered_ns"]).min() < 50 * NS_PER_MS
    assert not problems


def test_what_interrupts_a_figure_in_a_headset_is_told_and_the_figure_is_seen_again(
    server: Server, browser: Any
) -> None:
    page, problems = open_study(server, browser, "standard")
    enter(page)
    assert page.get_attribute("canvas.figure", "data-draws") == "2"  # of two people, for each eye
    press(page, "2")
    # Off the head: no head holds so still. What was answered stays.
    page.evaluate("drive.wear(false)")
    wait(page, "() => document.getElementById('headset').innerText.includes('Paused')")
    assert page.evaluate("worn.isPaused()")
    page.evaluate("drive.wear(true)")
    wait(page, "() => !document.getElementById('headset').innerText")
    assert page.locator("fieldset input:not([disabled])").count() == 0
    assert page.locator("input:checked").count() == 1
    figures(page)
    # The boundary's pause, the view set anew, frames left out, controllers asleep.
    page.evaluate("drive.visibility('visible-blurred'); drive.press('right')")
    page.evaluate("drive.visibility('visible')")
    page.evaluate("drive.reset(); drive.sleep(); drive.wake(); drive.track(false)")
    seen = page.evaluate("drive.ticks()")
    wait(page, f"() => drive.ticks() > {seen + 3}")
    page.evaluate("drive.track(true); drive.skip(20)")
    figures(page)
    press(page, "3")
    press(page, "3", 1)
    press(page, "Continue")
    page.wait_for_selector("input:checked", state="detached", timeout=PATIENCE_S * 1000)
    wait(page, lambda: len(recording_of(server).trials()) == 1)
    changes = [p["what"] for p in page_events(server, "xr")]
    assert changes[:6] == ["off", "on", "blurred", "visible", "reset", "controllers_asleep"]
    assert changes[6:] == ["controllers_awake"]
    server.kill()  # so that nothing is added while it is read
    recording = recording_of(server)
    (flags,) = recording.trials()["flags"]
    happened = {"headset off", "headset paused", "reference space reset", "controllers asleep"}
    assert happened <= set(flags.split(";"))
    assert LOST_FLAG in flags
    head, timing = recording.stream_arrays("head"), recording.stream_arrays("frame_timing")
    assert np.isnan(head["position_m"][~head["valid"]]).all()
    skipped = timing["skipped"].astype(np.int64)
    assert skipped.max() >= 19
    numbers = timing["seq"]
    assert numbers[-1] + 1 == len(numbers) + skipped[skipped > 8].sum()
    assert set(head["seq"]) ^ set(numbers) <= set(
        range(min(head["seq"][-1], numbers[-1]) + 1, 10**6)
    )
    assert not problems


def test_whoever_leaves_vr_or_reloads_goes_on_at_the_screen_and_each_trial_says_where(
    server: Server, browser: Any
) -> None:
    page, problems = open_study(server, browser, "standard")
    enter(page)
    page.evaluate("drive.end()")
    page.get_by_text("Take part at this screen").click()
    figures(page)
    for group in page.locator("fieldset").all():
        group.locator("input").first.check()
    page.locator("#main button:not(.quiet)").click()
    wait(page, lambda: len(recording_of(server).trials()) == 1)
    page.reload()
    until(page, "How unwell do you feel now?")
    until(page, "Thank you")
    server.end()
    rows = recording_of(server).trials()
    assert ["both", "screen"] == list(rows["seen_in"])
    assert "VR ended" in rows["flags"].iloc[0]
    assert not problems


def test_whoever_enters_again_goes_on_with_the_numbers_of_their_frames(
    server: Server, browser: Any
) -> None:
    page, problems = open_study(server, browser, "standard", ASKING_IN_HEADSET)
    page.locator("#main button:not(.quiet):not([disabled])").click()
    for _ in range(2):  # VR ends, and somebody enters again on the same page
        wait(page, "() => window.worn && worn.isPresenting() && worn.frames() > 60")
        page.evaluate("drive.end()")
        page.locator("#headset button").first.click()
    wait(page, "() => worn.isPresenting() && worn.frames() > 60")
    at_last = len(page_events(server, "stream"))
    wait(page, partial(has_batches, server, at_last + 4))
    assert [] == page_events(server, "problem")
    numbers = [p["seq0"] for p in page_events(server, "stream") if p["stream"] == "pointer"]
    assert sorted(numbers) == numbers
    assert not problems


def has_batches(server: Server, more_than: int) -> bool:
    """Tell whether the journal names more batches than that."""
    return len(page_events(server, "stream")) > more_than


def test_a_server_that_is_killed_loses_and_doubles_no_sample(server: Server, browser: Any) -> None:
    page, problems = open_study(server, browser, "standard")
    enter(page)
    for _ in range(3):
        at_kill = len(page_events(server, "stream"))
        server.kill()
        frames = page.evaluate("worn.frames()")
        wait(page, f"() => worn.frames() > {frames + 60}")  # what is measured meanwhile waits
        server.start("resume", str(recording_of(server).path))
        wait(page, partial(has_batches, server, at_kill + 4))
    for trial in range(2):
        answer_trial(page, trial)
    say_how_one_feels(page)
    until(page, "Thank you", steps=False)
    server.end()
    recording = recording_of(server)
    timing = recording.stream_arrays("frame_timing")
    skipped = timing["skipped"].astype(np.int64)
    for name in STREAMS:
        numbers = recording.stream_arrays(name)["seq"]
        assert (np.diff(numbers) > 0).all()
        holes = skipped[skipped > 8].sum() if name in ("head", "frame_timing") else 0
        assert numbers[-1] + 1 == len(numbers) + holes
    assert ["complete"] * 2 == list(recording.trials()["status"])
    assert not problems


BATCHES = """async ([code]) => {
    const { newStreams } = await import(`data:text/javascript;base64,${code}`);
    const sent = [];
    const streams = newStreams((batch) => sent.push(batch), { head: 15 });
    for (let i = 0; i < 5000; i += 1) streams.row("head", 1000 + i / 10, [i]);
    streams.skip("head", 3);
    streams.row("head", 1600, [1]);
    streams.row("head", 1590, [2]);
    streams.close();
    return sent;
}"""


def test_batches_are_cut_by_rows_and_by_time_and_go_on_at_a_number(browser: Any) -> None:
    page = browser.new_page()
    code = base64.b64encode((SITE / "streams.js").read_bytes()).decode()
    sent = page.evaluate(BATCHES, [code])
    assert [b["seq0"] for b in sent] == [15, 2063, 4111, 5018]
    assert [b["rows"] for b in sent] == [2048, 2048, 904, 2]
    decoded = [np.frombuffer(base64.b64decode(b["data"]), "<f4").reshape(-1, 2) for b in sent]
    assert [len(rows) for rows in decoded] == [b["rows"] for b in sent]
    assert decoded[3].tolist() == [[0.0, 1.0], [0.0, 2.0]]  # times never fall


def test_a_ray_meets_a_board_where_geometry_says(browser: Any) -> None:
    rng = np.random.default_rng(45)
    boards, rays = [], []
    for _ in range(1000):
        turn = rng.normal(size=(3, 3))
        basis, _ = np.linalg.qr(turn)
        right, up = basis[:, 0], basis[:, 1]
        middle = rng.uniform(-1, 1, 3)
        boards.append({"middle": middle.tolist(), "right": right.tolist(), "up": up.tolist()})
        target = middle + rng.uniform(-0.7, 0.7) * right + rng.uniform(-0.5, 0.5) * up
        start = middle + rng.normal(size=3) * 2
        way = (target - start) / np.linalg.norm(target - start)
        rays.append([start.tolist(), way.tolist()])
    page = browser.new_page()
    page.route("http://board.test/**", serve_site)
    page.goto("http://board.test/")
    met = page.evaluate(
        """async ([boards, rays]) => {
            const { meet } = await import("/headset.js");
            return boards.map((board, i) => meet(board, ...rays[i]));
        }""",
        [boards, rays],
    )
    differing = 0
    for board, (start, way), hit in zip(boards, rays, met, strict=True):
        middle, right, up = (np.array(board[n]) for n in ("middle", "right", "up"))
        # The corners' plane by a linear system: start + t way = middle + a right + b up.
        t, a, b = np.linalg.solve(np.stack([way, -right, -up], axis=1), middle - np.array(start))
        is_front = np.dot(np.cross(right, up), way) < -1e-6
        on_board = is_front and t > 0 and abs(a) <= 0.5 and abs(b) <= 0.5 * 704 / 1024
        differing += on_board != (hit is not None)
        if hit is not None and on_board:
            place = middle + (hit["at"][0] - 0.5) * right
            place = place + (0.5 - hit["at"][1]) * 704 / 1024 * up
            assert np.linalg.norm(np.array(start) + t * np.array(way) - place) < 1e-9
            assert hit["far_m"] == pytest.approx(t, abs=1e-9)
    assert differing == 0
    assert sum(hit is not None for hit in met) > 200


def serve_site(route: Any) -> None:
    """Answer with a file of the site, as a server would."""
    name = route.request.url.rsplit("/", 1)[-1]
    if not name:
        route.fulfill(body="<!doctype html>", content_type="text/html")
        return
    route.fulfill(body=(SITE / name).read_text("utf-8"), content_type="text/javascript")
