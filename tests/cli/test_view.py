"""The page that shows a session again: what is in it, and a real browser that opens it."""

import base64
import hashlib
import io
import stat
import zlib
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import av
import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tests.cli.viewer_tab import CHROMIUM, header_of, viewer_tab
from tests.running.page.test_browser import faults_for_people
from tests.sessions import opened, perform
from visavis.analysis.gaze.aoi import LOST
from visavis.analysis.gaze.looks import measure_trial
from visavis.cli.app import app
from visavis.cli.film.stand_in import resting_joints
from visavis.cli.viewer import content
from visavis.cli.viewer.bundle import MISSING, Bundle
from visavis.cli.viewer.content import Times, _fact, _labels
from visavis.cli.viewer.fixations import fixations_of
from visavis.cli.viewer.models import LEVEL_OF_MANY, Models
from visavis.cli.viewer.motion import key_samples
from visavis.devices.streams import body_schema
from visavis.protocol.people.exports_register import registered_exports
from visavis.recording.annotations import annotations_of
from visavis.recording.cached import CachedRecording
from visavis.recording.folder import study_dir
from visavis.recording.reader import Recording, component_names
from visavis.results.outputs import write_tables
from visavis.running.sessions.study_folder import settle, wanted_settings
from visavis.stage.card.vertices import person_vertices
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.motion.rotations import one_way_round

ROOM_KEPT = """() => {
    const gl = viewer.drawing.gl, d = viewer.drawing;
    const picture = () => { viewer.seek(viewer.header.scenes[0].t0 + 0.2); viewer.draw();
        const w = gl.drawingBufferWidth, h = gl.drawingBufferHeight, p = new Uint8Array(4 * w * h);
        gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, p);
        return p.join(); };
    viewer.share = () => 1;
    viewer.startView(); viewer.setCamera('free');
    d.keptKey = null;
    const drawn = picture();
    if (d.isKept) throw new Error('kept at first sight');
    picture();
    const kept = picture();
    if (!d.isKept) throw new Error('not kept');
    viewer.free.yaw += 0.3;
    const other = picture();
    if (d.isKept) throw new Error('another view was not drawn');
    return [drawn, kept, other];
}"""
"""Three pictures of one moment: drawn, with the room of the picture before, from another place."""


ENDS_ON_HEADS = """() => {
    let of = 0, on = 0;
    for (const scene of viewer.header.scenes) for (const fall of viewer.fell(scene.t0, scene.t1)) {
        const agent = fall && fall.hit >= 0 ? scene.agents[fall.hit] : null;
        if (!agent) continue;
        of += 1;
        on += Math.hypot(...fall.at.map((v, k) => v - agent.at[k])) < 1.3 * agent.radius ? 1 : 0;
    }
    return [on, of];
}"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("view")
    study = opened("duel")
    settings_at = study_dir(folder, study.name, is_simulated=True)
    wanted = wanted_settings(settings_at, study, is_simulated=True)
    settle(settings_at, wanted, seed_given=False)
    recording = perform("duel", folder, repetitions=1, practice=0)
    path = folder / "duel.html"
    done = CliRunner().invoke(app, ["view", str(recording.path), "-o", str(path)])
    assert done.exit_code == 0, done.output
    return path


def test_a_page_holds_every_trial_stream_and_person(page: Path) -> None:
    header = header_of(page)
    assert ["T01", "T02", "T03", "T04"] == [t["id"] for t in header["trials"]]
    assert all(t["shown"] for t in header["trials"])
    assert {"gaze", "head", "gaze_targets"} <= {s["name"] for s in header["streams"]}
    assert 2 + 1 == len(header["people"])  # the participant, too
    assert all(scene["participant"] == len(scene["cast"]) - 1 for scene in header["scenes"])
    assert header["simulated"]


def test_a_page_draws_a_participant_whose_body_was_not_measured_in_the_declared_posture(
    page: Path,
) -> None:
    rest = header_of(page)["rest"]["joints"]
    assert 0.3 < rest["hips"][1] < 0.75  # they sit, with their eyes at 1.2 m
    assert abs(rest["hips"][1] - rest["left_lower_leg"][1]) < 0.25
    standing = resting_joints(1.2, "standing")
    assert 0.25 < standing["hips"][1] - standing["left_lower_leg"][1]
    assert abs(rest["head"][0]) < 0.01


def test_a_page_is_for_its_owner_and_in_the_register_that_withdrawals_read(page: Path) -> None:
    (export,) = registered_exports(study_dir(page.parent, "duel", is_simulated=True))
    assert ("page", page.parent, [page.name]) == (export.what, export.where, [*export.files])
    assert export.labels
    assert 0o600 == stat.S_IMODE(page.stat().st_mode)


def test_a_page_asks_nothing_of_a_network(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert "http://" not in text
    assert "https://" not in text
    assert "src=" not in text


def test_the_data_of_a_page_without_flat_stimuli_are_to_the_byte_those_where_none_are_looked_for(
    page: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(content, "onsets_ns", lambda trial: [])
    monkeypatch.setattr(content, "showing_of", lambda view, record: None)
    recording = CachedRecording(next(page.parent.glob("simulated/duel/sub-*/ses-001")))
    header, bundle = content.page_content(
        opened("duel"), recording, list(content.trial_lengths_ns(recording))
    )
    assert f'id="data">{bundle.text(header)}<' in page.read_text(encoding="utf-8")
    assert [] == [scene for scene in header["scenes"] if "flat" in scene]


def test_a_page_that_is_there_is_not_replaced(page: Path) -> None:
    sessions = page.parent.glob("simulated/duel/sub-*/ses-001")
    done = CliRunner().invoke(app, ["view", str(next(sessions)), "-o", str(page)])
    assert "exists already" in str(done.exception)


def test_numbers_come_back_within_a_part_of_their_range_and_missing_ones_stay_missing() -> None:
    values = np.array([[1.0, -5.0], [np.nan, 7.0], [3.0, np.inf], [2.0, 7.0]])
    bundle = Bundle()
    header = bundle.add_quantised(values)
    raw = zlib.decompress(base64.b64decode(bundle.text({})))
    body = np.frombuffer(raw, "<u2", 8, 16 + header["o"]).reshape(2, 4)
    codes = np.cumsum(body, axis=1, dtype=np.uint16)
    back = np.where(codes == MISSING, np.nan, codes * np.c_[header["step"]] + np.c_[header["low"]])
    wanted = np.where(np.isfinite(values), values, np.nan).T
    assert np.array_equal(np.isnan(wanted), np.isnan(back))
    assert np.nanmax(np.abs(wanted - back)) < 12 / 65_000


def test_between_keys_no_pose_is_off_by_more_than_was_asked() -> None:
    rng = np.random.default_rng(4)
    walk = np.cumsum(rng.normal(0, 0.004, (3, 200, 4)), axis=1) + np.array([1.0, 0, 0, 0])
    turns = walk / np.linalg.norm(walk, axis=2, keepdims=True)
    counts, samples = key_samples(turns, 0.01, turns=True)
    assert counts.sum() == len(samples) < 400
    start = 0
    for track, n in zip(turns, counts, strict=True):
        at = samples[start : start + n]
        start += n
        between = np.stack([np.interp(np.arange(200), at, track[at, c]) for c in range(4)], 1)
        between /= np.linalg.norm(between, axis=1, keepdims=True)
        assert np.abs(between - track).max() <= 0.01


@pytest.mark.parametrize("turns", [False, True])
def test_still_stretches_of_a_motion_have_the_keys_that_every_sample_would_give(
    turns: bool,
) -> None:
    rng = np.random.default_rng(9)
    tracks = np.repeat(rng.normal(0, 1, (4, 30, 4)), rng.integers(1, 40, 30), axis=1)
    tracks += np.where(rng.random(tracks.shape[:2])[..., None] < 0.02, 0.03, 0.0)
    tracks /= np.linalg.norm(tracks, axis=2, keepdims=True)
    counts, samples = key_samples(tracks, 0.01, turns=turns)
    assert samples.tolist() == [k for track in tracks for k in _keys_one_by_one(track, turns)]
    assert len(samples) == counts.sum() < tracks.shape[0] * tracks.shape[1] / 3


def _keys_one_by_one(track: Any, turns: bool, longest: int = 60) -> list[int]:
    """Return keys as the rule says: as far on as every sample between is within 0.01."""
    keys, n = [0], len(track)
    while keys[-1] < n - 1:
        first = keys[-1]
        last = first + 1
        while last + 1 < n and last + 1 - first <= longest:
            share = (np.arange(first + 1, last + 1) - first)[:, None] / (last + 1 - first)
            there = track[first] + share * (track[last + 1] - track[first])
            if turns:
                there /= np.linalg.norm(there, axis=1, keepdims=True)
            if np.abs(there - track[first + 1 : last + 1]).max() > 0.01:
                break
            last += 1
        keys.append(last)
    return keys


def test_quaternions_do_not_jump_to_their_other_sign() -> None:
    turns = np.array([[1.0, 0, 0, 0], [-0.99, -0.1, 0, 0], [0.98, 0.2, 0, 0]])
    assert ((one_way_round(turns)[1:] * one_way_round(turns)[:-1]).sum(axis=1) > 0).all()


def test_a_browser_opens_the_page_shows_people_plays_and_obeys_the_keyboard(
    playwright: Any, page: Path
) -> None:
    if CHROMIUM is None:
        pytest.skip("there is no chromium; apt install chromium")
    flags = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=flags)
    tab = browser.new_page(viewport={"width": 900, "height": 640})
    problems: list[str] = []
    tab.on("pageerror", lambda error: problems.append(str(error)))
    addresses: list[str] = []
    tab.on("request", lambda request: addresses.append(request.url))
    tab.goto(page.as_uri())
    tab.wait_for_selector("body[data-ready]", timeout=60_000)
    assert [] == problems
    assert [page.as_uri()] == [url for url in addresses if not url.startswith(("blob:", "data:"))]
    assert "SIMULATED" == tab.inner_text("#badge")
    colours = """() => { viewer.draw(); const gl = viewer.drawing.gl, p = new Uint8Array(4),
        tones = new Set(); for (let x = 0; x < 40; x++) for (let y = 0; y < 40; y++) {
        gl.readPixels(gl.drawingBufferWidth * x / 40, gl.drawingBufferHeight * y / 40, 1, 1,
        gl.RGBA, gl.UNSIGNED_BYTE, p); tones.add(p.join()); } return tones.size; }"""
    assert tab.evaluate(colours) > 200
    before = tab.evaluate("viewer.t")
    tab.keyboard.press("ArrowRight")
    assert pytest.approx(before + 0.05) == tab.evaluate("viewer.t")
    tab.keyboard.press("2")
    assert "eyes" == tab.evaluate("viewer.camera")
    tab.keyboard.press("5")
    assert "topology" == tab.evaluate("viewer.camera")
    assert tab.evaluate(colours) > 200
    tab.keyboard.press(" ")
    tab.wait_for_function(f"viewer.t > {before} + 0.2", timeout=60_000)
    tab.keyboard.press(" ")
    tab.keyboard.press(".")
    assert "T02" == tab.evaluate("viewer.trialAt(viewer.t).id")
    tab.select_option("#column", index=1)
    assert 3 == tab.evaluate("viewer.line.plots.length")
    on_heads, of = tab.evaluate(ENDS_ON_HEADS)
    assert 50 < of
    assert 0.95 * of <= on_heads  # an area of interest reaches a little beyond its head
    # Where the processor draws, people are light while time moves and in full at rest.
    assert tab.evaluate("viewer.drawing.slow")
    seek = "(viewer.seek(viewer.header.scenes[0].t0 + 0.2), viewer.draw(), viewer.quick)"
    assert tab.evaluate(seek)
    assert tab.evaluate(f"() => {{ {seek}; return ({colours})(); }}") > 200
    tab.wait_for_function("!viewer.quick", timeout=60_000)
    drawn, kept, other = tab.evaluate(ROOM_KEPT)
    assert drawn == kept
    assert drawn != other
    browser.close()
    assert [] == problems


def test_a_light_mesh_has_the_eyes_last_and_fewer_triangles_where_there_are_many_people(
    page: Path,
) -> None:
    person = header_of(page)["people"][0]
    few, cast = person["light"], load_character(person["name"])
    built = person_vertices(cast, cast.levels[-1])
    assert 0 < few["eyeFrom"] < few["index"]["s"][0] <= len(built.indices)
    built = person_vertices(cast := default_casting("female_03"), cast.levels[-1])
    many = Models(Bundle(), level=LEVEL_OF_MANY)
    many.person(cast)
    light = many.people[0]["light"]
    assert light["index"]["s"][0] < 0.5 * len(built.indices)
    assert light["place"]["s"][0] < 0.5 * len(built.vertices)


def test_trials_that_do_not_fit_into_a_page_are_loaded_from_beside_it(
    page: Path, tmp_path: Path, browser: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(content, "PACKED_BYTES", 1)  # the first trial fits
    folder = study_dir(page.parent, "duel", is_simulated=True)
    session = next(folder.glob("sub-*/ses-001"))
    path = tmp_path / "a duel.html"
    done = CliRunner().invoke(app, ["view", str(session), "-o", str(path)])
    assert done.exit_code == 0, done.output or done.exception
    files = sorted((tmp_path / "a duel_trials").iterdir())
    assert ["000_T02.js", "001_T03.js", "002_T04.js"] == [file.name for file in files]
    assert {0o600} == {stat.S_IMODE(file.stat().st_mode) for file in files}
    registered = registered_exports(folder)[-1]
    assert 4 == len(registered.files)
    window = browser.new_page()
    window.goto(path.as_uri())
    window.wait_for_selector("body[data-ready]", timeout=60_000)
    fell = """id => { const t = viewer.header.trials.find(t => t.id === id);
        return viewer.session.fell(t.t0, t.t1).map(f => f && [f.hit, f.on]); }"""
    assert {""} == {one[1] for one in window.evaluate(fell, "T03") if one}
    window.evaluate("viewer.seek(viewer.header.trials[2].t0 + 0.5)")
    window.wait_for_function("viewer.sceneAt(viewer.t) !== null", timeout=60_000)
    assert 1 < len({one[1] for one in window.evaluate(fell, "T03") if one})
    assert window.evaluate("viewer.header.scenes.some(s => s.isBeside && s.trial === 'T04')")
    save = """async () => { viewer.seek(viewer.header.trials[1].t0 + 0.5);
        const at = viewer.saving.at.bind(viewer.saving); let scene = null;
        viewer.saving.at = (...how) => { scene = viewer.sceneAt(viewer.t); return at(...how); };
        await viewer.saving.png(1); viewer.saving.at = at; return scene !== null; }"""
    assert window.evaluate(save)  # what is saved is loaded first
    files[2].unlink()
    window.evaluate("viewer.seek(viewer.header.trials[3].t0 + 0.5)")
    window.wait_for_function("document.querySelector('#nothing').textContent.includes('beside')")


@pytest.fixture(scope="module")
def tab(page: Path, playwright: Any) -> Iterator[Any]:
    """The page in a real browser, at a moment of its first trial."""
    with viewer_tab(playwright, page, 1000, 700) as (window, problems):
        window.evaluate("viewer.seek(viewer.header.trials.at(-1).t0 + 0.5)")
        window.wait_for_function("viewer.panelTrial?.startsWith('T04')", timeout=60_000)
        yield window
    assert [] == problems


def test_everybody_is_labelled_and_no_label_lies_over_another(tab: Any) -> None:
    overlapping = """() => { viewer.setCamera('eyes'); viewer.draw(); const b = viewer.boxes;
        return [viewer.namedPeople, b.filter((p, i) => b.some((q, j) => i !== j && p[0] < q[2]
        && q[0] < p[2] && p[1] < q[3] && q[1] < p[3])).length]; }"""
    assert [2, 0] == tab.evaluate(overlapping)


def test_labels_of_a_crowded_place_make_way_for_each_other(tab: Any) -> None:
    """Eleven people whose heads are 5 pixels apart: three of them had labels before."""
    crowded = """() => { const l = new Labels(viewer.over, 1, 900, 500); let n = 0;
        for (let k = 0; k < 11; k++) n += l.put('left middle ' + k, 400 + 5 * k, 250, '#fff');
        return [n, l.boxes.filter((p, i) => l.boxes.some((q, j) => i !== j && p[0] < q[2]
        && q[0] < p[2] && p[1] < q[3] && q[1] < p[3])).length]; }"""
    assert [11, 0] == tab.evaluate(crowded)


def test_names_of_events_do_not_lie_over_each_other(tab: Any) -> None:
    named = """() => { viewer.line.show(0, viewer.line.end); viewer.line.draw();
        return viewer.line.named; }"""
    spans = tab.evaluate(named)
    assert all(one[1] < two[0] for one, two in pairwise(spans))


def test_no_name_of_code_is_read_on_the_page(tab: Any) -> None:
    texts = tab.evaluate("""() => [...document.querySelectorAll(
        '#column option, #column optgroup, #trial td, #said, #layers label')].map(
        e => e.label || e.textContent)""")
    assert 50 < len(texts)
    assert [] == [text for text in texts if "_" in text]
    assert tab.evaluate("document.querySelector('#trial').textContent").count("NaN") == 0


def test_every_canvas_has_a_name(tab: Any) -> None:
    names = "() => [...document.querySelectorAll('canvas')].map(c => c.getAttribute('aria-label'))"
    assert all(tab.evaluate(names))
    assert "T04" in tab.evaluate("document.querySelector('#overlay').getAttribute('aria-label')")


MARKS = """() => { const scene = viewer.sceneAt(viewer.t), [x, y, z] = scene.data.agents[0].at,
    shown = {...viewer.show}, of = [[x, y, z + 0.5], [x, y, z - 0.5]], brightest = [];
    Object.keys(shown).forEach(k => { viewer.show[k] = k === 'heat'; });
    for (const from of [-2, 2]) { // behind them, then before them
        viewer.free = {at: [x, y, z + from], yaw: from < 0 ? Math.PI : 0, pitch: 0};
        viewer.setCamera('free');
        for (const at of of) {
            viewer.heatOf = scene.data.t0; viewer.heat = [{at, n: 1}]; viewer.most = 1;
            viewer.draw();
            const c = $('overlay'), p = viewer.over.getImageData(0, 0, c.width, c.height).data;
            brightest.push(p.reduce((most, v, k) => k % 4 === 3 ? Math.max(most, v) : most, 0));
        }
    }
    viewer.heatOf = null; Object.assign(viewer.show, shown); viewer.setCamera('eyes');
    viewer.draw(); return brightest; }"""
"""How opaque a spot of the map of gaze is, half a metre before and behind somebody, for a camera
behind them and one before them."""


def test_a_mark_behind_somebody_is_faint_from_where_one_looks(tab: Any) -> None:
    behind, before, seen_before, seen_behind = tab.evaluate(MARKS)
    assert before == seen_before
    assert behind == seen_behind
    assert behind < 0.3 * before


@pytest.mark.slow  # axe-core
def test_no_page_of_a_session_shuts_people_out(tab: Any) -> None:
    size = tab.viewport_size
    assert [] == faults_for_people(tab)
    tab.set_viewport_size(size)


def test_time_goes_on_as_fast_as_it_says_however_long_a_picture_takes(tab: Any) -> None:
    passed = """() => { viewer.play(false); viewer.seek(1); viewer.playing = true;
        viewer.last = 1000; viewer.tick(1900); viewer.playing = false; const t = viewer.t;
        viewer.last = undefined; viewer.seek(viewer.header.trials.at(-1).t0 + 0.5); return t; }"""
    assert pytest.approx(1.9) == tab.evaluate(passed)


def test_dwell_fixations_and_latency_of_a_clicked_head_are_those_of_the_analysis(
    tab: Any, page: Path
) -> None:
    folder = next(page.parent.glob("simulated/duel/sub-*/ses-001"))
    recording = CachedRecording(folder)
    gaze = recording.stream_arrays("gaze_targets")
    row = recording.trials().iloc[-1]
    area = np.where(gaze["valid"], gaze["hit"], LOST)
    clicked = """k => { viewer.setCamera('eyes'); viewer.draw(); const scene =
        viewer.sceneAt(viewer.t), agent = scene.data.agents[k], s = $('stage'),
        view = viewer.view(scene, s.clientWidth, s.clientHeight),
        p = viewer.project(view, agent.at, s.clientWidth, s.clientHeight);
        viewer.click(p[0], p[1]);
        return [viewer.about, viewer.session.measures(viewer.about, viewer.trialAt(viewer.t)),
        document.getElementById('about').textContent]; }"""
    compared = 0
    for k in range(2):
        about, measured, text = tab.evaluate(clicked, k)
        assert "person" == about["kind"]
        wanted = measure_trial(
            gaze["t_sample_ns"], area, k, int(row["t_start_ns"]), int(row["t_end_ns"])
        )
        assert pytest.approx(wanted.dwell_ms, abs=0.1) == 1000 * measured["dwell"]
        assert wanted.fixation_count == measured["count"]
        first_ms = None if measured["latency"] is None else 1000 * measured["latency"]
        assert pytest.approx(wanted.first_fixation_time_ms, abs=0.1) == first_ms
        assert f"{measured['dwell']:.2f}" in text
        compared += wanted.dwell_ms > 0
    assert compared


def test_keys_show_fixations_dwell_and_order_and_the_walked_path(tab: Any) -> None:
    inked = """() => { viewer.setCamera('eyes'); viewer.draw(); const c =
        document.getElementById('overlay'); return viewer.over.getImageData(0, 0, c.width,
        c.height).data.reduce((n, v, k) => n + (k % 4 === 3 && v > 0), 0); }"""
    assert tab.evaluate("viewer.session.fixations(viewer.trialAt(viewer.t)).length") > 1
    for key, layer in zip("fdnw", ("fixations", "dwell", "order", "walked"), strict=True):
        before, was_on = tab.evaluate(inked), tab.evaluate(f"viewer.show.{layer}")
        tab.keyboard.press(key)
        assert tab.evaluate(f"viewer.show.{layer}") is not was_on
        if layer in ("fixations", "dwell"):
            assert tab.evaluate(inked) > before
        tab.keyboard.press(key)


def test_moves_of_gaze_are_those_from_one_fixation_to_the_next(tab: Any) -> None:
    way, shown = tab.evaluate("""() => { viewer.pick(-1); viewer.draw();
        const s = viewer.session, t = viewer.trialAt(viewer.t);
        return [s.fixations(t).map(f => s.keyOf(f.hit, f.on, f.t0)?.name).filter(Boolean),
        transitionsOf(viewer.seen, t).moves]; }""")
    tab.wait_for_selector("#transitions svg", state="attached", timeout=60_000)
    wanted = Counter((one, two) for one, two in pairwise(way) if one != two)
    assert wanted == {(m["from"], m["to"]): m["n"] for m in shown}
    assert wanted
    named = tab.evaluate("document.querySelector('#transitions svg').getAttribute('aria-label')")
    assert all(f"{one} to {two}" in named for one, two in wanted)


def test_spans_coded_on_the_page_are_placed_beside_the_session_and_read_by_analyse(
    tab: Any, page: Path, tmp_path: Path
) -> None:
    folder = study_dir(page.parent, "duel", is_simulated=True)
    person = next(folder.glob("sub-*"))
    recording = CachedRecording(person / "ses-001")
    start_ns = int(recording.trials().iloc[-1]["t_start_ns"])
    recorded_files = {p.name: p.stat().st_mtime_ns for p in (person / "ses-001").rglob("*")}
    for coder, late_s in (("AM", 0.0), ("B. K.", 0.2)):
        tab.evaluate("viewer.coding.spans = []")
        tab.evaluate("document.getElementById('coding-box').open = true")
        tab.fill("#coder", coder)
        tab.fill("#code-labels", "smile, frown")
        tab.evaluate("document.activeElement.blur()")
        tab.evaluate("late => viewer.seek(viewer.header.trials.at(-1).t0 + 0.1 + late)", late_s)
        tab.keyboard.press("a")
        tab.evaluate("viewer.seek(viewer.t + 0.5)")
        tab.keyboard.press("a")
        tab.select_option(".span select", "frown")
        tab.fill(".span input", 'looks "away", then back')
        with tab.expect_download() as download:
            tab.click("#save-codes")
        file = tmp_path / download.value.suggested_filename
        download.value.save_as(file)
        done = CliRunner().invoke(app, ["import", "annotations", str(folder), str(file)])
        assert done.exit_code == 0, done.output or done.exception
    first, second = annotations_of(person)
    assert ("AM", "frown", "T04", 'looks "away", then back') == (
        first.coder,
        first.label,
        first.trial_id,
        first.comment,
    )
    assert abs(first.begin_ns - start_ns - 100_000_000) < 2_000
    assert 500_000_000 == pytest.approx(second.end_ns - second.begin_ns, abs=2_000)
    assert recorded_files == {p.name: p.stat().st_mtime_ns for p in recording.path.rglob("*")}
    study = opened("duel")
    experiment = study.experiment({"repetitions": 1, "practice": 0})
    analysis = study.analysis_of([study.measure(Recording(recording.path))])
    (tmp_path / "out").mkdir()
    write_tables(analysis, experiment, [], tmp_path / "out")
    spans = pd.read_csv(tmp_path / "out" / "annotations.csv")
    assert [100.0, 300.0] == pytest.approx(list(spans["begin_ms"]), abs=0.01)
    agreement = pd.read_csv(tmp_path / "out" / "annotation_agreement.csv")
    assert ["frown", "any"] == list(agreement["label"])
    assert 0 < agreement["kappa"].iloc[0] < 1


def test_the_pointer_over_a_trial_and_a_head_says_what_they_are(tab: Any) -> None:
    assert "complete" in tab.evaluate(
        "(viewer.line.draw(), viewer.line.under(viewer.line.x(viewer.t), 24))"
    )
    tab.evaluate("viewer.tip('left: looked at for 1.20 s', 900, 20)")
    box = tab.locator("#tip").bounding_box()
    assert box["x"] + box["width"] <= 1000


def test_columns_of_a_body_are_called_by_part_and_axis() -> None:
    field = body_schema(("hips", "left_hand"), 60.0).fields[0]
    names = component_names("position_m", 6)
    wanted = [f"{part} {axis} (m)" for part in ("hips", "left hand") for axis in "xyz"]
    assert wanted == _labels(field, names)


def test_instants_of_a_trial_stand_on_the_pages_line_and_other_times_are_milliseconds() -> None:
    row = {"recording_part": 1, "t_start_ns": 5_000_000_000, "t_end_ns": 9_000_000_000}
    times = Times({1: -4.0})
    assert ("start", {"at": 1.0}) == _fact("t_start_ns", 5_000_000_000, row, times)
    assert ("clock offset (ms)", 2.5) == _fact("clock_offset_ns", 2_500_000, row, times)
    assert ("look", None) == _fact("look_ns", None, row, times)
    assert ("place", "left far") == _fact("place", "left_far", row, times)


def test_fixations_lie_where_most_of_their_gaze_ended() -> None:
    """Half a second ahead, a saccade to 20° right, half a second there, then gaze is lost."""
    t_ns = np.arange(150, dtype=np.int64) * 10_000_000
    yaw = np.radians(np.clip((np.arange(150) - 60) * 5.0, 0.0, 20.0))
    direction = np.stack([np.sin(yaw), 0 * yaw, -np.cos(yaw)], axis=1)
    direction[120:] = np.nan
    on = np.where(np.arange(150) < 62, "wall", "desk").astype(object)
    hit = np.where(np.arange(150) < 62, -1, 3)
    first, second = fixations_of(t_ns, direction, 2.0 * direction, hit, on)
    assert ("wall", -1, "desk", 3) == (first["on"], first["hit"], second["on"], second["hit"])
    assert np.allclose([0.0, 0.0, -2.0], first["at"], atol=0.01)
    assert np.allclose(2.0 * direction[100], second["at"], atol=0.01)
    assert abs(first["end_ns"] - 600_000_000) < 40_000_000
    assert abs(second["end_ns"] - 1_200_000_000) < 40_000_000


def test_a_file_for_rerun_holds_people_gaze_and_every_column(tmp_path: Path) -> None:
    chunk = pytest.importorskip("rerun.chunk", reason="rerun-sdk is not installed")
    study = opened("duel")
    settings_at = study_dir(tmp_path, study.name, is_simulated=True)
    settle(settings_at, wanted_settings(settings_at, study, is_simulated=True), seed_given=False)
    recording = perform("duel", tmp_path, repetitions=1, practice=0)
    path = tmp_path / "duel.rrd"
    addresses = ["view", str(recording.path), "--trial", "T01", "--rerun", str(path)]
    done = CliRunner().invoke(app, addresses)
    assert done.exit_code == 0, done.output
    rows: dict[str, int] = {}
    for piece in chunk.RrdReader(path).stream().to_chunks():
        where = str(piece.entity_path)
        rows[where] = rows.get(where, 0) + piece.num_rows
    assert {"/world/people", "/world/gaze", "/world/room/0", "/events"} <= set(rows)
    gaze = len(recording.stream_arrays("gaze")["seq"])
    assert gaze == rows["/streams/gaze/left_pupil_mm"]


ROWS = "viewer.line.rows().filter(r => r.looks).map(r => [r.name, r.looks.length])"


def test_areas_of_interest_have_a_line_each_where_asked_and_a_click_leads_there(tab: Any) -> None:
    names = tab.evaluate("viewer.line.whom().map(([name]) => name)")
    assert [["looks at", len(names)]] == tab.evaluate(ROWS)
    tab.click("#apart")
    assert [[name, 1] for name in names] == tab.evaluate(ROWS)
    tab.evaluate("() => { viewer.line.show(0, viewer.line.end); viewer.line.draw(); }")
    at_s, x, y = tab.evaluate(
        """() => { const line = viewer.line, t = line.whom().at(-1)[1].at(-1)[0],
        k = line.rows().findLastIndex(r => r.looks), box = $('line').getBoundingClientRect();
        return [t, box.x + line.x(t), box.y + 20 + (ROW_PX + 2) * k + ROW_PX / 2]; }"""
    )
    tab.mouse.move(x, y)
    assert f"{names[-1]} for " in tab.inner_text("#tip")
    tab.mouse.click(x, y)
    one_pixel_s = tab.evaluate("viewer.line.end / viewer.line.width")
    assert pytest.approx(at_s, abs=2 * one_pixel_s) == tab.evaluate("viewer.t")
    tab.click("#apart")
    tab.evaluate("viewer.seek(viewer.header.trials.at(-1).t0 + 0.5)")


def test_a_picture_says_from_which_recording_it_is_and_is_as_large_as_asked(
    tab: Any, page: Path
) -> None:
    folder = next(page.parent.glob("simulated/duel/sub-*/ses-001"))
    digest = hashlib.sha256((folder / "manifest.json").read_bytes()).hexdigest()
    seed = Recording(folder).manifest.seed
    caption = tab.evaluate("viewer.saving.caption()")
    assert f"seed {seed} · recording {digest[:12]}" in caption
    assert "T04 at 0.50 s" in caption
    assert "SIMULATED" in caption
    wide, high, size = tab.evaluate(
        """async () => { const frame = () => new Promise(requestAnimationFrame);
        await frame(); await frame();
        const s = $('stage'), size = [s.clientWidth, s.clientHeight];
        const image = await createImageBitmap(await viewer.saving.png(2));
        return [image.width, image.height, size]; }"""
    )
    assert [2 * size[0], 2 * (size[1] + 26)] == [wide, high]
    tab.click("#save-png")  # and the page stands as before
    tab.wait_for_function("viewer.scale === 1")


def test_a_vector_picture_has_what_lies_over_the_scene_as_lines_and_letters(tab: Any) -> None:
    text, named = tab.evaluate(
        """async () => { for (const l of ['heat', 'fixations'])
            if (!viewer.show[l]) viewer.toggle(l);
        viewer.setCamera('eyes'); const text = await viewer.saving.svg(1);
        for (const l of ['heat', 'fixations']) viewer.toggle(l); return [text,
        viewer.namedPeople]; }"""
    )
    root = ElementTree.fromstring(text)  # noqa: S314 - written by our own page
    svg = "{http://www.w3.org/2000/svg}"
    assert 1 == len(root.findall(f"{svg}image"))
    words = [one.text for one in root.findall(f"{svg}text")]
    assert 2 == named <= len(words)
    assert tab.evaluate("viewer.saving.caption()") == words[-1]
    assert root.findall(f"{svg}defs/{svg}radialGradient")
    assert 10 < len(root.findall(f"{svg}path"))
    drawn = [
        value for one in root.iter() if one.tag != f"{svg}image" for value in one.attrib.values()
    ]
    assert [] == [value for value in drawn if "NaN" in value or "undefined" in value]


FILM = """async () => { const reader = new FileReader();
    reader.readAsDataURL(await viewer.saving.film(0.2));
    await new Promise(done => { reader.onload = done; });
    return [reader.result, $('stage').clientWidth, $('stage').clientHeight + 26]; }"""


def pictures_of(film: str) -> list[tuple[int, int, int]]:
    """Return time in ms, width and height of the pictures of a film in a data address."""
    with av.open(io.BytesIO(base64.b64decode(film.partition(",")[2])), "r") as opened_film:
        frames = opened_film.decode(video=0)
        return [(round(1000 * (one.time or 0.0)), one.width, one.height) for one in frames]


def test_a_film_of_what_is_seen_lasts_as_long_as_what_is_seen(tab: Any) -> None:
    before = tab.evaluate("viewer.t")
    film, width, height = tab.evaluate(FILM)
    even = width // 2 * 2, height // 2 * 2
    assert [(40 * k, *even) for k in range(5)] == pictures_of(film)
    assert before == tab.evaluate("viewer.t")
    assert "film" == tab.inner_text("#save-film")


def test_contacts_lie_on_the_walked_path_and_a_click_leads_to_their_moment(tab: Any) -> None:
    found = tab.evaluate(
        """() => { const trial = viewer.header.trials.at(-1), head = t => viewer.streams.headAt(t);
        const path = [0.2, 0.9].map(s => ({t: trial.t0 + s, at: [head(trial.t0 + s).at[0], 0.01,
            head(trial.t0 + s).at[2]]}));
        viewer.session.paths.set(trial, path);
        viewer.header.lanes.push({name: 'left hand', kind: 'contact', role: 'left_hand',
            spans: [[trial.t0 + 0.3, trial.t0 + 0.4, ''], [trial.t1 + 9, trial.t1 + 10, '']]});
        viewer.setCamera('above'); viewer.draw();
        const s = $('stage'), view = viewer.view(viewer.sceneAt(viewer.t), s.clientWidth,
            s.clientHeight), at = head(trial.t0 + 0.3).at, wanted = viewer.project(view,
            [at[0], 0.01, at[2]], s.clientWidth, s.clientHeight), touches = viewer.touches;
        viewer.click(touches[0].x, touches[0].y);
        const found = [touches.length, touches[0].text, [touches[0].x, touches[0].y],
            wanted.slice(0, 2), viewer.t - trial.t0];
        viewer.header.lanes.pop(); viewer.session.paths.delete(trial);
        viewer.seek(trial.t0 + 0.5); return found; }"""
    )
    count, text, at, wanted, seconds = found
    assert (1, "left hand at 0.30 s") == (count, text)
    assert pytest.approx(wanted, abs=0.5) == at
    assert pytest.approx(0.3) == seconds


@pytest.mark.slow  # a browser with a profile of its own
@pytest.mark.parametrize("width_px", [320, 2560])
def test_firefox_shows_the_page_and_does_what_is_clicked(
    page: Path, other_drawing_browser: Any, width_px: int
) -> None:
    window = other_drawing_browser
    window.size(width_px, 900)
    window.goto(page.as_uri())
    window.wait_for("document.body.dataset.ready === 'yes'", 60.0)
    assert window.evaluate("document.documentElement.scrollWidth") <= width_px
    assert "SIMULATED" == window.evaluate("document.getElementById('badge').textContent")
    window.evaluate("viewer.seek(viewer.header.trials[0].t0 + 0.5)")
    colours = """(() => { viewer.draw(); const gl = viewer.drawing.gl, p = new Uint8Array(4),
        tones = new Set(); for (let x = 0; x < 40; x++) for (let y = 0; y < 40; y++) {
        gl.readPixels(gl.drawingBufferWidth * x / 40, gl.drawingBufferHeight * y / 40, 1, 1,
        gl.RGBA, gl.UNSIGNED_BYTE, p); tones.add(p.join()); } return tones.size; })()"""
    assert 200 < window.evaluate(colours)
    before = window.evaluate("viewer.t")
    window.click("#play")
    window.wait_for(f"viewer.t > {before} + 0.2", 60.0)
    window.click("#play")
    window.wait_for("!viewer.playing", 30.0)
    window.evaluate("viewer.seek(viewer.header.trials[0].t0 + 0.5)")
    window.click("#next")
    window.wait_for("viewer.trialAt(viewer.t).id === 'T02'", 30.0)
    window.press("2")
    window.wait_for("viewer.camera === 'eyes'", 30.0)
    window.click("#layer-heat")
    window.wait_for("viewer.show.heat", 30.0)
    window.click("#apart")
    # The time line is drawn anew: the place above it is as high as it stays.
    window.wait_for("viewer.line.apart && !viewer.line.dirty", 30.0)
    at_head = """(() => { viewer.draw(); const agent = viewer.sceneAt(viewer.t).data.agents[0],
        s = $('stage'), view = viewer.view(viewer.sceneAt(viewer.t), s.clientWidth,
        s.clientHeight), p = viewer.project(view, agent.at, s.clientWidth, s.clientHeight);
        const mark = document.createElement('i'); mark.id = 'head'; mark.style =
        `position: absolute; pointer-events: none; left: ${p[0]}px; top: ${p[1]}px`;
        s.append(mark);
        return agent.place || agent.id; })()"""
    name = window.evaluate(at_head)
    window.click("#head")
    window.wait_for("!document.getElementById('about-box').hidden", 30.0)
    said = "document.getElementById('about').textContent"
    assert f"{name} (head)" in window.evaluate(said), window.evaluate(said)
    window.click("#coding-box summary")
    window.wait_for("document.getElementById('coding-box').open", 30.0)
    window.click("#mark")
    window.wait_for("viewer.coding.open !== null", 30.0)
    film, *size = window.evaluate(f"({FILM})()")
    even = tuple(px // 2 * 2 for px in size)
    assert [(40 * k, *even) for k in range(5)] == pictures_of(film)
    window.click("#help-button")
    window.wait_for("document.getElementById('help').open", 30.0)
