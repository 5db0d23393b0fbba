"""Gaze on areas of interest: recorded with where they stood, and measured from that alone."""

import numpy as np
import pandas as pd
import pytest
from PIL import Image as Files
from typer.testing import CliRunner

from tests.sessions import request_in
from visavis.analysis.gaze.aoi import LOST, NONE
from visavis.analysis.gaze.targets import GazeTargets
from visavis.cli.main import app
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DesignError
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.study.area_measures import GazeByArea, gaze_by_area, looks_at, transitions
from visavis.study.measures import TrialRecord

STUDY = """
from visavis import Compare, Factor, Image, Study, Text, dwell_on, looks_at, transitions

study = Study(
    "rooms", "S", factors=[Factor("side", ["left", "right"])], repetitions=2,
    measures=[*looks_at("door", "lamp"), *transitions("door", "lamp")],
    compare=[Compare("door_dwell_ms", within="side")],
)

@study.trial
def trial(t):
    yield t.show({"cross": Text("+")}, seconds=0.5, name="fixation")
    yield t.show(Image(f"{t.side}.png", width_deg=20, areas=f"{t.side}.yaml"), seconds=3)
"""
LEFT = """door: {rectangle: [50, 150, 150, 250], salience: 30}
lamp: {ellipse: [500, 100, 120, 120]}
"""
RIGHT = """door: {rectangle: [400, 150, 150, 250]}
lamp: {ellipse: [100, 100, 120, 120], salience: 30}
"""

ELSEWHERE = "door: {rectangle: [0, 0, 1, 1]}\nlamp: {rectangle: [5, 5, 1, 1]}\n"


def written(folder, study=STUDY):
    (folder / "rooms.py").write_text(study)
    for side, areas in (("left", LEFT), ("right", RIGHT)):
        Files.new("RGB", (640, 480), "grey").save(folder / f"{side}.png")
        (folder / f"{side}.yaml").write_text(areas)
    return find_study(str(folder / "rooms.py"))


def performed(folder, example):
    study = written(folder)
    request = request_in(folder, study, example)
    return study, perform_new(request)


@pytest.fixture(scope="module", params=[SCREEN_EXAMPLE, EXAMPLE], ids=["screen", "headset"])
def session(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rooms")
    study, path = performed(folder, request.param)
    # The analysis needs the recording alone: what the files say now does not count.
    for side in ("left", "right"):
        (folder / f"{side}.yaml").write_text(ELSEWHERE)
    return study.measure(Recording(path))


def test_areas_are_measured_by_name_from_the_recording_alone(session):
    rows = session.rows
    assert {"door_dwell_ms", "lamp_entries", "door_to_lamp", "lamp_to_door"} <= set(rows)
    assert rows["gaze_lost_01"].notna().all()
    assert (rows["door_dwell_ms"] + rows["lamp_dwell_ms"] <= 3010).all()
    assert (rows["door_entries"] >= rows["lamp_to_door"]).all()
    looked = rows["door_entries"] > 0
    assert (rows["door_first_look_ms"].notna() == looked).all()
    assert rows.loc[looked, "door_pupil_mm"].between(1.5, 9).all()
    assert rows.loc[looked, "door_first_look_ms"].between(0, 3000).all()


def test_simulated_people_look_at_what_is_salient_wherever_it_stands(session):
    rows = session.rows
    door, lamp = (rows.groupby("side")[f"{a}_dwell_ms"].sum() for a in ("door", "lamp"))
    assert door["left"] > lamp["left"]
    assert lamp["right"] > door["right"]


def gaze_of(area, names=("a", "b", "c")):
    """Return gaze that is on these areas, 10 ms each."""
    area = np.array(area, np.int16)
    n = len(area)
    samples = GazeTargets(
        t_ns=np.arange(n) * 10_000_000,
        valid=area != LOST,
        direction_world=np.zeros((n, 3)),
        angle_deg=np.zeros((n, 0)),
        radius_deg=np.zeros((n, 0)),
        pad_limit_deg=np.zeros((n, 0)),
        hit=area,
        pupil_mm=np.arange(n, dtype=float),
    )
    return GazeByArea(samples, area, names, (0, n * 10_000_000))


def values(measures_of, areas, gaze, monkeypatch):
    monkeypatch.setattr("visavis.study.area_measures.gaze_by_area", lambda record, **how: gaze)
    record = TrialRecord({}, None)
    return {m.column: m.of(record) for m in measures_of(*areas)}


def test_measures_of_an_area_count_what_came_to_it(monkeypatch):
    # 20 ms nowhere, 30 ms on a, 20 ms lost, 30 ms on a (bridged), 10 ms on b, 20 ms on a
    gaze = gaze_of([NONE] * 2 + [0] * 3 + [LOST] * 2 + [0] * 3 + [1] + [0] * 2)
    row = values(looks_at, ["a", "c", "d"], gaze, monkeypatch)
    assert row["a_dwell_ms"] == 80
    assert row["a_first_look_ms"] == 20
    assert row["a_entries"] == 2
    assert row["a_share_01"] == 80 / 110
    assert row["a_pupil_mm"] == np.mean([2, 3, 4, 7, 8, 9, 11, 12])
    assert (row["c_dwell_ms"], row["c_first_look_ms"], row["c_entries"]) == (0, None, 0)
    assert row["d_dwell_ms"] is None  # no such area was shown


def test_transitions_are_counted_between_the_areas_asked_for(monkeypatch):
    gaze = gaze_of([0, NONE, 1, 2, 0, 0, LOST, 1, NONE, 1])
    row = values(transitions, ["a", "b"], gaze, monkeypatch)
    assert row == {"a_to_b": 2, "b_to_a": 1}
    row = values(transitions, ["a", "b", "c"], gaze, monkeypatch)
    assert row == {"a_to_b": 2, "b_to_c": 1, "c_to_a": 1, "a_to_c": 0, "b_to_a": 0, "c_to_b": 0}


def test_without_usable_gaze_a_measure_is_missing(monkeypatch):
    row = values(looks_at, ["a"], gaze_of([LOST] * 5), monkeypatch)
    assert set(row.values()) == {None}


@pytest.mark.parametrize(
    ("line", "by", "says"),
    [
        (
            'looks_at("door", "lamp")',
            'looks_at("door", "lmp")',
            "no area or role 'lmp'; did you mean 'lamp'",
        ),
        ('"door", "lamp")', "", "transitions: name two areas"),
        ('"cross": Text("+")', '"cross": Text("+"), "cross ": Text("a")', "called 'cross '"),
        ("left.yaml", "", "there is no file of areas"),
        ('looks_at("door", "lamp")', 'dwell_on("door")', "measure gaze on it by looks_at.'door'"),
    ],
)
def test_a_wrong_name_is_told_before_anybody_takes_part(tmp_path, line, by, says):
    study = STUDY.replace(line, by)
    if line == '"door", "lamp")':
        study = STUDY.replace('transitions("door", "lamp")', 'transitions("door")')
    if by.startswith(("dwell", "*dwell")):
        study = STUDY.replace('*looks_at("door", "lamp")', by).replace("door_dwell", "dwell")
    if line == "left.yaml":
        study = STUDY.replace("{t.side}.yaml", "{t.side}.yml")
    with pytest.raises(DesignError, match=says):
        written(tmp_path, study).experiment({})


def test_where_there_is_no_area_at_all_the_message_ends_with_that(tmp_path):
    bare = STUDY.replace('yield t.show({"cross": Text("+")}', 'yield t.show(Text("+")').replace(
        ', areas=f"{t.side}.yaml"', ""
    )
    with pytest.raises(DesignError, match=r"no area or role 'door'; there are none$"):
        written(tmp_path, bare).experiment({})


def test_an_area_that_some_pictures_lack_is_named_at_plan_with_the_first_of_them(tmp_path):
    study = written(tmp_path)
    assert study.experiment({}).areas_in_part == ()
    (tmp_path / "right.yaml").write_text(RIGHT.replace("door", "dor"))
    (note,) = find_study(str(tmp_path / "rooms.py")).experiment({}).areas_in_part
    assert "1 of 2 conditions show no area 'door'" in note
    assert note.endswith("side right, practice False; did you mean 'dor'?")
    (tmp_path / "lab_config.yaml").write_text(SCREEN_EXAMPLE.read_text("utf-8"), "utf-8")
    words = ["plan", str(tmp_path / "rooms.py"), "--config", str(tmp_path / "lab_config.yaml")]
    assert note in CliRunner().invoke(app, words).output


def test_an_area_that_is_shown_as_something_else_than_is_measured_is_named_at_plan(tmp_path):
    unnamed = STUDY.replace(', name="fixation"', "")
    door, lamp = written(tmp_path, unnamed).experiment({}).areas_in_part
    assert door.startswith("2 of 2 conditions show the area 'door' as stimulus2, but its measures")
    assert "of stimulus, so that their trials have no value" in door
    assert "scene='stimulus2'" in lamp
    right = unnamed.replace('"lamp")', '"lamp", scene="stimulus2")')
    assert written(tmp_path, right).experiment({}).areas_in_part == ()


def test_people_in_a_scene_are_areas_by_their_role():
    targets = GazeTargets(
        t_ns=np.arange(4) * 10_000_000,
        valid=np.ones(4, bool),
        direction_world=np.zeros((4, 3)),
        angle_deg=np.array([[1.0, 30], [1, 30], [30, 1], [30, 30]]),
        radius_deg=np.full((4, 2), 3.0),
        pad_limit_deg=np.full((4, 2), 9.0),
        hit=np.array([0, 0, 1, -1]),
    )

    class Empty:
        def events_named(self, *of):
            return pd.DataFrame({"payload": []})

    row = {"recording_part": 1, "scene_on_ns": 0, "scene_off_ns": 40_000_000}
    row |= {"scene_frames": 4, "scene_left": 1, "scene_right": 0}
    gaze = gaze_by_area(TrialRecord(row, Empty(), targets), "scene", 0.0)
    assert gaze.names == ("left", "right")
    assert gaze.area.tolist() == [1, 1, 0, NONE]


def test_somebody_with_two_names_is_looked_at_under_both():
    n = 100
    targets = GazeTargets(
        t_ns=np.arange(n) * 10_000_000,
        valid=np.ones(n, np.bool_),
        direction_world=np.tile([0.0, 0.0, -1.0], (n, 1)),
        angle_deg=np.zeros((n, 1)),
        radius_deg=np.full((n, 1), 3.0),
        pad_limit_deg=np.full((n, 1), np.inf),
        hit=np.zeros(n, np.int16),
    )
    row = {"scene_on_ns": 0, "scene_off_ns": 10_000_000 * n, "scene_active": 0, "scene_left": 0}
    gaze = gaze_by_area(TrialRecord(row, None, targets), "scene", 0.0)
    assert 1000.0 == gaze.measures("active").dwell_ms == gaze.measures("left").dwell_ms
