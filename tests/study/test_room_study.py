"""A laboratory's own room in a study: shown, looked at, measured by the recording, drawn again."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.sessions import request_in
from tests.stimuli.glb_room import ROOM, Box, write_room
from tests.study.simulated_study import invoked, quick_targets
from visavis.cli.redraw import redraw
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DataError, DesignError
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import find_study
from visavis.results.reevaluation import targets_again
from visavis.running.film_store import film_store
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.recorded_design import changes_since, design_of, in_words
from visavis.stimuli.room_areas import ROOM_SHAPE
from visavis.study.files_read import digests_of_files

STUDY = """
from visavis import Compare, Factor, Room, Scene, Study, gaze_on, looks_at, transitions

study = Study(
    "rooms", "S", factors=[Factor("who", ["nobody", "somebody"])], repetitions=2, CALIBRATE
    compare=[Compare("Red_lamp_001_dwell_ms", within="who")],
    measures=[
        *looks_at("Red_lamp_001", "cupboard", scene="scene"),
        *looks_at("person", scene="scene", prefix="their_"),
        *transitions("Red_lamp_001", "cupboard", scene="scene"),
    ],
)

@study.trial
def trial(t):
    OFFICE = Room("office.glb")
    LINES
"""
SHOWN = """if t.who == "nobody":
        yield t.show(OFFICE, seconds=6)
    else:
        yield t.show(Scene("person", room=OFFICE, distance_m=3.4), seconds=6)"""


def written(folder, lines=SHOWN, boxes=ROOM, *, calibrate=True):
    text = STUDY.replace("LINES", lines).replace("CALIBRATE", f"calibrate={calibrate},")
    if "Scene(" not in lines:
        text = "\n".join(line for line in text.split("\n") if '"person"' not in line)
    (folder / "rooms.py").write_text(text)
    write_room(folder / "office.glb", boxes)
    return find_study(str(folder / "rooms.py"))


def performed(folder, study, example, show="none"):
    return CachedRecording(perform_new(request_in(folder, study, example, show)))


@pytest.fixture(scope="module", params=[SCREEN_EXAMPLE, EXAMPLE], ids=["screen", "headset"])
def session(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rooms")
    study = written(folder)
    recording = performed(folder, study, request.param)
    # Measures need the recording alone: what the file holds now does not count.
    write_room(folder / "office.glb", [replace(box, at_m=(0, 0, 50)) for box in ROOM])
    rows = study.measure(recording).rows
    write_room(folder / "office.glb")
    return study, recording, rows


def test_simulated_people_look_at_things_and_are_measured_from_the_recording_alone(session):
    _, recording, rows = session
    assert 4 == len(rows)
    looked_ms = rows["Red_lamp_001_dwell_ms"] + rows["cupboard_dwell_ms"]
    assert looked_ms.max() > 500
    assert (looked_ms <= 6010).all()
    assert (rows["Red_lamp_001_entries"] >= rows["Red_lamp_001_to_cupboard"] - 1).all()
    assert rows["Red_lamp_001_first_look_ms"].min() < 6000
    theirs = rows.groupby("who")["their_person_dwell_ms"]
    assert theirs.get_group("nobody").isna().all()
    assert theirs.get_group("somebody").sum() > 0
    assert 1 == len(recording.events_named(ROOM_SHAPE, 1))


def test_gaze_at_a_head_behind_a_cupboard_is_on_the_cupboard_and_is_evaluated_again_so(tmp_path):
    person = 'Scene("person", room=OFFICE, distance_m=3.4, bearing_deg=BEARING)'
    dwell_ms = {}
    for bearing_deg in (8.5, -2.0):  # behind the cupboard, and beside it
        folder = tmp_path / f"{bearing_deg:g}"
        folder.mkdir()
        line = f"yield t.show({person.replace('BEARING', str(bearing_deg))}, seconds=6)"
        study = written(folder, line)
        recording = performed(folder, study, EXAMPLE)
        rows = study.measure(recording).rows
        dwell_ms[bearing_deg] = rows["their_person_dwell_ms"].sum()
        targets = recording.stream_arrays("gaze_targets")
        again = targets_again(recording, study.views_of, 1)
        assert targets["hit"].tolist() == again["hit"].tolist()
        assert targets["pad_limit_deg"] == pytest.approx(again["pad_limit_deg"], nan_ok=True)
    assert dwell_ms[8.5] == 0 < dwell_ms[-2.0]


def test_the_hash_of_the_room_is_recorded_and_locked(session):
    study, recording, _ = session
    digests = digests_of_files(study.experiment({}))
    shown = recording.events_named("shown", 1)["payload"]
    assert all(digests["office.glb"] in p["areas"] for p in shown)


def test_a_frame_is_drawn_again_in_the_room_and_only_in_the_one_that_was_shown(session):
    study, recording, rows = session
    frames = recording.stream_arrays("frames", part=1)
    folder = study.study.files.folder
    for row in rows.to_dict("records"):
        k = np.searchsorted(frames["t_host_ns"], row["scene_on_ns"] + 3e9)
        image, _ = redraw(study, recording, int(frames["frame_index"][k]))
        red, green, blue = (image[..., c].astype(int) for c in range(3))
        assert ((red > 2 * green) & (red > 2 * blue) & (red > 60)).mean() > 0.005  # the lamp
        assert ((blue > 2 * red) & (blue > 60)).mean() > 0.005  # the cupboard
    write_room(folder / "office.glb", ROOM[:2])
    with pytest.raises(DataError, match=r"office\.glb is not the room that .* showed"):
        redraw(study, recording, int(frames["frame_index"][k]))
    write_room(folder / "office.glb")


@pytest.mark.parametrize("example", [SCREEN_EXAMPLE, EXAMPLE], ids=["screen", "headset"])
def test_a_frame_that_was_drawn_in_the_session_is_drawn_again_alike(tmp_path, example):
    study = written(tmp_path, "yield t.show(OFFICE, 0.3)", calibrate=False)
    recording = performed(tmp_path, study, example, "offscreen")
    drawn = recording.stream_arrays("drawn", part=1)
    lit = np.flatnonzero(drawn["drawn"] & (drawn["brightness_01"] == 1.0))
    assert len(lit)
    frame = int(drawn["frame"][lit[-1]])
    image = redraw(study, recording, frame)[0]  # refuses what is not exactly what was shown
    red, green, blue = (image[..., c].astype(int) for c in range(3))
    assert ((red > 2 * green) & (red > 2 * blue) & (red > 60)).mean() > 0.005


@pytest.mark.parametrize("display", [("--screen",), ()], ids=["screen", "headset"])
def test_a_study_in_a_room_goes_from_plan_to_report(tmp_path, monkeypatch, display):
    monkeypatch.chdir(tmp_path)
    invoked("init", *display)
    written(tmp_path)
    assert "somebody" in invoked("plan", "rooms.py")
    with quick_targets():
        invoked("simulate", "rooms.py", "--participants", "4", "--output", "out", "--processes=1")
    folder = tmp_path / "out" / "simulated" / "rooms"
    invoked("analyse", str(folder), "--processes=1")
    rows = pd.read_csv(folder / "derived" / "trials.csv").query("status == 'complete'")
    assert 16 == len(rows)
    assert (rows[["Red_lamp_001_dwell_ms", "cupboard_dwell_ms"]].sum() > 0).all()
    findings = pd.read_csv(folder / "derived" / "statistics.csv")
    assert {"Red_lamp_001_dwell_ms"} == set(findings["measure"])
    assert "Dwell time on Red lamp 001" in next(folder.rglob("report.html")).read_text("utf-8")


def test_gaze_at_a_thing_ends_what_is_shown(tmp_path):
    line = (
        'yield t.show(Scene("person", room=OFFICE), 20, until=gaze_on("cupboard", 0.2, pad_deg=0))'
    )
    study = written(tmp_path, line)
    rows = study.measure(performed(tmp_path, study, EXAMPLE)).rows
    met = rows[rows["scene_gaze_on_ns"].notna()]
    assert len(met)
    first_ms = (met["scene_gaze_on_ns"] - met["scene_on_ns"]) / 1e6
    assert met["cupboard_first_look_ms"].to_numpy() == pytest.approx(first_ms.to_numpy(), abs=0.1)


@pytest.mark.parametrize(
    ("lines", "boxes", "says"),
    [
        ('yield t.show(Room("ofice.glb"), 1)', ROOM, r"ofice\.glb; did you mean 'office\.glb'"),
        ("yield t.show(OFFICE, 1)", (ROOM[0], ROOM[0]), "two meshes called 'floor'"),
        ("yield t.show(OFFICE)", ROOM, "say how long"),
        ('yield t.show(Scene("office.glb"), 1)', ROOM, r"show Room\('office\.glb'\)"),
        ('yield t.show(Scene("person", room="office.glb"), 1)', ROOM, r"write room=Room\('office"),
        (
            'yield t.show(Scene("person", room=OFFICE), 1)',
            (*ROOM, Box("person", (2, 1, -2), (0.2, 0.2, 0.2))),
            "a mesh is called 'person', like a role or place of scene person",
        ),
        (
            'yield t.show(OFFICE, 1, until=gaze_on("cupbord", 1))',
            ROOM,
            "no area or role 'cupbord'; did you mean 'cupboard'",
        ),
    ],
)
def test_what_cannot_be_is_refused_when_the_study_is_read(tmp_path, lines, boxes, says):
    study = written(tmp_path, lines, boxes)
    with pytest.raises(DesignError, match=says):
        study.experiment({})


@pytest.mark.parametrize(
    "other", ["'flat.glb'", "'office.glb', (0, 0, -1)", "'office.glb', yaw_deg=90"]
)
def test_another_room_or_place_in_it_is_another_design(tmp_path, other):
    write_room(tmp_path / "flat.glb")
    shown = 'yield t.show(Scene("person", room=Room(ROOM), distance_m=3.4), seconds=6)'
    first, now = (
        design_of(written(tmp_path, shown.replace("ROOM", room)).experiment({}))
        for room in ("'office.glb'", other)
    )
    assert in_words(changes_since(first, now)).startswith("scene person: room office.glb, 0, 0, 0")


def test_a_page_refuses_a_room_by_name_with_the_way_out(tmp_path):
    study = written(tmp_path)
    with pytest.raises(DesignError, match=r"shows a Room, which no page shows; .* monitor"):
        film_store(study.experiment({}))


def test_a_film_in_a_room_is_watched_before_a_monitor_and_refused_by_pages(tmp_path):
    watched = 'yield t.watch(Film(Scene("person", room=OFFICE, distance_m=3.4), 4.0))'
    written(tmp_path, watched, calibrate=False)
    text = (tmp_path / "rooms.py").read_text().replace('"scene"', '"film"')
    (tmp_path / "rooms.py").write_text(text.replace("import Compare", "import Compare, Film"))
    study = find_study(str(tmp_path / "rooms.py"))
    recording = performed(tmp_path, study, SCREEN_EXAMPLE)
    rows = study.measure(recording).rows
    assert (rows["Red_lamp_001_dwell_ms"] + rows["their_person_dwell_ms"]).max() > 100
    shown = recording.events_named("shown", 1)["payload"]
    assert {"film"} == {payload["name"] for payload in shown}
    with pytest.raises(DesignError, match="shows a Room, which no page shows"):
        film_store(study.experiment({}))
