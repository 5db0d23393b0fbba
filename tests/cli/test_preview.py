"""Previews: any trial as picture, sheet and film; refused requests say what to ask instead."""

import itertools
import json
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from tests.sessions import STUDIES
from tests.stage import figures
from visavis.cli.app import load_lab
from visavis.cli.film.on_page import BACK
from visavis.cli.main import app
from visavis.cli.notifier import Forecast
from visavis.cli.preview.capture import (
    BackgroundPerformance,
    Capture,
    CapturedFrame,
    has_board,
    is_lit,
    spread,
)
from visavis.cli.preview.pictures import Viewpoint, add_label, camera_of, camera_through
from visavis.lab.config import Screen
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import LabError, UsageError
from visavis.lab.geometry import Pose, rotate
from visavis.results.opened_study import find_study
from visavis.running.sessions.session_request import Request
from visavis.stage.errors import StageError
from visavis.stage.renderer import Renderer
from visavis.stimuli.picture import Camera


@pytest.fixture(scope="module", autouse=True)
def _can_draw() -> None:
    try:
        Renderer().close()
    except StageError as problem:
        pytest.skip(str(problem))


def preview(*arguments: object) -> str:
    result = CliRunner().invoke(app, ["preview", *map(str, arguments)])
    if isinstance(result.exception, LabError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(scope="module")
def captured() -> Capture:
    preview_capture = Capture(
        find_study("stare"), load_lab(EXAMPLE, "sim", quiet=True), number=1, index=1, seed=1
    )
    preview_capture.perform(until_s=0.5)
    return preview_capture


@pytest.mark.parametrize("study", ["stare", "crowd"])
def test_picture_of_a_trial_shows_a_lit_scene_marked_as_simulated(
    study: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[str] = []

    def keep(image: np.ndarray, text: str) -> Image.Image:
        written.append(text)
        return add_label(image, text)

    monkeypatch.setattr("visavis.cli.commands.preview.add_label", keep)
    path = tmp_path / "one.png"
    preview(study, "--png", path, "--at", 0.2, "--size", "240x150")

    assert [text.split()[0] for text in written] == ["simulated"]
    with Image.open(path) as image:
        pixels = np.asarray(image)
    assert pixels.shape == (150, 240, 3)
    assert pixels[:120].mean() > 40
    assert pixels[:120].std() > 20


@pytest.mark.parametrize("who", [("--participant", "1"), ("--participant", "2", "--seed", "5"), ()])
def test_preview_shows_the_trial_that_plan_lists(
    who: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    CliRunner().invoke(app, ["init"])
    options = ["waving", *who, "--set", "clerk=[clerk_left]"]
    plan = json.loads(CliRunner().invoke(app, ["plan", *options, "--json"]).stdout)
    listed = next(
        t for b in plan["blocks"] for t in b["trials"] if t["number"] == 2 and not t["is_practice"]
    )
    shown: list[Capture] = []

    def keep(capture: Capture, *_: object) -> list[CapturedFrame]:
        shown.append(capture)
        raise UsageError("seen")

    monkeypatch.setattr(Capture, "perform", keep)
    with pytest.raises(UsageError, match="seen"):
        preview(*options, "--trial", 2, "--png", "a.png")

    assert listed["factors"] == dict(shown[0].trial.factors)


def test_film_has_as_many_pictures_as_its_seconds_say_all_marked_and_says_how_long_it_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "film.avi"
    written: list[str] = []

    def keep(image: np.ndarray, text: str) -> Image.Image:
        written.append(text)
        return add_label(image, text)

    monkeypatch.setattr("visavis.cli.commands.preview.add_label", keep)
    monkeypatch.setattr(Forecast, "line_after", lambda _, done, of: f"{of} take long" * (done == 1))
    said = preview("stare", "--video", path, "--seconds", 0.2, "--rate", 10, "--size", "96x64")

    assert 1 == said.count("2 take long")
    assert ["simulated"] * 2 == [text.split()[0] for text in written]
    assert path.read_bytes().count(b"00dc") == 2 * 2  # each in the data and in the index


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("stare", "--png", "a.png", "--window"), "choose one"),
        (("stare", "--trial", 900, "--png", "a.png"), "no trial 900; the plan has 1 to"),
        (("stare", "--png", "missing/a.png"), "no folder missing"),
        (("stare", "--png", "a.png", "--size", "huge"), "write width x height"),
        (("stare", "--png", "a.png", "--size", "²00x200"), "write width x height"),
        (("stare", "--png", "a.png", "--at", -1), "counts from 0"),
        (("stare", "--png", "a.png", "--at", "nan"), "counts from 0"),
        (("stare", "--video", "a.avi", "--seconds", "inf"), "counts from 0"),
        (("stare", "--png", "a.png", "--participant", 0), "numbers go from 1"),
        (("star", "--png", "a.png"), "did you mean 'stare'"),
    ],
)
def test_a_request_that_cannot_be_met_says_what_to_ask_instead(
    arguments: tuple[object, ...], message: str
) -> None:
    with pytest.raises(LabError, match=message):
        preview(*arguments)


def test_a_picture_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "kept.png"
    path.write_bytes(b"kept")
    with pytest.raises(UsageError, match="exists already"):
        preview("stare", "--png", path)
    assert path.read_bytes() == b"kept"


def test_a_picture_of_an_unknown_kind_is_refused_before_anything_is_drawn(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"a\.xyz: pictures are written as \.png or \.jpg"):
        preview("stare", "--png", tmp_path / "a.xyz")


def test_a_film_of_an_unknown_kind_is_refused_before_anything_is_performed(tmp_path: Path) -> None:
    with pytest.raises(StageError, match=r"a\.mov: no film of the kind .* name it \.avi"):
        preview("stare", "--video", tmp_path / "a.mov", "--size", "64x64")
    assert not list(tmp_path.iterdir())


def test_performance_begins_with_light_and_ends_when_enough_is_seen(captured: Capture) -> None:
    frames = captured.frames
    assert frames[0].view.scene.brightness_01 > 0
    assert not captured.is_whole
    assert (frames[-1].t_ns - frames[0].t_ns) * 1e-9 == pytest.approx(0.5, abs=0.02)


def test_a_trial_performed_meanwhile_ends_when_its_window_closes() -> None:
    capture = Capture(
        find_study("stare"), load_lab(EXAMPLE, "sim", quiet=True), number=2, index=1, seed=1
    )
    with BackgroundPerformance(capture) as meanwhile:
        assert capture.frames
        meanwhile.check()
    assert "preview" not in {thread.name for thread in threading.enumerate()}


def test_what_fails_meanwhile_is_raised_where_it_is_shown(
    captured: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(until_s: float | None = None) -> list[CapturedFrame]:
        raise UsageError("broken")

    fresh = Capture(
        find_study("stare"), load_lab(EXAMPLE, "sim", quiet=True), number=1, index=1, seed=1
    )
    monkeypatch.setattr(fresh, "perform", fail)
    with pytest.raises(UsageError, match="broken"), BackgroundPerformance(fresh):
        pass


def test_film_keeps_the_trial_s_own_speed(captured: Capture) -> None:
    chosen = spread(captured.frames, 20, 0.5)
    assert [50_000_000] * (len(chosen) - 1) == [
        b.t_ns - a.t_ns for a, b in itertools.pairwise(chosen)
    ]
    assert len(chosen) == pytest.approx(11, abs=1)
    assert spread([], 20, 0.5) == []


def _shown_01(camera: Camera, point_m: np.ndarray) -> np.ndarray:
    turn = camera.pose.orientation_wxyz * [1, -1, -1, -1]
    x, y, z = rotate(turn, point_m - camera.pose.position_m)
    assert z < 0
    return np.array([x / -z / camera.right, y / -z / camera.top])


@pytest.mark.parametrize("view", [Viewpoint.ABOVE, Viewpoint.ORBIT])
@pytest.mark.parametrize("passed_s", [0.0, 7.0])
def test_views_from_outside_hold_everybody(view: Viewpoint, passed_s: float) -> None:
    picture = replace(figures.picture(8))
    head = Pose(np.array([0.0, 1.6, 1.0]), np.array([1.0, 0, 0, 0]))
    camera = camera_of(view, picture, head, 1.6, passed_s=passed_s)
    for point in (*picture.people.root_m, head.position_m):
        assert np.abs(_shown_01(camera, point)).max() < 1.0


def test_view_from_the_eyes_is_the_participant_s_head() -> None:
    head = Pose(np.array([0.1, 1.6, 1.0]), np.array([1.0, 0, 0, 0]))
    assert camera_of(Viewpoint.EYES, figures.picture(1), head, 1.6, passed_s=0).pose is head


def test_before_a_monitor_the_picture_reaches_from_edge_to_edge_of_it() -> None:
    screen = Screen(
        width_m=0.5, height_m=0.3, width_px=1920, height_px=1152, distance_m=0.5, center_up_m=0.05
    )
    head = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0, 0, 0]))
    camera = camera_through(screen, head, 5 / 3)
    edges = (camera.left, camera.right, camera.bottom, camera.top)
    assert edges == pytest.approx((-0.5, 0.5, -0.2, 0.4))
    wide = camera_through(screen, head, 10 / 3)
    assert (wide.left, wide.right) == pytest.approx((-1.0, 1.0))  # all of its height is in sight


VISITS = """from visavis import Factor, Rating, Scene, Study

study = Study("visits", factors=[Factor("motion", ["idle"])], sessions=["learning", "test"],
              calibrate=False, uses=[])


@study.trial
def trial(t):
    yield t.show(Scene("person", motion=t.motion), seconds=0.5, name=f"at_{t.session}")
    yield t.ask(Rating("nice"))
"""


def test_plan_names_the_session_and_preview_performs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "visits.py").write_text(VISITS, "utf-8")
    monkeypatch.chdir(tmp_path)
    CliRunner().invoke(app, ["init"])
    said = CliRunner().invoke(app, ["plan", "./visits.py", "--session", "2"]).output
    assert "session 2 of 2: test" in " ".join(said.split())
    performed: list[object] = []

    def keep(request: Request) -> None:
        performed.append(request.experiment.of_session(request.person.session).session)
        raise UsageError("seen")

    monkeypatch.setattr("visavis.cli.preview.capture.perform_new", keep)
    with pytest.raises(UsageError, match="seen"):
        preview("./visits.py", "--session", 2, "--png", "a.png")
    assert [2] == performed


SHORT_STUDY = """from visavis import Factor, Rating, Scene, Study

study = Study("short", factors=[Factor("motion", ["idle", "wave"])], calibrate=False, uses=[])


@study.trial
def trial(t):
    yield t.show(Scene("person", motion=t.motion, distance_m=1.5), seconds=0.5)
    yield t.ask(Rating("nice"))
"""


def test_a_preview_goes_on_to_the_questions_put_in_the_dark(tmp_path: Path) -> None:
    (tmp_path / "short.py").write_text(SHORT_STUDY, "utf-8")
    lab = load_lab(EXAMPLE, "sim", quiet=True)
    preview_capture = Capture(
        find_study(str(tmp_path / "short.py")), lab, number=1, index=0, seed=1
    )
    frames = preview_capture.perform()
    boards = [k for k, seen in enumerate(frames) if has_board(seen.view)]
    assert not has_board(frames[0].view)
    assert is_lit(frames[0].view)
    assert "nice" in frames[boards[0]].view.panels[0].text.lower()


def test_a_picture_of_a_short_trial_shows_its_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "short.py").write_text(SHORT_STUDY, "utf-8")
    written: list[str] = []

    def keep(image: np.ndarray, text: str) -> Image.Image:
        written.append(text)
        return add_label(image, text)

    monkeypatch.setattr("visavis.cli.commands.preview.add_label", keep)
    preview(tmp_path / "short.py", "--png", tmp_path / "one.png", "--size", "240x150")
    with Image.open(tmp_path / "one.png") as image:
        assert np.asarray(image)[:120].mean() > 40
    assert str(tmp_path) not in written[0]  # the study's name, not where its file lies
    at_s = float(written[0].rpartition(", ")[2].removesuffix(" s"))
    assert 0 < at_s < 0.5


def test_trial_on_a_page_shows_its_film_with_the_question_below(tmp_path: Path) -> None:
    study, path = STUDIES / "films.py", tmp_path / "page.png"
    preview(study, "--trial", 2, "--png", path, "--at", 0.5, "--size", "480x300")
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    films, below = pixels[30:220], pixels[230:290]
    assert 1 == len(parts_of(np.abs(films - BACK).sum(axis=2).max(axis=0) > 30))
    assert (np.abs(below - BACK).sum(axis=2) > 30).any()
    with pytest.raises(UsageError, match=r"--at 900\.0 s: the trial lasts"):
        preview(study, "--png", tmp_path / "late.png", "--at", 900)
    with pytest.raises(UsageError, match="on a page: leave --view out"):
        preview(study, "--png", tmp_path / "above.png", "--view", "above")


def parts_of(columns: np.ndarray) -> list[int]:
    """Return where runs of at least 40 true columns begin."""
    edges = np.flatnonzero(np.diff(np.r_[0, columns.astype(int), 0]))
    return [int(a) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 40]
