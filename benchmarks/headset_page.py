"""Print how large a page in a headset is, how many draws a person takes for each eye, how long the
page itself works for a frame of an audience of eleven, and what the page of waving loads before its
first trial, as bare waves, which need no plan.

    python -m benchmarks.headset_page

Own work is what `frame_timing` records as `own_ms`: all JavaScript of a frame in a headset, from
poses to calls of WebGL, with board, rays and streams. What the calls draw is left out: here
Chromium would draw without a graphics card, and a headset's chip does it beside the page.
"""

import argparse
import asyncio
import base64
import gzip
import json
import math
import shutil
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from aiohttp import web

from visavis.experiments.waving.on_page import study
from visavis.lab.geometry import Vector
from visavis.results.opened_study import OpenedStudy
from visavis.running.film_store import FilmStore, film_store
from visavis.running.live_store import LiveStore
from visavis.running.page.server import (
    DRAWN_FILM_FILES,
    FILES,
    HEADSET_FILES,
    LIVE_FILES,
    SITE,
)
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.gltf.exporting import glb_of_character
from visavis.study.films import Film, Lens, LiveFilm
from visavis.study.scenes import Scene

PICTURES_A_DRAW: Final = 5
"""As `site/live.js` joins a person's parts."""
RATE_HZ: Final = 90
FRAMES: Final = 900
"""Number of frames that are timed, ten seconds; as many before them let the browser compile."""
AUDIENCE: Final = LiveFilm(
    Film(
        Scene("audience"),
        4.0,
        rate_hz=30,
        lens=Lens((0.0, 1.4, 0.0), (0.0, 1.2, -5.0), 0.5),
        may_crop=True,
    )
)
HEADSET: Final = Path(__file__).parents[1] / "tests" / "running" / "page" / "headsets"
PAGE: Final = """<!doctype html><main><fieldset><legend>How lively?</legend>
<label>1<input type="radio"></label><label>2<input type="radio"></label></fieldset></main>
<div id="notice"></div><button id="stop">Stop</button><canvas></canvas>"""
UNDRAWN: Final = """for (const name of ["drawElements", "drawArrays", "clear"])
    WebGL2RenderingContext.prototype[name] = () => {};"""
TIMED: Final = """async ([step, frames]) => {
    const { open } = await import("/live.js");
    const { enter } = await import("/headset.js");
    const rows = [];
    const page = { main: document.querySelector("main"), notice: document.getElementById("notice"),
        stop: document.getElementById("stop"), say: (name) => name, happened: () => {}, next: {},
        send: (kind, event) => { if (event.stream === "frame_timing") rows.push(event); } };
    const worn = await enter({}, page);
    const canvas = document.querySelector("canvas");
    const figure = await open(step, canvas, "", () => {}, () => {});
    await figure.enter(worn);
    while (worn.frames() < 2 * frames) await new Promise((done) => setTimeout(done, 100));
    worn.close();
    figure.close();
    await worn.leave();
    return rows.map((event) => event.data);
}"""


def page_bytes() -> int:
    """Return how many bytes of files a page in a headset loads, compressed."""
    names = {**FILES, **LIVE_FILES, **DRAWN_FILM_FILES, **HEADSET_FILES}.values()
    return sum(len(gzip.compress((SITE / name).read_bytes(), 9)) for name in set(names))


def draws_of(data: bytes) -> int:
    """Return how many draws a person's file takes for one eye: one for every five pictures."""
    (length,) = struct.unpack_from("<I", data, 12)
    content = json.loads(data[20 : 20 + length])
    return max(1, math.ceil(len(content.get("images", ())) / PICTURES_A_DRAW))


def film_bytes() -> dict[str, int]:
    """Return how many bytes of each kind a page of waving loads before its first trial."""
    experiment = OpenedStudy(study).experiment({"increment": 0.0})
    films, lives = film_store(experiment), LiveStore(experiment.lives)
    kinds: dict[str, dict[str, int]] = {"room": {}, "person": {}, "poses": {}}
    for live in experiment.lives:
        assert isinstance(live, LiveFilm)
        described = lives.describe_film(live, films)
        for part in (described, *described["people"]):
            for kind in kinds.keys() & part.keys():
                kinds[kind][part[kind]["name"]] = part[kind]["bytes"]
    return {kind: sum(files.values()) for kind, files in kinds.items()}


async def own_ms(counts: Sequence[int]) -> list[Vector]:
    """Return how long the page works for each frame, for so many people of the audience."""
    from playwright.async_api import async_playwright

    store = LiveStore((AUDIENCE,))
    live = store.describe_film(AUDIENCE, FilmStore({}, Path()))
    steps = [
        {
            "live": live | {"people": live["people"][:count]},
            "questions": [],
            "limit_s": 3600,
            "once": False,
            "motions": [[]],
        }
        for count in counts
    ]
    app = web.Application()
    app.router.add_get("/", _answer(PAGE.encode(), "text/html"))
    for path, name in {**FILES, **LIVE_FILES, **DRAWN_FILM_FILES, **HEADSET_FILES}.items():
        if name.endswith(".js"):
            app.router.add_get(path, _answer((SITE / name).read_bytes(), "text/javascript"))
    for name, data in store.assets.items():
        app.router.add_get(f"/assets/{name}", _answer(data, "application/octet-stream"))
    runner = web.AppRunner(app)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", 0).start()
    address = f"http://127.0.0.1:{runner.addresses[0][1]}/"
    headset = (HEADSET / "standard.js").read_text("utf-8")
    assert "1000 / 72" in headset
    works = []
    async with async_playwright() as started:
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = await started.chromium.launch(executable_path=program, args=["--no-sandbox"])
        for step in steps:
            page = await browser.new_page()
            await page.add_init_script(headset.replace("1000 / 72", f"1000 / {RATE_HZ}"))
            await page.add_init_script(UNDRAWN)
            await page.goto(address)
            await page.click("#stop")  # a browser enters a headset for whoever pressed a button
            batches = await page.evaluate(TIMED, [step, FRAMES])
            rows = [np.frombuffer(base64.b64decode(b), "<f4").reshape(-1, 6) for b in batches]
            drawn = np.concatenate(rows)[:, [3, 5]]
            works.append(drawn[drawn[:, 1] == 1, 0][-FRAMES:])
            await page.close()
        await browser.close()
    await runner.cleanup()
    return works


def _answer(data: bytes, kind: str) -> Any:
    # Isolated pages have a clock of 5 us, others one of 100.
    headers = {
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Embedder-Policy": "require-corp",
    }

    async def answer(request: web.Request) -> web.Response:
        return web.Response(body=data, content_type=kind, headers=headers)

    return answer


def main() -> None:
    """Print all of it."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(f"page in a headset: {page_bytes() / 1000:.0f} kB compressed (gzip)")
    for name in cast_names():
        data = glb_of_character(load_character(name))
        print(f"{name}: {draws_of(data)} draws for each eye")
    alone, audience = asyncio.run(own_ms((1, 11)))
    for who, work in (("one person", alone), ("an audience of 11", audience)):
        median, most = np.percentile(work, [50, 99])
        print(f"own work a frame, {who}: median {median:.2f} ms, p99 {most:.2f} ms")
    each = (np.median(audience) - np.median(alone)) / 10
    print(f"own work a frame, each further person: {each:.3f} ms")
    print(f"a frame at {RATE_HZ} Hz: {1000 / RATE_HZ:.1f} ms")
    for kind, count in film_bytes().items():
        print(f"waving_page, {kind}: {count / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
