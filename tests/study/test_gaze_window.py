"""A window that follows gaze: refused where it cannot be, timed in the row, seen again."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image as Files
from typer.testing import CliRunner

from tests.running.test_verifying import Killed
from tests.sessions import request_in
from tests.study.simulated_study import invoked, simulate_and_analyse
from visavis.analysis.session_check import check_session
from visavis.analysis.session_verdict import Level
from visavis.cli.main import app
from visavis.cli.redraw import redraw
from visavis.lab.clock import SimClock
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DesignError, SessionAborted
from visavis.lab.geometry import Pose, rotate
from visavis.people.person import StudyPerson
from visavis.recording.cached import CachedRecording
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.film_store import film_store
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.verification import verify
from visavis.stimuli.flat import Image
from visavis.stimuli.gaze_window import NO_WINDOW, GazeWindow, WindowPlace
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.audience import PARTICIPANT_EYE_M
from visavis.stimuli.scenes.flat import FlatScene
from visavis.study.dry_run import still_view
from visavis.study.gaze_window import WindowCourse

STUDY = """
from visavis import Compare, Factor, Image, Keys, Study, looks_at

study = Study("window", "S", factors=[Factor("seen", ["gaze", "around gaze"])],
              measures=[*looks_at("door")], compare=[Compare("door_dwell_ms", within="seen")])

@study.trial
def trial(t):
    yield t.show(Image("room.png", 20, areas="room.yaml"), 2, reveal=t.seen, window_deg=5,
                 background="grey")
    yield t.show(Image("room.png", 20), until=Keys("f", "j"), limit_s=1, reveal=t.seen,
                 blur_deg=0, name="asked")
"""


def opened(folder, text=STUDY):
    (folder / "window.py").write_text(text, "utf-8")
    (folder / "room.yaml").write_text("door: {rectangle: [0, 0, 200, 300]}\n", "utf-8")
    Files.new("RGB", (400, 300), (0, 200, 0)).save(folder / "room.png")
    return find_study(str(folder / "window.py"))


def request_of(folder, lab):
    keys = 'Keys("f", "j")', 'Keys("answer", ["trigger"])'
    study = opened(folder, STUDY if lab == SCREEN_EXAMPLE else STUDY.replace(*keys))
    about = request_in(folder, study, lab)
    return study, about


@pytest.fixture(scope="module", params=[SCREEN_EXAMPLE, EXAMPLE], ids=["screen", "headset"])
def session(request, tmp_path_factory):
    study, about = request_of(tmp_path_factory.mktemp("window"), request.param)
    return study, CachedRecording(perform_new(about))


def test_the_loops_delay_is_in_the_row_and_in_the_stream(session):
    _, recording = session
    rows = recording.trials()
    windows = recording.stream_arrays("gaze_window")
    frame_ms = 1000 / 60
    assert (windows["valid"] == (windows["t_sample_ns"] >= 0)).all()
    assert (windows["valid"] == np.isfinite(windows["delay_ms"])).all()
    for row in rows.to_dict("records"):
        for name in ("stimulus", "asked"):
            here = (windows["t_host_ns"] > row[f"{name}_on_ns"]) & windows["valid"]
            here &= windows["t_host_ns"] < row[f"{name}_off_ns"]
            delay_ms = windows["delay_ms"][here]
            since_ms = (windows["t_host_ns"] - windows["t_sample_ns"])[here] / 1e6
            assert delay_ms == pytest.approx(since_ms, abs=1e-3)
            median_ms = row[f"{name}_window_delay_ms"]
            assert median_ms == pytest.approx(float(np.median(delay_ms)), abs=1)
            assert 0 < median_ms <= row[f"{name}_window_delay_p95_ms"] < 12 * frame_ms
            assert 0 <= row[f"{name}_window_lost_frames"] < row[f"{name}_frames"]


def test_the_window_is_where_the_newest_gaze_was(session):
    _, recording = session
    windows, gaze = (recording.stream_arrays(name) for name in ("gaze_window", "gaze_targets"))
    samples = {int(t): i for i, t in enumerate(gaze["t_sample_ns"])}
    rows = [samples[int(t)] for t in windows["t_sample_ns"][windows["valid"]]]
    for name in ("direction_world", "origin_world_m"):
        assert (windows[name][windows["valid"]] == gaze[name][rows]).all()


def test_a_frame_is_drawn_again_with_its_window(session):
    study, recording = session
    windows, frames = (recording.stream_arrays(name) for name in ("gaze_window", "frames"))
    greens = {}
    for row in recording.trials().to_dict("records"):
        here = (windows["t_host_ns"] > row["asked_on_ns"]) & windows["valid"]
        drawn_ns = int(
            windows["t_drawn_ns"][here & (windows["t_host_ns"] < row["asked_off_ns"])][0]
        )
        frame = int(frames["frame_index"][np.flatnonzero(frames["t_host_ns"] == drawn_ns)[0]])
        image = redraw(study, recording, frame)[0].astype(int)
        greens[row["seen"]] = int((image[..., 1] - image[..., 0] > 100).sum())
    assert 0 < greens["gaze"] < greens["around gaze"]


def view_of(t_ns, samples):
    """Return a frame with samples of gaze: their times, which are usable, and how far right."""
    view = still_view(t_ns)
    times, valid, right = (np.array(v) for v in zip(*samples, strict=True)) if samples else [()] * 3
    direction = np.zeros((len(samples), 3))
    if samples:
        direction[:, 0] = right
    gaze = view.gaze._replace(
        t_ns=np.asarray(times, np.int64),
        valid=np.asarray(valid, bool),
        direction_world=direction,
        origin_world_m=np.zeros((len(samples), 3)),
    )
    return view._replace(gaze=gaze)


@pytest.mark.parametrize(
    ("delay_ms", "level", "says"),
    [
        (None, Level.GREEN, "ms behind gaze in the median"),
        (90.0, Level.AMBER, "more than 60 ms is noticed"),
        (np.nan, Level.RED, "never followed gaze"),
    ],
)
def test_a_check_says_how_late_windows_were(session, monkeypatch, delay_ms, level, says):
    _, recording = session
    arrays_of = CachedRecording.stream_arrays

    def stream_arrays(self, name, **limits):
        arrays = arrays_of(self, name, **limits)
        if name == "gaze_window" and delay_ms is not None:
            arrays = {**arrays, "delay_ms": np.full(len(arrays["delay_ms"]), delay_ms)}
        return arrays

    monkeypatch.setattr(CachedRecording, "stream_arrays", stream_arrays)
    findings = check_session(recording).findings
    (finding,) = (f for f in findings if f.subject == "gaze window")
    assert finding.level is level
    assert says in finding.message
    assert not [f for f in findings if f.subject == "gaze_window"]  # its rows come by change


def test_a_session_that_was_killed_goes_on_and_is_the_same_again_bit_for_bit(tmp_path):
    study, about = request_of(tmp_path, SCREEN_EXAMPLE)
    with pytest.raises(SessionAborted):
        perform_new(replace(about, operator=Killed(2900)))
    path = next((tmp_path / "data").glob("simulated/window/sub-*/ses-001"))
    recording = Recording(perform_rest(replace(about, clock=SimClock()), path))
    assert len(recording.manifest.parts) == 2
    assert len(recording.stream_arrays("gaze_window", part=1)["seq"]) > 0
    assert (recording.trials()["status"] == "complete").sum() == 2
    verdict = verify(recording, study, about.config, tmp_path / "again")
    assert verdict.first is None
    assert verdict.row_counts["gaze_window"] > 100


@pytest.mark.timeout(900)
def test_a_study_goes_from_plan_to_its_table(tmp_path):
    opened(tmp_path)
    (tmp_path / "lab_config.yaml").write_text(SCREEN_EXAMPLE.read_text("utf-8"), "utf-8")
    config = str(tmp_path / "lab_config.yaml")
    assert "around gaze" in invoked("plan", str(tmp_path / "window.py"), "--config", config)
    folder = simulate_and_analyse(tmp_path / "window.py", STUDY, participants=2)
    rows = pd.read_csv(folder / "derived" / "trials.csv")
    assert rows["stimulus_window_delay_ms"].between(1, 100).all()
    assert (rows["door_dwell_ms"] >= 0).all()
    about = json.loads((folder / "derived" / "trials.json").read_text("utf-8"))
    assert about["asked_window_delay_p95_ms"]["Units"] == "ms"
    assert "in which all was covered" in about["asked_window_lost_frames"]["Description"]


MS = 1_000_000


def test_it_follows_the_newest_usable_sample_and_stays_over_a_short_loss():
    course = WindowCourse()
    assert course.take(view_of(0, [])) is NO_WINDOW
    place = course.take(view_of(20 * MS, [(10 * MS, True, 0.1), (8 * MS, True, 0.5)]))
    assert (10 * MS, pytest.approx(0.1)) == (place.t_sample_ns, place.direction[0])
    assert course.take(view_of(40 * MS, [(30 * MS, False, 0.9)])) is place
    assert course.take(view_of(90 * MS, [])) is place
    assert course.take(view_of(100 * MS, [(90 * MS, False, 0.9)])) is NO_WINDOW
    assert course.take(view_of(120 * MS, [(110 * MS, True, 0.3)])) is not NO_WINDOW
    # lit with the frame after the one that brought the sample
    assert course.columns("a") == {
        "a_window_delay_ms": 30.0,
        "a_window_delay_p95_ms": 30.0,
        "a_window_lost_frames": 2,
    }


def test_without_gaze_the_delay_is_missing_never_zero():
    course = WindowCourse()
    course.take(view_of(0, []))
    assert course.columns("a")["a_window_delay_ms"] is None


def share_at_lamp(folder, window, place):
    """Return how much of five seconds a person's eyes are on a lamp of 2 degrees, 8 to the right
    and 3 up in a picture, that attracts ten times as much as all else.
    """
    Files.new("RGB", (400, 300)).save(folder / "dark.png")
    (folder / "dark.yaml").write_text("lamp: {ellipse: [360, 90, 40, 40], salience: 5}\n")
    image = Image("dark.png", 20, areas="dark.yaml")
    head = Pose(PARTICIPANT_EYE_M, np.array([1.0, 0.0, 0.0, 0.0]))
    scene = FlatScene("flat", (), items=(image,), folder=folder, head=head, gaze_window=window)
    person = StudyPerson(0, 1, responses={})
    person.prepare(1, 0)
    frame = SceneFrame(scene, 0, np.zeros((0, 3)), np.zeros(0), window_at=place)
    person.see(frame, 0)
    eyes, heads_m, turns = person.sense(np.arange(0, 5_000, 10) * MS)
    ahead = eyes["left_direction_head"]
    towards = np.array([rotate(q, v) for q, v in zip(turns, ahead, strict=True)])
    lamp = PARTICIPANT_EYE_M + 2 * LAMP.direction - heads_m
    cosine = (towards * lamp).sum(axis=1) / np.linalg.norm(lamp, axis=1)
    return float((cosine > np.cos(np.radians(3))).mean())


LAMP = WindowPlace.of(0, PARTICIPANT_EYE_M, [0.138, 0.052, -0.989])


@pytest.mark.parametrize(
    ("window", "place", "is_found"),
    [
        (None, None, True),
        (GazeWindow(3.0), NO_WINDOW, False),
        (GazeWindow(3.0), LAMP, True),
        (GazeWindow(3.0), WindowPlace.of(0, PARTICIPANT_EYE_M, [-0.1, 0, -0.995]), False),
        (GazeWindow(3.0, blur_deg=2.0), NO_WINDOW, False),
        (GazeWindow(3.0, blur_deg=0.4), NO_WINDOW, True),
        (GazeWindow(3.0, is_around=True), NO_WINDOW, True),
    ],
)
def test_simulated_people_find_an_area_only_once_the_window_has_come_to_it(
    tmp_path, window, place, is_found
):
    share_01 = share_at_lamp(tmp_path, window, place)
    assert is_found == (share_01 > 0.25)


@pytest.mark.parametrize(
    ("line", "by", "says"),
    [
        ("reveal=t.seen, window", 'reveal="gase", window', "reveal is 'gase'; did you mean 'gaze'"),
        ("window_deg=5", "window_deg=0", "window_deg is 0; from 0.1"),
        ("window_deg=5", "window_deg=5, edge_deg=6", "edge_deg is 6; from 0 to 5, window_deg"),
        ("window_deg=5", "window_deg=5, blur_deg=-1", "blur_deg is -1; from 0"),
        ('Image("room.png", 20, areas="room.yaml")', 'Scene("person")', "reveal is for pictures"),
        ("reveal=t.seen, window", 'reveal="pointer", edge_deg=1, window', "has a sharp edge"),
    ],
)
def test_a_window_that_cannot_be_is_told_before(tmp_path, line, by, says):
    text = STUDY.replace("Keys, ", "Keys, Scene, ").replace(line, by, 1)
    with pytest.raises(DesignError, match=says):
        opened(tmp_path, text).experiment({}).read  # noqa: B018 - reads the trials


def test_there_is_none_on_a_page_and_none_without_an_eye_tracker(tmp_path):
    measured = 'measures=[*looks_at("door")], compare=[Compare("door_dwell_ms", within="seen")]'
    by_itself = STUDY.replace(measured, "calibrate=False")
    experiment = opened(tmp_path, by_itself).experiment({})
    with pytest.raises(DesignError, match='follow the pointer: reveal="pointer"'):
        film_store(experiment)
    assert "eye_tracker" in experiment.needed_roles
    assert experiment.has_gaze_windows
    lab = yaml.safe_load(SCREEN_EXAMPLE.read_text("utf-8"))
    del lab["devices"]["eye_tracker"]
    (tmp_path / "lab_config.yaml").write_text(yaml.safe_dump(lab), "utf-8")
    words = ["plan", str(tmp_path / "window.py"), "--config", str(tmp_path / "lab_config.yaml")]
    assert "eye_tracker" in str(CliRunner().invoke(app, words).exception)


def test_a_window_around_gaze_covers_and_one_at_gaze_blurs(tmp_path):
    reads = opened(tmp_path).experiment({}).read.values()
    windows = [scene.options["gaze_window"] for read in reads for scene in read.scenes]
    assert windows == [
        GazeWindow(5.0, 0.0, 0.625),
        GazeWindow(4.0),
        GazeWindow(5.0, is_around=True),
        GazeWindow(4.0, is_around=True),
    ]
