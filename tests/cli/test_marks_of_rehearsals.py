"""What is shown of a rehearsal, or written of it, says that nobody took part."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from tests.faults.sessions import CONFIG
from tests.sessions import opened, perform
from visavis.cli.app import app, load_lab
from visavis.cli.film.on_page import page_label
from visavis.cli.preview.pictures import TITLE_PX, write_below
from visavis.lab.clock import SystemClock
from visavis.lab.config import with_devices
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import find_study
from visavis.running.sessions.device_setup import screen_display
from visavis.running.sessions.drawn_stages import window_title
from visavis.running.sessions.perform import build_stage


def test_a_window_of_a_rehearsal_is_titled_so() -> None:
    experiment = find_study("stare").experiment({})
    rehearsal = load_lab(CONFIG, "sim", quiet=True)
    assert "Visavis: stare  ·  SIMULATED, not a participant" == window_title(rehearsal, experiment)
    assert "Visavis: stare" == window_title(with_devices(rehearsal, "real"), experiment)


class Opened(Exception):
    """A window was asked for."""


@pytest.mark.parametrize("show", ["window", "headset", "screen"])
def test_every_window_of_a_session_has_that_title(
    show: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def opened(_: object, title: str, *__: object, **___: object) -> None:
        raise Opened(title)

    monkeypatch.setattr("visavis.stage.window.Window.__init__", opened)
    lab = load_lab(SCREEN_EXAMPLE if show == "screen" else CONFIG, "sim", quiet=True)
    lab = lab.model_copy(update={"display": lab.display.model_copy(update={"show": show})})
    clock = SystemClock()
    headset = SimpleNamespace(display_rate_hz=90.0, eye_views=tuple, show_images=tuple)
    rig: Any = SimpleNamespace(headset=screen_display(lab, clock) or headset)
    experiment = find_study("stare").experiment({})
    with pytest.raises(Opened, match="SIMULATED, not a participant"):
        build_stage(lab, experiment, rig, clock, [])


def test_a_line_below_a_picture_leaves_the_picture_as_it_was() -> None:
    image = np.random.default_rng(1).integers(0, 255, (40, 300, 3), np.uint8)
    marked = np.asarray(write_below(image, "simulated"))
    assert (image == marked[:40]).all()
    assert marked[40:].min() < 128 < marked[40:].max()


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return perform("duel", tmp_path_factory.mktemp("marks"), repetitions=1, practice=0).path


def test_a_frame_drawn_again_has_the_line_below_it_unless_people_took_part(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    eye = np.full((40, 30, 3), 7, np.uint8)
    redraw = "visavis.cli.commands.redraw"
    monkeypatch.setattr(f"{redraw}.draw_again", lambda *_, **__: (eye, eye))
    monkeypatch.setattr(f"{redraw}.study_of_session", lambda _: (opened("duel"), ""))
    heights = []
    for name in ("rehearsal", "real"):
        path = tmp_path / f"{name}.png"
        done = CliRunner().invoke(app, ["redraw", str(session), "--frame", "1", "--png", str(path)])
        assert 0 == done.exit_code, done.exception
        with Image.open(path) as picture:
            heights.append(picture.height)
        monkeypatch.setattr(CachedRecording, "is_simulated", False)
    assert [40 + TITLE_PX, 40] == heights


def test_pictures_of_a_page_say_so(session: Path) -> None:
    assert page_label(CachedRecording(session), "T01").startswith("simulated  ·  duel S01 T01  ")
