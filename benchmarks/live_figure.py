"""Print figures of live pages; `--out FOLDER` writes film and page side by side, too.

    python -m benchmarks.live_figure --out out/live

The page is drawn by Chromium, here without a graphics card as a rule: processor time of the poses
is a figure, frames a second are none.
"""

import argparse
import asyncio
import base64
import io
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from aiohttp import web
from PIL import Image
from scipy.ndimage import binary_erosion, label

from visavis.lab.clock import StopWatch
from visavis.lab.geometry import Vector, quat_multiply
from visavis.running.film_store import FilmStore, camera_of
from visavis.running.live_store import PERSON_AHEAD_M, LiveStore
from visavis.running.page.server import LIVE_FILES, SITE
from visavis.stage.card.context import offscreen_context, release_offscreen
from visavis.stage.levels import DetailRule
from visavis.stage.renderer import ON_PROCESSOR, Renderer
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.gltf.exporting import glb_of_character
from visavis.stimuli.motion.synthesis.blend_file import packed_examples
from visavis.stimuli.motion.synthesis.example_blend import Blend, blend_at
from visavis.stimuli.motion.synthesis.style_weights import fit_weights
from visavis.stimuli.picture import Picture, PosedPeople
from visavis.study.films import Film, Lens
from visavis.study.live import Live, walks
from visavis.study.scenes import Scene

SIDE_PX: Final = 600
FOV_DEG: Final = 34.0
CODES: Final = 16
VIEWS: Final[Mapping[str, tuple[tuple[float, float, float], tuple[float, float, float]]]] = {
    "1.0 m": ((0.35, 1.55, -1.0), (0.0, 1.50, 0.0)),
    "2.7 m": ((-0.9, 1.35, -2.5), (0.0, 0.95, 0.0)),
    "6.0 m": ((2.2, 1.6, -5.5), (0.0, 0.9, 0.0)),
}
AT: Final = {"slouch": [0.0], "plain": [0.5], "march": [1.0]}
PAGE: Final = f"""<!doctype html><style>canvas {{ width: {SIDE_PX}px; height: {SIDE_PX}px; }}
body {{ margin: 0; }}</style><canvas></canvas>"""
STILL: Final = "window.requestAnimationFrame = (f) => setTimeout(() => f(0), 100);"
DRAWN: Final = """async (step) => {
    const began = performance.now();
    const live = await import("/live.js");
    const canvas = document.querySelector("canvas");
    window.figure = await live.open(step, canvas, "", () => {}, () => {});
    while (!(canvas.dataset.frames > 1)) await new Promise((r) => setTimeout(r, 20));
    return performance.now() - began;
}"""
TIMED: Final = """async ([file, values]) => {
    const blends = await import("/blend.js");
    const blend = blends.readBlend(Uint8Array.from(atob(file), (c) => c.charCodeAt(0)).buffer);
    const pose = blends.newPose(blend);
    const round = () => {
        const w = blends.weightsAt(blend, values);
        const gaps = blends.gapsOf(blend, w);
        const times = [];
        for (let i = 0; i < 200; i += 1) {
            const from = performance.now();
            for (let k = 0; k < 10; k += 1) blends.poseAt(blend, w, (0.37 * k) % 4, pose, gaps);
            times.push((performance.now() - from) / 10);
        }
        return Math.min(...times);
    };
    round();
    return round();
}"""


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, default=None)
    out = parser.parse_args().out
    sizes = {n: len(glb_of_character(load_character(n))) for n in cast_names()}
    largest = max(sizes, key=lambda name: sizes[name])
    print(f".glb of a person: {min(sizes.values()) / 1e6:.2f} to {sizes[largest] / 1e6:.2f} MB")
    examples = walks("set_b")
    weights = fit_weights(np.random.default_rng(1).uniform(0, 1, (len(examples), 4)))
    values = np.full(4, 0.5)
    shares = weights.at(values)
    print(f"python, blend of {len(examples)} walks x {examples.turns.shape[1]} joints: ", end="")
    print(f"{_quickest_ms(lambda: blend_at(examples, shares, 1.3)):.3f} ms a frame")
    print(f"python, weights: {_quickest_ms(lambda: weights.at(values)):.3f} ms")
    drawn = asyncio.run(_page(packed_examples(examples, weights), values))
    print(f"page, the same blend: {drawn['pose_ms']:.3f} ms a frame")
    print(f"page, from its files to the first frames: {drawn['ready_ms'] / 1000:.1f} s")
    for name, (own, page, figure) in _side_by_side(drawn["pictures"]).items():
        apart = np.abs(own.astype(np.int64) - page).max(axis=-1)[figure]
        share = float((apart > CODES).mean())
        said = f"{share:.1%} of the figure's pixels > {CODES} codes apart"
        print(f"film and page from {name}: {said}, median {np.median(apart):.0f}")
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            both = np.concatenate([own, page], axis=1)
            Image.fromarray(both).save(out / f"film_and_page_{name[:3]}m.png")


def _quickest_ms(act: Any) -> float:
    act()
    times = []
    for _ in range(200):
        watch = StopWatch()
        act()
        times.append(watch.elapsed_s())
    return 1e3 * min(times)


def _lives() -> dict[str, Live]:
    three = walks("set_a", *AT)
    return {
        name: Live(three, at=AT, camera="still", eye_m=eye, aim_m=aim)
        for name, (eye, aim) in VIEWS.items()
    }


async def _page(file: bytes, values: Vector) -> dict[str, Any]:
    """Return what Chromium draws and how long it takes."""
    from playwright.async_api import ViewportSize, async_playwright

    lives = _lives()
    store = LiveStore(tuple(lives.values()))
    steps = {
        name: {
            "live": store.describe(live),
            "questions": [{"name": "activeness", "start": 0.5}],
            "limit_s": 300,
            "until": None,
        }
        for name, live in lives.items()
    }
    app = web.Application()
    app.router.add_get("/", _answer(PAGE.encode(), "text/html"))
    for path, name in {**LIVE_FILES, "/wire.js": "wire.js"}.items():
        app.router.add_get(path, _answer((SITE / name).read_bytes(), "text/javascript"))
    for name, data in store.assets.items():
        app.router.add_get(f"/assets/{name}", _answer(data, "application/octet-stream"))
    runner = web.AppRunner(app)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", 0).start()
    address = f"http://127.0.0.1:{runner.addresses[0][1]}/"
    pictures, ready = {}, []
    async with async_playwright() as started:
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = await started.chromium.launch(executable_path=program, args=["--no-sandbox"])
        size: ViewportSize = {"width": SIDE_PX, "height": SIDE_PX}
        for name, step in steps.items():
            page = await browser.new_page(viewport=size)
            await page.add_init_script(STILL)
            await page.goto(address)
            ready.append(await page.evaluate(DRAWN, step))
            shot = await page.screenshot(path=None, timeout=120_000)
            pictures[name] = _pixels(shot)
            await page.close()
        page = await browser.new_page()
        await page.goto(address)
        given = [base64.b64encode(file).decode(), values.tolist()]
        pose_ms = await page.evaluate(TIMED, given)
        await browser.close()
    await runner.cleanup()
    return {"pictures": pictures, "ready_ms": min(ready), "pose_ms": pose_ms}


def _answer(data: bytes, kind: str) -> Any:
    async def answer(request: web.Request) -> web.Response:
        return web.Response(body=data, content_type=kind)

    return answer


def _pixels(png: bytes) -> Any:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(np.int64)


def _side_by_side(pages: Mapping[str, Any]) -> dict[str, tuple[Any, Any, Any]]:
    """Return for every view the film's picture, the page's, and where the figure is."""
    lives = _lives()
    live = lives["1.0 m"]
    assert live.weights is not None
    frames = Blend(live.examples, live.weights.at(np.array([0.5])), in_place=True).at(0.0)
    film = Film(Scene("person", motion="walk", character=live.character), 1.0)
    picture = next(iter(FilmStore({}, Path()).pictures(film)))
    turns = frames.orientation_wxyz.copy()
    turns[0] = quat_multiply(np.array([0.0, 0.0, 1.0, 0.0]), turns[0])
    root = np.array(_turned(frames.root_m))
    there = replace(picture, people=PosedPeople(root[None], turns[None], np.zeros((1, 6))))
    away = PosedPeople(root[None] + np.array([0.0, 0.0, 60.0]), turns[None], np.zeros((1, 6)))
    context = offscreen_context()
    shown = {}
    try:
        with Renderer(context, quality=replace(ON_PROCESSOR, samples=4, detail=DetailRule())) as r:
            for name, (eye, aim) in VIEWS.items():
                own = _image(r, there, eye, aim)
                empty = _image(r, replace(picture, people=away), eye, aim)
                areas, _ = label(np.abs(own - empty).max(axis=-1) > 12)
                figure = areas == np.bincount(areas.ravel())[1:].argmax() + 1
                shown[name] = (
                    own.astype(np.uint8),
                    pages[name].astype(np.uint8),
                    binary_erosion(figure, iterations=2),
                )
    finally:
        release_offscreen(context)
    return shown


def _turned(point: Any) -> tuple[float, float, float]:
    return -float(point[0]), float(point[1]), -float(point[2]) - PERSON_AHEAD_M


def _image(renderer: Renderer, picture: Picture, eye: Any, aim: Any) -> Any:
    lens = Lens(_turned(eye), _turned(aim), float(np.tan(np.radians(FOV_DEG / 2))))
    size = (SIDE_PX, SIDE_PX)
    return np.asarray(renderer.image(picture, camera_of(lens, size), size)).astype(np.int64)


if __name__ == "__main__":
    main()
