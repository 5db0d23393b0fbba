"""One trial of several participants on one page: what is in it, and a browser that opens it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.cli.viewer_tab import header_of, viewer_tab
from tests.running.page.test_browser import faults_for_people
from tests.sessions import opened, perform
from visavis.analysis.gaze.aoi import LOST
from visavis.analysis.gaze.looks import measure_trial
from visavis.cli.app import app
from visavis.protocol.people.exports_register import registered_exports
from visavis.recording.cached import CachedRecording
from visavis.recording.folder import study_dir
from visavis.running.sessions.study_folder import settle, wanted_settings

RING = """k => { viewer.pick(-1); viewer.setCamera('eyes'); viewer.draw();
    const ring = viewer.rings.find(r => r.k === k); viewer.click(ring.x, ring.y);
    return [viewer.picked, viewer.seen.length, viewer.header.participant]; }"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a study with the sessions of two participants."""
    root = tmp_path_factory.mktemp("together")
    study = opened("duel")
    at = study_dir(root, study.name, is_simulated=True)
    settle(at, wanted_settings(at, study, is_simulated=True), seed_given=False)
    for index in range(2):
        perform("duel", root, index, repetitions=1, practice=0)
    return at


@pytest.fixture(scope="module")
def page(folder: Path) -> Path:
    path = folder.parent / "both.html"
    words = ["view", str(folder), "--trial", "T02", "--participants", "all", "-o", str(path)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output or done.exception
    return path


@pytest.fixture(scope="module")
def tab(page: Path, playwright: Any) -> Iterator[Any]:
    """The page in a real browser, in the middle of the trial."""
    with viewer_tab(playwright, page, 1000, 700) as (window, problems):
        window.evaluate(
            """() => { const both = t => viewer.sessions.every(s => { const g =
            s.streams.gazeAt(t); return g && g.valid && !Number.isNaN(g.far); });
            let t = viewer.header.trials[0].t0 + 0.3; while (!both(t)) t += 0.02;
            viewer.seek(t); }"""
        )
        yield window
    assert [] == problems


def test_a_page_of_several_holds_each_ones_trial_alone_from_one_start(page: Path) -> None:
    header = header_of(page)
    assert 2 == len({one["participant"] for one in header["sessions"]})
    for one in header["sessions"]:
        assert [("T02", 1.0)] == [(trial["id"], trial["t0"]) for trial in one["trials"]]
        assert one["fixations"]
        end_s = one["trials"][0]["t1"]
        assert all(1.0 <= event["t"] <= end_s for event in one["events"])
        assert all(1.0 <= fixation["t0"] <= end_s for fixation in one["fixations"])
    assert "simulated" in header


def test_a_page_of_several_is_registered_for_everyone_on_it(folder: Path, page: Path) -> None:
    (export,) = registered_exports(folder)
    assert page.name in [*export.files]
    assert 2 == len(export.labels)


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--participants", "all"], "one --trial"),
        (["--participants", "all", "--trial", "T01", "--trial", "T02"], "one --trial"),
        (["--participants", "77", "--trial", "T01"], "77 has no session"),
        (["--participants", "all", "--trial", "T99"], "whole trial T99"),
    ],
)
def test_what_several_cannot_be_shown_of_is_said(
    folder: Path, words: list[str], problem: str
) -> None:
    done = CliRunner().invoke(app, ["view", str(folder), *words, "-o", str(folder / "no.html")])
    assert problem in str(done.exception)
    assert not (folder / "no.html").exists()


def test_all_rings_are_drawn_and_a_click_or_a_key_picks_one_out(tab: Any) -> None:
    everyone = "() => { viewer.pick(-1); viewer.setCamera('eyes'); viewer.draw();"
    assert 2 == tab.evaluate(everyone + "return viewer.rings.length; }")
    colours = tab.evaluate("viewer.sessions.map(s => s.colour)")
    assert 2 == len(set(colours))
    picked, seen, label = tab.evaluate(RING, 1)
    assert (1, 1) == (picked, seen)
    assert label in tab.inner_text(".who[aria-pressed=true]")
    tab.keyboard.press("Escape")
    assert -1 == tab.evaluate("viewer.picked")
    tab.keyboard.press("]")
    assert 0 == tab.evaluate("viewer.picked")
    tab.keyboard.press("[")
    assert [-1, 2] == tab.evaluate("[viewer.picked, viewer.seen.length]")


def test_the_time_line_is_that_of_the_one_picked_out(tab: Any) -> None:
    shown = "k => { viewer.pick(k); viewer.line.draw(); return viewer.line.whom(); }"
    assert tab.evaluate(shown, 0) != tab.evaluate(shown, 1)
    assert tab.evaluate(shown, -1) == tab.evaluate(shown, 0)


def test_dwell_of_everybody_on_one_head_is_that_of_the_analysis(folder: Path, tab: Any) -> None:
    measured = tab.evaluate(
        """() => { const key = {kind: 'person', name: 'left'}; viewer.about = key;
        viewer.tellAbout(); return viewer.sessions.map(s => [s.header.scenes.find(c =>
        c.agents.length).agents.map(a => a.place || a.id), s.header.participant,
        s.measures({kind: 'person', name: s.header.scenes.find(c => c.agents.length).agents[0].place
        || s.header.scenes.find(c => c.agents.length).agents[0].id}, s.header.trials[0])]); }"""
    )
    for _, label, one in measured:
        recording = CachedRecording(next(folder.glob(f"sub-{label}/ses-*")))
        rows = recording.trials()
        row = rows[rows["trial_id"] == "T02"].iloc[-1]
        gaze = recording.stream_arrays("gaze_targets")
        wanted = measure_trial(
            gaze["t_sample_ns"],
            np.where(gaze["valid"], gaze["hit"], LOST),
            0,
            int(row["t_start_ns"]),
            int(row["t_end_ns"]),
        )
        assert pytest.approx(wanted.dwell_ms, abs=0.1) == 1000 * one["dwell"]
        assert wanted.fixation_count == one["count"]
    assert 2 == tab.evaluate("document.querySelectorAll('#about tbody tr:not(.mean)').length")


def test_nothing_is_wider_than_a_narrow_screen(tab: Any) -> None:
    tab.set_viewport_size({"width": 390, "height": 844})
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    assert tab.evaluate("document.getElementById('stage').clientHeight") >= 200
    tab.set_viewport_size({"width": 1000, "height": 700})


def test_how_alike_views_were_is_counted_at_once_and_in_all(tab: Any) -> None:
    """Of four quarters, three are looked at the same; of the time on a, a quarter is shared."""
    counted = """() => { const one = until => ({trialAt: () => ({t0: 0, t1: 4}), keyOf: hit =>
        ({kind: 'person', name: 'ab'[hit]}), streams: {gazeAt: t => ({valid: true, hit:
        Number(t >= until)})}});
        return alikeOf([one(2), one(1)], {t0: 0, t1: 4}); }"""
    (pair,) = tab.evaluate(counted)
    assert (pytest.approx(0.75, abs=0.01),) * 2 == (pair["atOnce"], pair["inAll"])
    same = "alikeOf([viewer.sessions[0], viewer.sessions[0]], viewer.header.trials[0])"
    (itself,) = tab.evaluate(same)
    assert (1, pytest.approx(1)) == (itself["atOnce"], itself["inAll"])
    tab.evaluate("viewer.pick(-1)")
    tab.evaluate("$('alike-box').open = true")
    tab.wait_for_function("document.querySelectorAll('#alike tbody tr').length === 2")
    tab.click("#alike tbody tr:nth-child(2)")
    tab.wait_for_function("document.querySelectorAll('#alike tbody tr').length === 1")
    tab.evaluate("viewer.pick(-1)")


def test_everybody_has_a_line_of_looks_until_one_is_picked_out(tab: Any) -> None:
    rows = "k => { viewer.pick(k); return viewer.line.rows().filter(r => r.looks).length; }"
    assert [2, 1] == [tab.evaluate(rows, k) for k in (-1, 1)]
    tab.evaluate("viewer.pick(-1)")


def test_a_picture_of_several_names_every_recording(tab: Any) -> None:
    caption = tab.evaluate("viewer.saving.caption()")
    hashes = tab.evaluate("viewer.sessions.map(one => one.header.sha256.slice(0, 6))")
    assert f"2 participants · T02 at {tab.evaluate('viewer.t') - 1:.2f} s" in caption
    assert all(one in caption for one in hashes)


def test_a_page_of_several_shuts_nobody_out(tab: Any) -> None:
    assert [] == faults_for_people(tab)
