"""Maps of gaze on the scene: on whom they lie, from where they are seen, and what is refused."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from typer.testing import CliRunner

from tests.sessions import opened, perform, request_in
from visavis.analysis.gaze.maps import Grid
from visavis.cli.app import app
from visavis.cli.gaze_map import (
    COARSE,
    TrialGaze,
    _ends,
    gaze_maps,
    maps_of_people,
)
from visavis.cli.gaze_map_figure import difference_words, table_of_maps
from visavis.cli.recorded_trial import recorded_trial
from visavis.lab.clock import NS_PER_S
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.recording.cached import CachedRecording
from visavis.recording.folder import study_dir
from visavis.results.opened_study import find_study
from visavis.running.scripts import open_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.study_folder import settle, wanted_settings
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer
from visavis.stimuli.dressing.picture_of import NOBODY, NOWHERE
from visavis.stimuli.picture import Picture, Sheet
from visavis.stimuli.surfaces import Surfaces

BRIEF = """
from visavis import Choice, Factor, Scene, Study

study = Study("brief", "S", factors=[Factor("who", ["anna"])], texts="texts", calibrate=False)

@study.trial
def trial(t):
    yield t.show(Scene("person", character=t.who), seconds=1.0)
    yield t.ask(Choice("looks", ["yes", "no"]))
"""
GRID = Grid(0.8, 0.5, 160, 100)


def looks(who: str, ends_m: list[list[float]], seconds: float = 0.1) -> TrialGaze:
    ends = np.array(ends_m)
    return TrialGaze(who, "A", np.zeros_like(ends), ends, np.full(len(ends), seconds))


@pytest.mark.parametrize("yaw_deg", [0.0, 40.0, -120.0])
def test_a_place_lies_where_the_eye_sees_it(yaw_deg: float) -> None:
    turn = quat_from_yaw_pitch_deg(yaw_deg)
    # 2 m ahead, .4 m to the right and .3 m up, as the turned eye has them.
    angle, eye_m = np.radians(yaw_deg), np.array([1.0, 1.2, 3.0])
    right = np.array([np.cos(angle), 0, -np.sin(angle)])
    ahead = np.array([-np.sin(angle), 0, -np.cos(angle)])
    place = eye_m + 2 * ahead + 0.4 * right + np.array([0, 0.3, 0])
    made = maps_of_people([looks("07K", [place.tolist()])], Pose(eye_m, turn), GRID)
    row, column = np.unravel_index(made["07K"].argmax(), GRID.shape)
    x, y = GRID.centres()
    assert (0.2, 0.15) == (pytest.approx(x[column], abs=0.006), pytest.approx(y[row], abs=0.006))


def test_a_map_is_of_one_trial_and_what_is_behind_the_eye_is_nowhere() -> None:
    eye = Pose(np.zeros(3), quat_from_yaw_pitch_deg(0))
    once = maps_of_people([looks("07K", [[0, 0, -2]])], eye, GRID)["07K"]
    twice = maps_of_people([looks("07K", [[0, 0, -2], [0, 0, 2]])] * 2, eye, GRID)["07K"]
    np.testing.assert_allclose(once, twice)
    assert (once * GRID.area_deg2()).sum() == pytest.approx(0.1, rel=1e-4)


@pytest.mark.parametrize("gap", [slice(0, 0), slice(10, 100), slice(4, 29)])
def test_gaze_on_something_that_moves_ends_on_it(
    gap: slice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A board .3 m wide passes at 1.1 m/s, 2 m away, and gaze follows its middle."""
    t_ns = np.arange(0, 5 * NS_PER_S, NS_PER_S // 120)
    across_m = 1.1 * (t_ns / NS_PER_S - 2.5)
    valid = np.ones(len(t_ns), np.bool_)
    valid[gap] = False
    trial: Any = SimpleNamespace(
        gaze={
            "t_sample_ns": t_ns,
            "valid": valid,
            "origin_world_m": np.zeros((len(t_ns), 3)),
            "direction_world": np.stack(
                [across_m, np.zeros(len(t_ns)), np.full(len(t_ns), -2.0)], axis=1
            ),
        },
        span_of=lambda during: (0, 5 * NS_PER_S),
    )

    def passing(at_ns: int) -> Picture:
        place = np.array([1.1 * (at_ns / NS_PER_S - 2.5), 0.0, -2.0])
        board = Sheet(
            np.zeros((1, 1, 4), np.uint8), Pose(place, quat_from_yaw_pitch_deg(0)), (0.3, 0.3)
        )
        return Picture(at_ns, NOWHERE, (), NOBODY, sheets=(board,))

    monkeypatch.setattr("visavis.cli.gaze_map.pictures_of", lambda *of: passing)
    monkeypatch.setattr(
        "visavis.cli.gaze_map._scene_changes_ns", lambda trial: np.zeros(0, np.int64)
    )
    ends = _ends(opened("duel"), trial, Surfaces(COARSE), "")
    assert ends is not None
    assert np.count_nonzero(valid[::4]) == len(ends[0])
    np.testing.assert_allclose(ends[1][:, 2], -2.0, atol=1e-6)


@pytest.fixture(scope="module")
def drawing() -> None:
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, drawing: None) -> Path:
    root = tmp_path_factory.mktemp("map")
    study = opened("duel")
    where = study_dir(root, study.name, is_simulated=True)
    settle(where, wanted_settings(where, study, is_simulated=True), seed_given=False)
    for index in range(2):
        perform("duel", root, index, repetitions=1, practice=0)
    return where


def test_people_look_at_people_and_the_map_says_how_long(folder: Path) -> None:
    data = open_study(folder)
    (made,) = gaze_maps(data, "gaze", peek=None, on_trial=lambda done, total: None)
    counted = data.analysis().selection.counted
    for level in made.levels:
        seconds = (made.maps[level] * made.grid.area_deg2()).sum(axis=(1, 2))
        lasted = counted[counted["gaze"] == level]
        longest = (lasted["t_end_ns"] - lasted["t_start_ns"]).max() / 1e9
        assert (seconds > 0.3).all()
        assert (seconds <= longest).all()
    table = table_of_maps(made, is_simulated=True)
    assert len(made.levels) * made.grid.columns * made.grid.rows == len(table)
    assert made.differences[0].clusters is None
    assert "2 participants had both; a test of maps needs 6" in difference_words(made, data.study)


def test_a_factor_that_is_not_there_is_named_with_those_that_are(folder: Path) -> None:
    with pytest.raises(UsageError, match=r"--by place: duel has the factors .*gaze"):
        gaze_maps(open_study(folder), "place", peek=None, on_trial=lambda done, total: None)


def test_levels_to_compare_that_are_not_there_are_named_with_those_that_are(folder: Path) -> None:
    for words, says in (
        ("averted", "give two levels"),
        ("averted,up", "two of the levels of gaze"),
    ):
        command = ["gaze-map", str(folder), "--by", "gaze", "--compare", words]
        result: Any = CliRunner().invoke(app, command)
        assert 0 != result.exit_code
        assert says in str(result.exception or result.output), result.output


def test_sessions_without_gaze_are_told_by_their_folder(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = open_study(folder)
    names = CachedRecording(data.sessions[0].path).stream_names
    others = [name for name in names if name != "gaze_targets"]
    data.analysis()  # measured with gaze, which the recordings then lack
    monkeypatch.setattr(CachedRecording, "stream_names", others)
    calls: list[tuple[int, int]] = []
    with pytest.raises(UsageError, match=r"duel: no trial that counts has usable gaze"):
        gaze_maps(data, "gaze", peek=None, on_trial=lambda *of: calls.append(of))
    assert calls[-1][0] == calls[-1][1]  # the bar comes to its end


def test_something_that_was_never_shown_is_named_with_what_was(folder: Path) -> None:
    says = r"usable gaze while 'scen' was shown; did you mean 'scene'\?"
    with pytest.raises(UsageError, match=says):
        gaze_maps(open_study(folder), "gaze", peek=None, on_trial=lambda *of: None, during="scen")


def test_pages_are_said_to_have_no_gaze(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = open_study(folder)
    data.analysis()
    monkeypatch.setattr("visavis.cli.gaze_map.is_on_page", lambda recording: True)
    monkeypatch.setattr(CachedRecording, "stream_names", [])
    with pytest.raises(UsageError, match=r"on a scene: there is none on a page.*pointer_at"):
        gaze_maps(data, "gaze", peek=None, on_trial=lambda *of: None)


def test_the_verb_writes_pictures_and_a_table_and_says_what_differs(folder: Path) -> None:
    result: Any = CliRunner().invoke(app, ["gaze-map", str(folder), "--by", "gaze"])
    assert 0 == result.exit_code, result.output
    figures = folder / "derived" / "figures"
    for ending in ("svg", "png", "csv"):
        assert (figures / f"gaze_map_by_gaze.{ending}").stat().st_size > 1000
    assert "simulated-watermark" in (figures / "gaze_map_by_gaze.svg").read_text()
    assert "Not compared" in result.output


def test_the_report_has_the_command_until_there_are_maps_and_shows_them_then(folder: Path) -> None:
    derived = folder / "derived"
    for path in derived.glob("figures/gaze_map_by_*"):
        path.unlink()
    for command, is_shown in (([], False), (["gaze-map", str(folder), "--by", "gaze"], True)):
        for words in filter(None, (command, ["analyse", str(folder)])):
            result: Any = CliRunner().invoke(app, words)
            assert 0 == result.exit_code, result.output
        page = (derived / "report.html").read_text("utf-8")
        assert is_shown == ('id="gaze_map_by_gaze-' in page)
        assert is_shown != ("simulated/duel --by gaze</code>" in page)


PICTURES = """
from visavis import Factor, Image, Study, Text, looks_at

study = Study(
    "seen", factors=[Factor("place", ["desk", "shelf"]), Factor("light", ["day", "night"])],
    repetitions=1, measures=[looks_at("left")[0]],
)

@study.trial
def trial(t):
    yield t.show(Text("+"), seconds=0.5, name="fixation")
    yield t.show(Image(f"{t.place}.png", 20, areas="areas.yaml"), seconds=1.5)
"""


def test_pictures_one_after_another_are_refused_with_what_to_say(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = open_study(folder)
    (trial_id, *_) = data.analysis().selection.counted["trial_id"]
    payloads = [
        {
            "trial_id": trial_id,
            "name": name,
            "start_ns": ns,
            "option_items": f"(Image(file='{name}.png', width_deg=3.0),)",
        }
        for name, ns in (("stimulus", 1), ("stimulus2", 2))
    ]
    events = pd.DataFrame({"payload": payloads})
    ends = np.zeros((1, 3)), np.ones((1, 3)), np.ones(1)
    monkeypatch.setattr("visavis.cli.gaze_map._ends", lambda *of: ends)
    monkeypatch.setattr(CachedRecording, "events_named", lambda *of: events)
    with pytest.raises(UsageError, match=r"one after another; .*\(stimulus, stimulus2\)"):
        gaze_maps(data, "gaze", peek=None, on_trial=lambda done, total: None)


def test_each_picture_has_maps_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drawing: None
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "seen.py").write_text(PICTURES, "utf-8")
    (tmp_path / "areas.yaml").write_text(
        "left: {ellipse: [60, 60, 40, 40]}\nright: {mask: painted.png, colour: red}\n", "utf-8"
    )
    painting = Image.new("RGB", (240, 120))
    painting.paste((255, 0, 0), (120, 0, 240, 60))
    painting.paste((255, 0, 0), (120, 60, 180, 120))
    painting.save(tmp_path / "painted.png")
    for name, grey in (("desk", 40), ("shelf", 200)):
        Image.new("RGB", (240, 120), (grey, grey, grey)).save(tmp_path / f"{name}.png")
    for command in (
        "init --screen",
        "simulate ./seen.py --participants 1 --processes 1 --output data",
    ):
        result: Any = CliRunner().invoke(app, command.split())
        assert 0 == result.exit_code, result.output
    data = open_study(tmp_path / "data" / "simulated" / "seen")
    desk, shelf = gaze_maps(data, "light", peek=None, on_trial=lambda done, total: None)
    assert ("desk", "shelf") == (desk.picture, shelf.picture)
    assert ("day", "night") == desk.levels == shelf.levels
    middle = desk.image[desk.image.shape[0] // 2, desk.image.shape[1] // 2, 0]
    assert 100 < shelf.image[shelf.image.shape[0] // 2, shelf.image.shape[1] // 2, 0] - int(middle)
    desk, _ = gaze_maps(data, "light", peek=None, on_trial=lambda *of: None, during="stimulus")
    ((_, (left,)), (name, (right,))) = desk.outlines
    assert ("right", 6) == (name, len(right))
    # an ellipse of 40 by 40 pixels around (60, 60), and an L from the picture's middle to its right
    px = np.ptp(left[:, 0]) / 40
    middle = left.min(axis=0) / 2 + left.max(axis=0) / 2 + [60 * px, 0]
    corners = [(0, 60), (120, 60), (120, 0), (60, 0), (60, -60), (0, -60)]
    outline = middle + np.array(corners) * px
    apart = np.linalg.norm(outline[:, None] - right, axis=2)
    assert 2 * px > max(apart.min(axis=0).max(), apart.min(axis=1).max())
    (one,) = gaze_maps(data, "place", peek=None, on_trial=lambda *of: None, during="fixation")
    assert "" == one.picture  # the cross was the same in all trials
    result = CliRunner().invoke(
        app, [*"gaze-map data/simulated/seen --by place --during stimulus -o map".split()]
    )
    assert 0 == result.exit_code, result.output
    names = {path.name for path in (tmp_path / "map").glob("*.csv")}
    assert {"gaze_map_by_place_desk.csv", "gaze_map_by_place_shelf.csv"} == names
    assert "desk: Not compared: there is one level." in result.output


@pytest.mark.slow  # a session
def test_gaze_in_the_dark_of_a_question_is_on_no_scene(tmp_path: Path) -> None:
    (tmp_path / "brief.py").write_text(BRIEF, "utf-8")
    (tmp_path / "texts").mkdir()
    (tmp_path / "texts" / "en.yaml").write_text("instruction: Look.\n", "utf-8")
    study = find_study(str(tmp_path / "brief.py"))
    recording = CachedRecording(perform_new(request_in(tmp_path, study, EXAMPLE)))
    row = recording.trials().iloc[0]
    ends = _ends(study, recorded_trial(recording, str(row["trial_id"])), Surfaces(COARSE), "")
    assert ends is not None
    # Shown for a second, and thirty rays for each.
    assert 0.6 < ends[2].sum() < 1.0 + 3 / 30 < (row["t_end_ns"] - row["t_start_ns"]) / 1e9
