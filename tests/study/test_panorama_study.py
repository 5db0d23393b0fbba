"""A panorama in a study: looked at all around, measured from the recording, drawn again."""

import numpy as np
import pytest
from PIL import Image as Files

from tests.sessions import request_in
from visavis.cli.redraw import redraw
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.stimuli.areas import SurroundingAreas, areas_text
from visavis.stimuli.view_turns import VIEW_TURNED
from visavis.study.area_measures import view_range
from visavis.study.measures import TrialRecord

STUDY = """
from visavis import Factor, Keys, Panorama, Shape, Study, gaze_on, looks_at, view_range

study = Study(
    "around", "S", factors=[Factor("side", [0, 180])], repetitions=2,
    measures=[*looks_at("door", "lamp", pad_deg=1), view_range()],
)

@study.trial
def trial(t):
    yield t.show(Panorama("a.png", yaw_deg=t.side, areas="a.yaml"), seconds=9)
"""
SHOWN = STUDY[STUDY.index("yield") :].strip()
AREAS = """door: {rectangle: [-15, 15, 30, 30]}
lamp: {ellipse: [180, 0, 30, 30]}
"""

ELSEWHERE = "door: {rectangle: [90, 80, 1, 1]}\nlamp: {rectangle: [90, -80, 1, 1]}\n"

AROUND_TEXT = areas_text(
    [SurroundingAreas(Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), 0.0, (2048, 1024), ())]
)


def written(folder, text=STUDY):
    (folder / "around.py").write_text(text)
    pixels = np.full((1024, 2048, 3), 60, np.uint8)
    pixels[:, 512:1536] = 180  # the half that is ahead is bright
    Files.fromarray(pixels).save(folder / "a.png")
    (folder / "a.yaml").write_text(AREAS)
    return find_study(str(folder / "around.py"))


def performed(folder, study, example):
    about = request_in(folder, study, example)
    return CachedRecording(perform_new(about))


@pytest.fixture(scope="module", params=[SCREEN_EXAMPLE, EXAMPLE], ids=["screen", "headset"])
def session(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("around")
    study = written(folder)
    recording = performed(folder, study, request.param)
    # The analysis needs the recording alone: what the file says now does not count.
    (folder / "a.yaml").write_text(ELSEWHERE)
    return study, recording, study.measure(recording).rows, request.param == SCREEN_EXAMPLE


def test_people_look_around_and_are_measured_from_the_recording_alone(session):
    _, recording, rows, is_screen = session
    assert (rows["door_dwell_ms"] + rows["lamp_dwell_ms"] <= 9010).all()
    assert rows["door_dwell_ms"].sum() > 0
    assert rows["lamp_dwell_ms"].sum() > 0
    assert rows["view_range_deg"].between(5, 360).all()
    turned = recording.events_named(VIEW_TURNED, 1)["payload"]
    assert is_screen == (len(turned) > 0)


def test_what_is_straight_ahead_at_first_is_looked_at_first(session):
    first = session[2].groupby("side")[["door_first_look_ms", "lamp_first_look_ms"]].min()
    assert first.loc[0, "door_first_look_ms"] < 1000
    assert first.loc[180, "lamp_first_look_ms"] < 1000


def test_a_frame_is_drawn_again_as_the_view_was_turned(session):
    study, recording, rows, is_screen = session
    if not is_screen:
        pytest.skip("in a headset the head turns, not the view")
    frames = recording.stream_arrays("frames", part=1)
    turned = list(recording.events_named(VIEW_TURNED, 1)["payload"])
    seen = set()
    for row in rows.to_dict("records"):
        mine = [p for p in turned if p["trial_id"] == row["trial_id"]]
        goals_deg = [0.0, *(p["to_yaw_deg"] for p in mine)]
        since_ns = [int(row["stimulus_on_ns"]), *(p["changed_ns"] for p in mine)]
        until_ns = [*since_ns[1:], int(row["stimulus_off_ns"])]
        for goal_deg, begin_ns, end_ns in zip(goals_deg, since_ns, until_ns, strict=True):
            ahead_deg = (row["side"] + goal_deg + 180) % 360 - 180
            if end_ns - begin_ns < 1_500_000_000 or abs(abs(ahead_deg) - 90) < 1:
                continue  # not there yet, or the edge of the bright half
            frame = np.searchsorted(frames["t_host_ns"], end_ns - 50_000_000)
            image, _ = redraw(study, recording, int(frames["frame_index"][frame]))
            expected = 180 if abs(ahead_deg) < 90 else 60
            seen.add(expected)
            assert expected == int(image[image.shape[0] // 2, image.shape[1] // 4, 0])
    assert {60, 180} == seen


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (
            'yield t.show(Panorama("a.png"), until=Keys("left", "f"))',
            "left: arrow keys turn the view .* by other keys",
        ),
        (
            'yield t.show(Panorama("a.png"), 2)\n    yield t.key(Keys("up", "f"))',
            "up: arrow keys turn the view",
        ),
        ('yield t.show([Panorama("a.png")] * 2, 1)', "two panoramas cannot be around somebody"),
        ('yield t.show(Panorama("b.png"), 1)', "there is no picture .*b.png"),
        (
            'yield t.show({"door": Shape("cross"), "view": Panorama("a.png", areas="a.yaml")}, 1)',
            "two areas that are shown together are called 'door'",
        ),
        (
            'yield t.show(Panorama("a.png", areas="a.yaml"), 1, until=gaze_on("dor", 1))',
            "no area or role 'dor'; did you mean 'door'",
        ),
    ],
)
def test_what_cannot_be_is_refused_when_the_study_is_read(tmp_path, line, says):
    study = written(tmp_path, STUDY.replace(SHOWN, line))
    with pytest.raises(DesignError, match=says):
        study.experiment({})


def test_how_much_was_straight_ahead_is_missing_without_a_recording():
    shown = {"trial_id": "T01", "name": "stimulus", "start_ns": 0, "areas": AROUND_TEXT}
    row = {"trial_id": "T01", "stimulus_on_ns": 0, "stimulus_off_ns": 10}
    assert view_range().of(TrialRecord(row, None, events=(("shown", shown),))) is None


def test_gaze_at_an_area_around_ends_what_is_shown(tmp_path):
    line = 'yield t.show(Panorama("a.png", areas="a.yaml"), 20, until=gaze_on("lamp", 0.2))'
    study = written(tmp_path, STUDY.replace(SHOWN, line))
    rows = study.measure(performed(tmp_path, study, SCREEN_EXAMPLE)).rows
    met = rows[rows["stimulus_gaze_on_ns"].notna()]
    assert len(met)
    # gaze while it is shown and gaze in the recording find the same moment
    first_ms = (met["stimulus_gaze_on_ns"] - met["stimulus_on_ns"]) / 1e6
    assert met["lamp_first_look_ms"].to_numpy() == pytest.approx(first_ms.to_numpy(), abs=0.1)
