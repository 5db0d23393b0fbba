"""Two films of a pair stay together: the one that is ahead waits, and what is apart is recorded."""

import json
import shutil
import subprocess
from typing import Any

import pytest

from visavis.running.page.server import SITE

PLAYS = """
import { play } from "FILM_JS";
const newVideo = () => ({ listeners: {}, paused: true, ended: false, readyState: 4, currentTime: 0,
  addEventListener(name, act) { this.listeners[name] = act; },
  play() { this.paused = false; return Promise.resolve(); },
  pause() { this.paused = true; },
  requestVideoFrameCallback(act) { this.present = act; } });
const videos = [newVideo(), newVideo()];
const films = [{ film: "a", place: "left" }, { film: "b", place: "right" }];
const player = play(films, videos, () => {});
player.first.catch(() => {});
await new Promise((resolve) => setImmediate(resolve));
const log = [];
RENDERINGS.forEach((places, k) => {
  places.forEach((mediaTime, i) => {
    if (mediaTime === "end") { videos[i].ended = true; videos[i].listeners.ended(); }
    else if (mediaTime !== null) videos[i].present(100 * k, { mediaTime });
  });
  log.push(videos.map((v) => v.paused));
});
videos.forEach((v) => { v.ended = true; });
videos[1].listeners.ended();
log.push(videos.map((v) => v.paused));
const reports = Object.values(player.report());
console.log(JSON.stringify([log, Math.round(player.apartMs()), reports.map((r) => r.first_at_ms)]));
process.exit(0);
"""


Renderings = list[list[float | str | None]]


def reports_of(renderings: Renderings) -> tuple[list[list[bool]], int, list[float]]:
    """Return which films stood after each rendering of these media times (None: no new picture,
    "end": it ends) and after the end, how far apart the page says they were (ms), and where in each
    film it says the first picture stood (ms).
    """
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs the Debian package nodejs")
    script = PLAYS.replace("FILM_JS", (SITE / "film.js").as_uri())
    ran = subprocess.run(
        [node, "--input-type=module", "-e", script.replace("RENDERINGS", json.dumps(renderings))],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    found: Any = json.loads(ran.stdout)
    return found[0], found[1], found[2]


def waits(renderings: Renderings) -> tuple[list[list[bool]], int]:
    """Return which films stood after each rendering and after the end, and how far apart (ms)."""
    return reports_of(renderings)[:2]


def test_the_film_that_is_ahead_waits_until_the_other_has_come() -> None:
    together = [False, False]
    log, apart_ms = waits([[0.0, 0.0], [0.3, 0.1], [None, 0.2], [None, 0.29], [None, 0.3]])
    assert [together, together, [True, False], [True, False], together, together] == log
    assert 200 == apart_ms


def test_a_film_that_waits_goes_on_when_the_other_has_ended() -> None:
    log, _ = waits([[0.0, 0.0], [0.0, 0.3], [0.1, None]])
    assert [[False, True], [False, False]] == log[-2:]


def test_no_film_waits_for_one_that_has_ended() -> None:
    log, _ = waits([[0.0, 0.0], [0.4, 0.4], ["end", 0.45], [None, 0.55], [None, 0.6]])
    assert [[False, False]] * 5 == log[:5]


def test_pictures_of_one_rendering_are_together_however_late_it_was() -> None:
    log, apart_ms = waits([[0.0, 0.0], [3.0, 3.0], [6.0, 6.0]])
    assert [[False, False]] * 4 == log
    assert 0 == apart_ms


def test_a_page_says_where_in_a_film_its_first_picture_stood() -> None:
    assert [260, 0] == reports_of([[None, 0.0], [0.26, 0.03], [0.3, 0.06]])[2]
