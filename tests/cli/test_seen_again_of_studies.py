"""Every core study and a study on a page can be viewed, filmed and drawn again after a session."""

import json
import zlib
from base64 import b64decode
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from tests.running.test_every_study import SMALL, config_for, name_of
from tests.sessions import STUDIES
from visavis.cli.app import app
from visavis.cli.film.on_page import FilmPictures
from visavis.cli.redraw import UNDRAWN_PX
from visavis.recording.folder import study_dir
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.study_folder import settle, wanted_settings
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Quality, Renderer
from visavis.stage.stills import STILL

CORE = ("stare", "crowd", "waving")
ON_PAGE = str(STUDIES / "films.py")
SEATED = "stare"
"""Filmed over the shoulder, where a camera decides nothing."""
SHORT: dict[str, dict[str, Any]] = {
    **SMALL,
    "crowd": {**SMALL["crowd"], "limit_s": 1.5},
    # Few warps, which take long to plan.
    "waving": {**SMALL["waving"], "technique": ["orientation"]},
}
LATER_NS = 600_000_000
"""From a trial's beginning to when its scene is lit in all of them."""


@dataclass(frozen=True)
class Session:
    """A recorded session of a study."""

    reference: str
    path: Path

    def run(self, *words: object) -> Any:
        """Run a command on it."""
        done = CliRunner().invoke(app, [str(word) for word in words])
        assert done.exit_code == 0, done.output or done.exception
        return done


@pytest.fixture(scope="module", params=[*CORE, ON_PAGE], ids=name_of)
def session(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Session:
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))
    reference = str(request.param)
    study, folder = find_study(reference), tmp_path_factory.mktemp("again")
    settings_at = study_dir(folder, study.name, is_simulated=True)
    settle(settings_at, wanted_settings(settings_at, study, is_simulated=True), seed_given=False)
    experiment = study.experiment(SHORT.get(study.name, {}))
    asked = simulated_request(
        study,
        experiment,
        config_for(study, folder),
        label="S01",
        index=0,
        seed=1,
        group=experiment.plan(0, 1).group,
    )
    return Session(reference, perform_new(asked))


@pytest.mark.timeout(600)
def test_a_session_is_shown_in_a_page(session: Session, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    session.run("view", session.path, "--trial", "T01", "-o", page)
    packed = page.read_text(encoding="utf-8").partition('id="data">')[2].partition("<")[0]
    content = zlib.decompress(b64decode(packed))
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    assert "T01" in [trial["id"] for trial in header["trials"]]
    shown = header["pages"] if session.reference == ON_PAGE else header["scenes"]
    assert shown
    assert page.stat().st_size < 15e6


@pytest.mark.timeout(600)
def test_a_session_is_filmed(session: Session, tmp_path: Path) -> None:
    film, options = tmp_path / "film.avi", ("--seconds", "0.5", "--rate", "4", "--size", "160x90")
    session.run("film", session.path, "--trial", "T01", "-o", film, *options)
    assert b"AVI " == film.read_bytes()[8:12]
    if session.reference not in (ON_PAGE, SEATED):
        assert json.loads(film.with_suffix(".json").read_text())["views"]


@pytest.mark.timeout(600)
def test_a_frame_of_a_session_is_drawn_again(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if session.reference == ON_PAGE:
        asked = ["redraw", str(session.path), "--frame", "1", "--png", str(tmp_path / "p.png")]
        assert "visavis film" in str(CliRunner().invoke(app, asked).exception)
        return
    recording = Recording(session.path)
    trials = recording.trials()
    begin_ns = int(trials[trials["trial_id"] == "T01"].iloc[0]["t_start_ns"])
    frames = recording.stream_arrays("frames")
    frame = int(frames["frame_index"][np.searchsorted(frames["t_host_ns"], begin_ns + LATER_NS)])
    png, times, asked_for = tmp_path / "frame.png", STILL.shrink_factor, []

    def opened(quality: Quality) -> Renderer:
        asked_for.append(quality.samples)
        return Renderer(quality=quality)

    monkeypatch.setattr("visavis.cli.redraw.Renderer", opened)
    session.run("redraw", session.path, "--frame", frame, "--png", png)
    assert [4 if times == 1 else 0] == asked_for  # samples cost a processor most of its time
    assert 2 * UNDRAWN_PX[0] == np.asarray(Image.open(png)).shape[1]
    assert np.asarray(Image.open(png).convert("L")).std() > 5


def test_a_second_page_of_a_session_draws_no_film_anew(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if session.reference != ON_PAGE:
        pytest.skip("films are of studies on a page")
    monkeypatch.setattr("visavis.running.film_store.cache_folder", lambda: tmp_path / "cache")
    session.run("view", session.path, "-o", tmp_path / "first.html")

    def drawn(*_: object) -> None:
        raise AssertionError("a film was drawn that had been drawn before")

    monkeypatch.setattr(FilmPictures, "at", drawn)
    session.run("view", session.path, "-o", tmp_path / "second.html")
    assert (tmp_path / "first.html").stat().st_size == (tmp_path / "second.html").stat().st_size
