"""Live figures in a real browser: the same poses as in Python, a real slider, a turned camera."""

import base64
import contextlib
import json
import os
import re
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.commands import COMMANDS
from tests.running.page.test_browser import (
    PATIENCE_S,
    REPOSITORY,
    Server,
    faults_for_people,
    playwright_error,
    state_of,
    until,
)
from tests.running.page.test_browser import server as server
from tests.running.page.test_elsewhere import Host, recording_of, save, served_files
from tests.running.page.test_headset_in_browser import FILES, serve_site
from tests.running.page.test_live_scenes import STUDY as WATCHED
from visavis.experiments.adjectives.pairs import PAIRS
from visavis.experiments.matching.interfaces import target_shares
from visavis.lab.config_files import EXAMPLE
from visavis.lab.geometry import Vector
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.results.moves import moves_of
from visavis.running.film_store import FilmStore
from visavis.running.live_film import live_film_files
from visavis.running.page.server import SITE
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.motion.synthesis.blend_file import packed_examples
from visavis.stimuli.motion.synthesis.example_blend import Blend, blend_at
from visavis.stimuli.motion.synthesis.gesture_styles import gesture_examples
from visavis.stimuli.motion.synthesis.pose_distance import MATCH_M
from visavis.stimuli.motion.synthesis.style_weights import fit_weights
from visavis.stimuli.motion.synthesis.walk_styles import style_names, walk_examples
from visavis.study.films import Film
from visavis.study.scenes import Scene

STUDY = Path(__file__).parents[2] / "studies" / "moulding.py"
DRAWN = "[data-frames]:not([data-frames='0']):not([data-frames='1']):not([data-frames='2'])"
"""A canvas that has drawn three frames; a page's policy forbids to evaluate a condition there."""
SELDOM = FILES / "seldom.js"
"""Nobody looks at most pictures of a figure, and drawing one costs a processor much."""
SETTINGS = 1000
MAX_RAD = 1e-5
POSES = """async ([code, file, values, phases, times]) => {
    const blends = await import(`data:text/javascript;base64,${code}`);
    const bytes = Uint8Array.from(atob(file), (c) => c.charCodeAt(0));
    const blend = blends.readBlend(bytes.buffer);
    const pose = blends.newPose(blend);
    return values.map((row, i) => {
        const w = blends.weightsAt(blend, row);
        const keys = blends.keyTimes(blend, w);
        blends.poseAt(blend, w, phases[i], pose);
        return { weights: [...w], root: [...pose.root], turns: pose.turns.flat(),
            place: blends.inPlace(blend, w, keys, phases[i], pose.root),
            phase: blends.phaseOf(keys, times[i]) };
    });
}"""
PLACES = """async ([file, frames, rate]) => {
    const { actorOf } = await import("/drawn_film.js");
    const { readArrays } = await import("/blend.js");
    const poses = readArrays(Uint8Array.from(atob(file), (c) => c.charCodeAt(0)).buffer);
    const bones = new Float32Array(12 * poses.head.joints);
    const rest = new Float32Array(3 * poses.head.joints);
    const actor = actorOf(poses, { rest }, 0, {}, true);
    return Array.from({ length: frames }, (_, k) => {
        actor.step(k ? 1 / rate : 1e-9, bones);
        return actor.pose.place.map((at) => [...at]);
    });
}"""

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # a browser


def base64_of(data: bytes) -> str:
    return base64.b64encode(data).decode()


def angle_rad(a: Vector, b: Vector) -> Vector:
    """Return the angles between rotations, exactly where they are small."""
    b = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0, -b, b)
    half = np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0.0, 1.0)
    angles: Vector = 4.0 * np.arcsin(half)
    return angles


def test_a_page_blends_as_python_does_over_a_thousand_settings(browser: Any) -> None:
    body = build_of_character(load_character("anna"))
    examples = walk_examples(style_names("set_b"), body)  # 27 walks of 55 joints
    rng = np.random.default_rng(39)
    weights = fit_weights(rng.uniform(0.0, 1.0, (len(examples), 4)))
    values = rng.uniform(0.0, 1.0, (SETTINGS, 4))
    phases = rng.uniform(0.0, 4.0, SETTINGS)
    times = rng.uniform(0.0, 9.0, SETTINGS)
    page = browser.new_page()
    code = base64_of((SITE / "blend.js").read_bytes())
    file = base64_of(packed_examples(examples, weights))
    files = [code, file, values.tolist(), phases.tolist(), times.tolist()]
    drawn = page.evaluate(POSES, files)
    expected_weights = weights.at(values)
    frames = blend_at(examples, expected_weights, phases)
    turns = np.array([d["turns"] for d in drawn]).reshape(frames.orientation_wxyz.shape)
    assert np.abs(np.array([d["weights"] for d in drawn]) - expected_weights).max() < 1e-12
    assert angle_rad(turns, frames.orientation_wxyz).max() < MAX_RAD
    assert np.abs(np.array([d["root"] for d in drawn]) - frames.root_m).max() < 1e-9
    for i in range(20):
        blend = Blend(examples, expected_weights[i], in_place=True)
        t_s = float(np.interp(phases[i], np.arange(5.0), blend.key_s))
        assert drawn[i]["place"] == pytest.approx(blend.at(t_s).root_m, abs=1e-9)
        phase = float(blend.phase_of(times[i])) % 4.0
        assert drawn[i]["phase"] == pytest.approx(phase, abs=1e-9)


def test_a_page_moves_people_of_a_film_as_python_does(browser: Any) -> None:
    film = Film(Scene("person", motion="wave"), 2.0, rate_hz=30)
    store = FilmStore({}, Path())
    (file,) = live_film_files(film, store).poses
    pictures = list(store.pictures(film))
    page = browser.new_page()
    page.route("http://film.test/**", serve_site)
    page.goto("http://film.test/")
    drawn = np.array(page.evaluate(PLACES, [base64_of(file), len(pictures), film.rate_hz]))
    skeleton = pictures[0].cast[0].skeleton
    roots = np.array([p.people.root_m[0] for p in pictures])
    turns = np.array([p.people.orientation_wxyz[0] for p in pictures])
    apart_m = np.linalg.norm(drawn - forward(skeleton, roots, turns).position_m, axis=-1)
    assert np.ptp(drawn, axis=0).max() > 0.1  # somebody waves
    assert 0 == pytest.approx(apart_m.max(), abs=1e-4)


SMOOTH = """async (name) => {
    const UNMASKED_RENDERER = 0x9246;
    const real = WebGL2RenderingContext.prototype.getParameter;
    WebGL2RenderingContext.prototype.getParameter = function (which) {
        return which === UNMASKED_RENDERER ? name : real.call(this, which);
    };
    const { Stage } = await import("/live.js");
    const light = { background_srgb: [0, 0, 0], sky: [1, 1, 1], ground: [1, 1, 1], lamps: [] };
    return new Stage(document.createElement("canvas"), light).gl.getContextAttributes().antialias;
}"""


@pytest.mark.parametrize(
    ("is_smooth", "renderer"), [(True, "GeForce RTX 4060"), (False, "SwiftShader Device")]
)
def test_edges_are_smoothed_by_a_graphics_chip_alone(
    is_smooth: bool, renderer: str, browser: Any
) -> None:
    page = browser.new_page()
    page.route("http://smooth.test/**", serve_site)
    page.goto("http://smooth.test/")
    assert is_smooth == page.evaluate(SMOOTH, renderer)


def leave(page: Any) -> None:
    """Press the button until its figure is gone: a slow picture may move it away from a press."""
    figure = page.query_selector("canvas.figure")
    for _ in range(6):
        page.click("#main button:not(.quiet)")
        with contextlib.suppress(playwright_error()):
            page.wait_for_function("figure => !figure.isConnected", arg=figure, timeout=10_000)
            return
    raise AssertionError(state_of(page))


def test_a_real_slider_moulds_and_a_real_mouse_turns(server: Server, browser: Any) -> None:
    address = server.start("run", str(STUDY), "--participant", "1", "--on", "browser")
    page = browser.new_context(viewport={"width": 500, "height": 700}).new_page()
    page.add_init_script(path=SELDOM)
    problems: list[str] = []
    others: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
    own = (address.split("#")[0], "blob:", "data:")
    page.on("request", lambda r: None if r.url.startswith(own) else others.append(r.url))
    page.goto(address)
    for trial in range(3):
        if trial == 0:
            until(page, "First one to try")
        elif trial == 1:
            until(page, "walks that count", steps=False)
        if trial < 2:
            page.click("#main button:not(.quiet)")
        slider = page.wait_for_selector("#slider0:enabled", timeout=PATIENCE_S * 1000)
        box = page.query_selector("canvas.figure").bounding_box()
        if trial:
            slider.focus()
            for _ in range(3):
                page.keyboard.press("ArrowRight")
            page.mouse.move(box["x"] + 100, box["y"] + 100)
            page.mouse.down()
            page.mouse.move(box["x"] + 180, box["y"] + 100, steps=4)
            page.mouse.up()
            frames = page.get_attribute("canvas.figure", "data-frames") or "0"
            drawn = f"canvas.figure[data-frames]:not([data-frames='{frames}'])"
            page.wait_for_selector(drawn, timeout=PATIENCE_S * 1000)
        leave(page)
    until(page, "Thank you", steps=False)
    output = server.end()
    folder = session_dir(server.root / "data", "moulding", "S01B", 1, is_simulated=True)
    recording = Recording(folder)
    assert recording.status == "complete", output
    rows = recording.trials()
    practice, counted = rows.iloc[0], rows.iloc[1:]
    assert (practice["mould_moves"], practice["activeness"]) == (0, 0.5)
    assert (practice["activeness_by"], practice["mould_ended_by"]) == ("mouse", "button")
    assert list(counted["mould_moves"]) == [3, 3]
    assert counted["activeness"].tolist() == pytest.approx([0.53, 0.53])
    assert list(counted["activeness_by"]) == ["keys", "keys"]
    assert (counted["mould_turns"] >= 1).all()
    assert (counted["mould_slider_frames"] == 1).all()  # the pose comes with the next frame
    assert (counted["mould_frames"] > 0).all()
    assert counted["mould_renderer"].str.len().min() > 0
    moves = moves_of(recording)
    sliders = moves[moves["what"] == "activeness"]
    expected = [0.51, 0.52, 0.53] * 2
    assert sliders["value"].tolist() == pytest.approx(expected)
    assert sliders["t_ns"].is_monotonic_increasing
    camera = moves[(moves["what"] == "camera") & (moves["trial_id"] == rows["trial_id"].iloc[1])]
    assert np.ptp(camera["x_m"]) > 0.3
    assert (np.hypot(camera["x_m"], camera["z_m"]) > 3.0).all()  # it circles
    assert [] == problems
    assert [] == others


HELD = """let isHeld = true;
const [waiting, real] = [[], window.requestAnimationFrame.bind(window)];
window.requestAnimationFrame = (draw) => (isHeld ? waiting.push(draw) : real(draw));
window.addEventListener("show-pictures", () => { isHeld = false; waiting.forEach(real); });"""


def test_sliders_open_with_the_first_picture_of_the_figure(server: Server, browser: Any) -> None:
    address = server.start("run", str(STUDY), "--participant", "1", "--on", "browser")
    page = browser.new_context().new_page()
    page.add_init_script(HELD)
    page.goto(address)
    until(page, "First one to try")
    page.click("#main button:not(.quiet)")
    page.wait_for_selector("canvas.figure[data-ready]", timeout=PATIENCE_S * 1000)
    assert page.query_selector("canvas.figure[data-frames]") is None
    assert page.is_disabled("#slider0")
    assert page.is_disabled("#main button:not(.quiet)")
    page.dispatch_event("canvas.figure", "show-pictures", {"bubbles": True})
    page.wait_for_selector("#slider0:enabled", timeout=PATIENCE_S * 1000)
    assert page.query_selector("canvas.figure[data-frames]") is not None


REFUSED = """const real = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind === "webgl2" ? null : real.call(this, kind, ...rest);
};"""


def test_a_page_that_cannot_draw_says_so_before_consent(server: Server, browser: Any) -> None:
    address = server.start("run", str(STUDY), "--participant", "1", "--on", "browser")
    page = browser.new_context().new_page()
    page.add_init_script(REFUSED)
    page.goto(address)
    until(page, "cannot draw what this study shows", steps=False)
    assert page.query_selector("#agree") is None


def test_a_figure_whose_pictures_are_refused_is_a_failure_and_not_drawn_without_eyes(
    server: Server, browser: Any
) -> None:
    address = server.start("run", str(STUDY), "--participant", "1", "--on", "browser")
    page = browser.new_context().new_page()
    page.add_init_script("window.createImageBitmap = async () => { throw new Error('refused'); };")
    page.goto(address)
    until(page, "pictures of the figure could not be read")
    page.click("#main button.quiet")  # skipped
    until(page, "walks that count", steps=False)
    server.kill()
    folder = session_dir(server.root / "data", "moulding", "S01B", 1, is_simulated=True)
    row = json.loads(Recording(folder).trials().iloc[:1].to_json(orient="records"))[0]
    assert row["status"] == "skipped"
    assert "could not be read" in row["reason"]


def test_a_page_to_play_with_shows_what_sliders_make(tmp_path: Path, browser: Any) -> None:
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    environment = os.environ | {"BROWSER": "true", "PYTHONPATH": str(REPOSITORY), "COLUMNS": "200"}
    arguments = ["blend", "--page", "--examples", "set_a", "--weights", "march=1"]
    process = COMMANDS.start(
        *["-m", "visavis.cli.main", *arguments],
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.PIPE,
    )
    try:
        assert process.stdout is not None
        lines = iter(process.stdout.readline, "")  # the first may say that code is compiled
        found = next(filter(None, (re.search(r"http://\S+", line) for line in lines)))
        page = browser.new_page()
        page.goto(found.group())
        page.wait_for_selector("canvas[data-ready]", timeout=PATIENCE_S * 1000)
        assert page.text_content("#shares") == "march 1.00"
        assert page.locator("input").count() == 10
        index = list(style_names("set_a")).index("slouch")
        page.locator("input").nth(index).focus()
        page.keyboard.press("End")
        page.wait_for_selector("#shares:has-text('slouch')")
        assert "slouch=1" in page.text_content("#command")
        page.wait_for_selector(f"canvas{DRAWN}")
        assert [] == faults_for_people(page)
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0
        if process.stdout is not None:
            process.stdout.close()


def test_a_page_blends_gestures_as_python_does(browser: Any) -> None:
    examples = gesture_examples("waves", load_character("anna").skeleton)
    rng = np.random.default_rng(8)
    values, phases = rng.uniform(0.0, 1.0, (100, 5)), rng.uniform(0.0, 2.0, 100)
    files = [base64_of((SITE / "blend.js").read_bytes()), base64_of(packed_examples(examples))]
    page = browser.new_page()
    drawn = page.evaluate(POSES, [*files, values.tolist(), phases.tolist(), phases.tolist()])
    shares = values / values.sum(axis=1, keepdims=True)
    frames = blend_at(examples, shares, phases)
    turns = np.array([d["turns"] for d in drawn]).reshape(frames.orientation_wxyz.shape)
    assert angle_rad(turns, frames.orientation_wxyz).max() < MAX_RAD


def test_a_guess_is_made_blind_and_a_match_ends_its_step_by_itself(
    server: Server, browser: Any
) -> None:
    address = server.start("run", "matching", "--participant", "1", "--on", "browser")
    page = browser.new_context(viewport={"width": 900, "height": 700}).new_page()
    page.add_init_script(path=SELDOM)
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(address)
    until(page, "Guess: set the sliders")
    page.wait_for_selector("canvas[data-ready]", timeout=PATIENCE_S * 1000)
    assert page.locator(".sliders input").count() == 27
    page.wait_for_selector(f"canvas{DRAWN}")
    page.locator(".buttons button").click()
    until(page, "Move the sliders until", steps=False)
    page.wait_for_selector("canvas[data-ready]", timeout=PATIENCE_S * 1000)
    assert page.locator(".buttons button").is_disabled()
    weights = target_shares("practice_weights")
    page.evaluate(
        """(values) => document.querySelectorAll(".sliders input").forEach((slider, i) => {
            slider.value = values[i];
            slider.dispatchEvent(new Event("input"));
        })""",
        weights.tolist(),
    )
    until(page, "Guess: set the sliders", steps=False)  # it went on by itself
    rows = Recording(session_dir(server.root / "data", "matching", "S01B", 1, is_simulated=True))
    trials = rows.trials()
    assert list(trials["mould_ended_by"]) == ["button", "near"]
    assert trials["guess_m"].iloc[0] > MATCH_M > trials["distance_m"].iloc[1]
    assert not problems


def test_raters_turn_two_figures_and_answer_the_list_beside_them(
    server: Server, browser: Any
) -> None:
    address = server.start("run", "adjectives", "--participant", "1", "--on", "browser")
    page = browser.new_context(viewport={"width": 420, "height": 560}).new_page()
    page.add_init_script(path=SELDOM)
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
    page.goto(address)
    until(page, "In green")
    page.wait_for_selector("canvas.figure[data-ready][data-frames]", timeout=PATIENCE_S * 1000)
    assert page.locator("fieldset").count() == 41
    assert page.locator("#main button:not(.quiet)").is_disabled()
    box = page.query_selector("canvas.figure").bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 80)
    page.mouse.down()
    page.mouse.move(box["x"] + 180, box["y"] + 80, steps=4)
    page.mouse.up()
    page.focus("canvas.figure")
    page.keyboard.press("+")  # nearer
    # Both have gone through two cycles.
    page.wait_for_selector("fieldset input:not([disabled])", timeout=PATIENCE_S * 1000)
    page.locator("fieldset").nth(0).locator("label").nth(4).click()
    page.evaluate("""document.querySelectorAll("fieldset").forEach((list, i) => {
        if (i > 0) list.querySelectorAll("input")[i % 5].click();
    })""")
    page.locator("#main button:not(.quiet)").click()
    # The next walk's list has no answers yet.
    page.wait_for_selector("input:checked", state="detached", timeout=PATIENCE_S * 1000)
    server.kill()
    folder = session_dir(server.root / "data", "adjectives", "S01B", 1, is_simulated=True)
    recording = Recording(folder)
    row = recording.trials().iloc[0]
    assert [row[pair] for pair in PAIRS] == [2, *(i % 5 - 2 for i in range(1, 41))]
    assert row["live_rounds"] >= 2
    assert row["live_frames"] > 0
    assert len(row["live_renderer"]) > 0
    moves = moves_of(recording)
    moves = moves[moves["trial_id"] == row["trial_id"]]
    camera = moves[moves["what"] == "camera"]
    assert row["live_turns"] == len(camera) - 1 >= 2
    assert np.ptp(camera["x_m"]) > 0.3
    away_m = np.linalg.norm(camera[["x_m", "y_m", "z_m"]] - [0.0, 0.92, 0.0], axis=1)
    assert away_m[0] == pytest.approx(np.linalg.norm(np.array([1.5, 1.3, -3.6]) - [0, 0.92, 0]))
    assert away_m[-1] == pytest.approx(away_m[0] / 1.08, abs=1e-3)
    for name in ("round", "round_beside"):
        began_ns = moves.loc[moves["what"] == name, "t_ns"]
        assert len(began_ns) >= row["live_rounds"]
        assert began_ns.between(row["live_on_ns"], row["live_off_ns"]).all()
    assert not problems


def test_figures_are_drawn_from_files_alone_and_the_results_are_taken(
    tmp_path: Path, browser: Any
) -> None:
    host = Host(tmp_path, WATCHED)
    page = browser.new_context(
        accept_downloads=True, viewport={"width": 360, "height": 560}
    ).new_page()
    page.add_init_script(path=SELDOM)
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    with served_files(host.export(places=1)) as address:
        page.goto(address)
        page.locator("#main button").click(timeout=PATIENCE_S * 1000)  # what the block is about
        for trial in range(2):
            page.wait_for_selector("fieldset input:not([disabled])", timeout=PATIENCE_S * 1000)
            for i in range(2):
                page.locator("fieldset").nth(i).locator("input").nth(trial + i).click()
            page.locator("#main button:not(.quiet)").click()
            page.wait_for_selector("input:checked", state="detached", timeout=PATIENCE_S * 1000)
        page.wait_for_selector("#main a[download]", timeout=PATIENCE_S * 1000)
        results = save(page, host)
    _, recording = recording_of(host, results)
    rows = recording.trials()
    assert list(rows["status"]) == ["complete"] * 2
    assert [list(rows[name]) for name in ("lively", "heavy")] == [[1, 2], [2, 3]]
    assert (rows["live_rounds"] >= 2).all()
    assert {"camera", "round", "round_beside"} == set(moves_of(recording)["what"])
    assert not problems
