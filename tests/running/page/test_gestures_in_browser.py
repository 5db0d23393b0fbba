"""Both studies of speaking bodies in a real browser with sound: one plays a film once, the other
pairs again and again; from consent to thanks, through reloads and a server that was killed.
"""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from tests.running.page.test_browser import (
    PATIENCE_S,
    POLL_S,
    Server,
    playwright_error,
    server,
    state_of,
    step_on,
    until,
)
from tests.running.page.test_heard_in_browser import digits_of
from tests.store import STORE
from visavis.lab.clock import NS_PER_MS, StopWatch
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.running.page.desk import RELOAD_FLAG
from visavis.running.page.earlier_parts import RESTART_FLAG

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]  # a browser, and films that are drawn

FRAME_MS = 1000 / 30
FILM_S = 11.0
ONE_PART = ("--set", "part=1", "--set", "version=1")
PLAYS = """
window.plays = 0;
const play = HTMLMediaElement.prototype.play;
HTMLMediaElement.prototype.play = function () {
    if (this.tagName === "VIDEO" && this.currentTime === 0) window.plays += 1;
    return play.call(this);
};
"""
"""Counts how often a film begins."""
FILMS = """() => [...document.querySelectorAll("video")].map((v) => ({ at_s: v.currentTime,
    plays: !v.paused, ended: v.ended, muted: v.muted, controls: v.controls }))"""
SECOND = "document.querySelectorAll('video')[1]"
MENU_OF = """() => { const box = document.querySelector("video").getBoundingClientRect();
    const [x, y] = [box.left + box.width / 2, box.top + box.height / 2];
    return document.elementFromPoint(x, y).tagName; }"""

__all__ = ["server"]  # the fixture


@pytest.fixture(scope="module")
def film_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the films of both studies lie: the pair is of those that the first one shows alone."""
    return STORE.cache("first trials of gestures", tmp_path_factory.mktemp("films"))


@pytest.fixture
def server_with_films(server: Server, film_cache: Path) -> Server:
    """The server, with the films that were drawn before."""
    (server.root / "cache").symlink_to(film_cache, target_is_directory=True)
    return server


def films_on(page: Any) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = page.evaluate(FILMS)
    return found


def wait_for(page: Any, is_so: Callable[[Any], bool], *, steps: bool = False) -> None:
    """Wait for a fact; with `steps` do what the page asks for until then."""
    watch = StopWatch()
    while True:
        assert watch.elapsed_s() < PATIENCE_S, (state_of(page), films_on(page))
        with contextlib.suppress(playwright_error()):  # the page is just being loaded
            if is_so(page):
                return
            if steps:
                step_on(page)
        page.wait_for_timeout(1000 * POLL_S)


def is_under_way(page: Any) -> bool:
    films = films_on(page)
    return bool(films) and all(f["at_s"] > 0.5 for f in films)


def is_second_under_way(page: Any) -> bool:
    return page.inner_text("#progress") == "2 of 2" and is_under_way(page)


def can_answer(page: Any) -> bool:
    return page.query_selector("#main input[type=radio]:not([disabled])") is not None


def open_study(server: Server, browser: Any, study: str, *only: str) -> tuple[Any, list[str]]:
    """Run a study up to its first film; return the page, and what went wrong on it so far."""
    address = server.start("run", study, "--participant", "1", "--on", "browser", *ONE_PART, *only)
    page = browser.new_context(viewport={"width": 1000, "height": 800}).new_page()
    problems: list[str] = []
    responses: list[Any] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("response", lambda response: responses.append(response))
    page.add_init_script(PLAYS)
    page.goto(address)
    until(page, "Play the voice")
    page.get_by_text("Play the voice").click()
    page.fill("#heard", digits_of(responses))
    page.get_by_text("Continue").click()
    return page, problems


def reload(page: Any) -> None:
    """Load the page anew in the middle of a film, and have the film begin again."""
    wait_for(page, is_under_way, steps=True)
    page.reload()
    wait_for(page, is_under_way, steps=True)  # there may be a button to press for sound


def kill_and_resume(server: Server, study: str) -> None:
    server.kill()
    session = session_dir(server.root / "data", study, "S01B", 1, is_simulated=True)
    server.start("resume", str(session))


def rows_of(server: Server, study: str) -> pd.DataFrame:
    """Return the trials of a session that is over, whose sound was heard from the start on."""
    output = server.end()
    session = session_dir(server.root / "data", study, "S01B", 1, is_simulated=True)
    recording = Recording(session)
    assert "complete" == recording.status, output
    (checked,) = recording.events_named("sound_checked", 1)["payload"]
    assert checked["is_right"]
    rows = recording.trials()
    assert {"complete"} == set(rows["status"])
    assert (rows["film_volume_01"] == 1.0).all()
    # The pair counts from when both films are there: one of them may have begun sooner.
    apart_ms = rows["film_apart_ms"].astype(float).fillna(0.0)
    off_ms = (rows["film_sound_on_ns"] - rows["film_on_ns"]).abs().astype(float) / NS_PER_MS
    assert (off_ms < FRAME_MS + apart_ms).all(), (off_ms, apart_ms)
    assert RELOAD_FLAG in rows["flags"].iloc[0]
    assert RESTART_FLAG in ";".join(rows["flags"])
    return rows


def test_single_clips_are_heard_once_each_through_a_reload_and_a_killed_server(
    server_with_films: Server, browser: Any
) -> None:
    two_bodies = ("--set", "body=[corpus, holds]")
    page, problems = open_study(server_with_films, browser, "gestures", *two_bodies)
    reload(page)
    wait_for(page, can_answer)
    (film,) = films_on(page)
    assert film["ended"]
    assert not film["muted"]
    assert not film["controls"]
    assert 1 == page.evaluate("window.plays")
    assert "VIDEO" != page.evaluate(MENU_OF)  # a browser's menu of a film can play it again
    wait_for(page, is_second_under_way, steps=True)
    kill_and_resume(server_with_films, "gestures")
    until(page, "Thank you")
    rows = rows_of(server_with_films, "gestures")
    assert [1, 1] == rows["film_rounds"].astype(int).tolist()
    assert {"corpus", "holds"} == set(rows["body"])
    assert (rows["naturalness_ms"] >= 1000 * FILM_S - FRAME_MS).all()
    assert [] == problems


def test_a_pair_is_heard_again_and_again_through_a_reload_and_a_killed_server(
    server_with_films: Server, browser: Any
) -> None:
    page, problems = open_study(server_with_films, browser, "gesture_pairs")
    reload(page)
    page.evaluate(SECOND + ".pause()")  # as if its decoder came to nothing for a while
    wait_for(page, lambda page: not films_on(page)[0]["plays"])
    page.evaluate(SECOND + ".play()")
    wait_for(page, lambda page: all(film["plays"] for film in films_on(page)))
    wait_for(page, can_answer)
    wait_for(page, lambda page: page.evaluate("window.plays") >= 4 and is_under_way(page))
    assert [False, True] == sorted(film["muted"] for film in films_on(page))
    kill_and_resume(server_with_films, "gesture_pairs")
    until(page, "Thank you")
    rows = rows_of(server_with_films, "gesture_pairs")
    assert (rows["film_rounds"] >= 1).all()
    assert rows["vote"].notna().all()
    assert [] == problems
