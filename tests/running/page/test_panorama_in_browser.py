"""A panorama on a page in a real browser: what is ahead, turns by keys, reloads and kills."""

import contextlib
import io
from typing import Any

import numpy as np
import pytest
from PIL import Image as Files

from tests.running.page.test_browser import (
    PATIENCE_S,
    Server,
    playwright_error,
    state_of,
    step_on,
    until,
)
from tests.running.page.test_browser import server as server
from tests.running.page.test_flat_in_browser import measure_screen
from tests.running.page.test_panorama_on_page import direction_of, directions_picture
from visavis.cli.film.on_page import page_pictures
from visavis.lab.clock import StopWatch
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import find_study
from visavis.stimuli.view_turns import VIEW_TURNED

pytestmark = [
    pytest.mark.slow,  # a browser
    pytest.mark.timeout(600),
]
STUDY = """
from visavis import Factor, Keys, Panorama, Study, Text, view_range

study = Study("around", factors=[Factor("ahead", [60, -90])], on="browser", uses=(),
              calibrate=False, order="fixed", measures=[view_range()])


@study.trial
def trial(t):
    yield t.show([Panorama("a.png", yaw_deg=t.ahead), Text("+", at_deg=(8, 0))],
                 until=Keys("f", "space"), limit_s=60)
"""
SIZE_PX = (1200, 800)


def ahead(page: Any) -> tuple[float, float]:
    """Return what a page shows in its middle."""
    image = Files.open(io.BytesIO(page.screenshot())).convert("RGB")
    return direction_of(image.getpixel((SIZE_PX[0] // 2, SIZE_PX[1] // 2)))


def until_ahead(page: Any, right_deg: float, up_deg: float) -> None:
    """Go on until a page shows a direction in its middle."""
    watch = StopWatch()
    while True:
        assert watch.elapsed_s() < PATIENCE_S, state_of(page)
        with contextlib.suppress(playwright_error(), AssertionError):
            if page.query_selector("canvas.flat[data-part='0']"):
                if np.allclose(ahead(page), (right_deg, up_deg), atol=1.5):
                    return
            elif state_of(page)["kind"] != "flat":
                measure_screen(page)
                step_on(page)
        page.wait_for_timeout(30)


def test_arrow_keys_turn_the_view_through_a_reload_and_a_kill(server: Server, browser: Any) -> None:
    directions_picture(server.root / "a.png")
    (server.root / "around.py").write_text(STUDY, "utf-8")
    address = server.start("run", "./around.py", "--participant", "1", "--on", "browser")
    wide, high = SIZE_PX
    page = browser.new_context(viewport={"width": wide, "height": high}).new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(address)
    until_ahead(page, 60, 0)
    page.keyboard.press("ArrowRight")
    until_ahead(page, 90, 0)
    page.reload()  # the trial begins anew
    until_ahead(page, 60, 0)
    page.keyboard.press("ArrowRight")
    until_ahead(page, 90, 0)
    page.keyboard.press("ArrowUp")
    until_ahead(page, 90, 30)
    page.keyboard.press("f")
    until_ahead(page, -90, 0)
    server.kill()
    page.keyboard.press("ArrowLeft")
    until_ahead(page, -120, 0)
    page.keyboard.press("f")
    session = server.root / "data/simulated/around/sub-S01B/ses-001"
    assert address == server.start("resume", str(session))
    until(page, "Thank you")
    server.end()
    recording = CachedRecording(session)
    assert "complete" == recording.status
    assert [] == problems

    study = find_study(str(server.root / "around.py"))
    rows = study.measure(recording).rows.set_index("ahead")
    assert ["f", "f"] == list(rows["answer"])
    assert 30 == pytest.approx(rows.loc[60, "view_range_deg"], abs=0.01)
    assert 30 == pytest.approx(rows.loc[-90, "view_range_deg"], abs=0.01)
    events = recording.events()
    turns = events.loc[events["name"] == VIEW_TURNED, "payload"]
    goals = [(p["to_yaw_deg"], p["to_pitch_deg"]) for p in turns]
    assert [(30, 0), (30, 30), (-30, 0)] == goals
    for row, expected in ((rows.loc[60], (90, 30)), (rows.loc[-90], (-120, 0))):
        times_ns = [int(row["stimulus_on_ns"]), int(row["stimulus_off_ns"]) - 10**7]
        pictures = page_pictures(
            study, recording, row["trial_id"], lambda *_, t=times_ns: t, (600, 400)
        )
        first, last = (direction_of(image[200, 300]) for _, image, _ in pictures)
        assert (row.name, 0) == pytest.approx(first, abs=1.5)
        assert expected == pytest.approx(last, abs=1.5)
