"""Films that are shown once: the page stays at the last picture, and records one round."""

import shutil
import subprocess

import pytest

from visavis.lab.errors import DesignError
from visavis.running.page.server import SITE
from visavis.study.films import Film, Viewing
from visavis.study.scenes import Scene

FILM = Film(Scene("speaking"), 2.0)
PLAYS = """
import { play } from "FILM_JS";
const video = { listeners: {}, ended: false, readyState: 4, currentTime: 0, plays: 0,
  addEventListener(name, act) { this.listeners[name] = act; },
  play() { this.plays += 1; this.ended = false; return Promise.resolve(); },
  pause() {}, requestVideoFrameCallback() {} };
const rounds = [];
const player = play([{ film: "f", place: "film" }], [video], (r) => rounds.push(r), ONCE);
player.first.catch(() => {});
await new Promise((resolve) => setImmediate(resolve));
for (let k = 0; k < 2 && video.plays === k + 1; k += 1) {
  video.ended = true;
  video.listeners.ended();
}
player.resume();
console.log(JSON.stringify([video.plays, rounds, player.report().film.rounds]));
process.exit(0);
"""


def plays(once: str) -> str:
    """Return what Node says of a film that ended twice if it could."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs the Debian package nodejs")
    script = PLAYS.replace("FILM_JS", (SITE / "film.js").as_uri()).replace("ONCE", once)
    ran = subprocess.run(
        [node, "--input-type=module", "-e", script],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    return ran.stdout.strip()


def test_a_film_without_replay_plays_once() -> None:
    assert plays("true") == "[1,[1],1]"


def test_other_films_play_round_after_round() -> None:
    assert plays("false") == "[3,[1,2],2]"


def test_more_rounds_than_are_shown_cannot_be_asked_for() -> None:
    with pytest.raises(DesignError, match="min_rounds is 2 without replay; give 0 or 1"):
        Viewing(FILM, (), min_rounds=2, replay=False)
