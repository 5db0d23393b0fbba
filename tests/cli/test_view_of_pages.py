"""What the viewer's page shows of a session on a page; no browser is open meanwhile, as one would
be in whose loop such a session cannot be performed.
"""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.cli.viewer_tab import header_of
from tests.sessions import opened, perform
from visavis.cli.app import app
from visavis.recording.folder import study_dir
from visavis.running.sessions.study_folder import settle, wanted_settings
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer


def test_a_session_on_a_page_shows_films_questions_and_answers_in_time(tmp_path: Path) -> None:
    study = opened("films")
    settings_at = study_dir(tmp_path, study.name, is_simulated=True)
    settle(settings_at, wanted_settings(settings_at, study, is_simulated=True), seed_given=False)
    recording = perform("films", tmp_path)
    path = tmp_path / "films.html"
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))
    done = CliRunner().invoke(app, ["view", str(recording.path), "-o", str(path)])
    assert done.exit_code == 0, done.output
    header = header_of(path)
    assert ["P1"] * 3 + ["T01"] * 3 + ["T02"] * 3 == [s["trial"] for s in header["pages"]]
    assert [1, 2, 0] * 3 == [len(s["films"]) for s in header["pages"]]
    assert {6} == {len(f["frames"]) for f in header["films"]}
    row = recording.trials().iloc[-1]
    assert str(row["lively"]) == header["pages"][6]["questions"][0]["answer"]
    assert pytest.approx(row["film_on_ns"] / 1e9, abs=1e-6) == header["pages"][6]["on"]
