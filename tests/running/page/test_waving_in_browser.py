"""Waving's variant in a headset's browser, from consent to thanks: drawn, pressed, recorded."""

import shutil
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from platformdirs import user_cache_path

from tests.experiments.waving.test_on_page import SMALL, opened, visavis
from tests.running.page.test_browser import Server, state_of, until
from tests.running.page.test_browser import server as server
from tests.running.page.test_headset_in_browser import (
    before_a_headset,
    figures,
    payloads,
    press,
    say_how_one_feels,
    wait,
)
from visavis.analysis.session_check import check_session
from visavis.lab.clock import NS_PER_MS
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]  # a browser

PLACES = ["left 2", "left", "me", "right", "right 2"]


def keep_waves(root: Path) -> None:
    """Let a server find the waves that take minutes to plan, as a lab's second session does."""
    opened().experiment(SMALL).prepare()
    made = user_cache_path("visavis", appauthor=False) / "waving"
    shutil.copytree(made, root / "cache" / "visavis" / "waving")


def begin(server: Server, browser: Any, which: str) -> tuple[Any, list[str]]:
    """Return the page of a short session before a headset."""
    keep_waves(server.root)
    given = [f"--set={name}={value}" for name, value in SMALL.items()]
    address = server.start("run", "waving_page", "--participant", "1", *given)
    return before_a_headset(browser, address, which)


@pytest.mark.parametrize("which", ["standard", "emulator"])
def test_waving_runs_from_consent_to_thanks_in_a_headset(
    which: str, server: Server, browser: Any
) -> None:
    page, problems = begin(server, browser, which)
    page.locator("#main button:not(.quiet):not([disabled])").click()
    say_how_one_feels(page)
    path = session_dir(server.root / "data", "waving_page", "S01B", 1, is_simulated=True)
    count = (
        len(Recording(path).manifest.plan["blocks"]),
        len([t for block in Recording(path).manifest.plan["blocks"] for t in block["trials"]]),
    )
    for trial in range(count[1]):
        go_to_figures(page)
        # Ten people, each one draw for each eye; everybody stands still while questions are asked.
        assert "10" == page.get_attribute("canvas.figure", "data-draws")
        press(page, PLACES[trial % 5])
        press(page, str(1 + trial))
        press(page, "Continue")
        page.wait_for_selector("input:checked", state="detached", timeout=120_000)
    wait(page, "() => worn.board.texts().includes('Leave VR')")
    press(page, "Leave VR")  # what is typed is for the flat page
    wait(page, "() => !worn.isPresenting()")
    until(page, "Thank you")
    output = server.end()
    recording = Recording(path)
    rows = recording.trials()
    assert ["complete"] * count[1] == list(rows["status"]), output
    places = ["place_1", "place_2", "place_3", "place_4", "place_5"]
    assert [places[i % 5] for i in range(count[1])] == list(rows["who"])
    assert [1 + i for i in range(count[1])] == list(rows["realism"])
    assert {"ray"} == {*rows["who_by"], *rows["realism_by"]}
    assert {"headset"} == {*rows["seen_in"]}
    # Each was seen to its end before its questions were asked, and its answers come after that.
    lasts_ms = 1000 * (SMALL["before_s"] + SMALL["wave_s"] + SMALL["after_s"])
    answered = [p for p in payloads(recording, "answered") if p["question"] == "who"]
    waited = (np.array([p["asked_ns"] for p in answered]) - rows["live_on_ns"]) / NS_PER_MS
    assert (waited >= lasts_ms - 100).all()
    assert (rows["who_ms"] > 0).all()
    assert not problems
    checked = {s.stream: s for s in check_session(recording).streams}
    assert checked["head"].rows > 0
    study = opened()
    intake = study.measure(recording)
    assert len(intake.rows) == count[1]
    visavis("analyse", path.parents[1], "--processes", 1)
    visavis("export", path.parents[1], "--format", "bids", "--output", server.root / "bids")
    visavis("view", path, "--output", server.root / "page.html")
    assert 0 < (server.root / "page.html").stat().st_size


def go_to_figures(page: Any) -> None:
    """Go on by the board past what is read, to figures whose questions may be answered."""
    while page.locator("fieldset").count() == 0:
        wait(page, "() => document.querySelector('fieldset, #main button:not([disabled])')")
        text = state_of(page)["text"]
        if page.locator("fieldset").count() == 0:
            press(page, "Continue")
            wait(page, partial(is_elsewhere, page, text))
    figures(page)


def is_elsewhere(page: Any, text: str) -> bool:
    """Tell whether a page says something else by now."""
    return bool(state_of(page)["text"] != text)
