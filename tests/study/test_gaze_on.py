"""Gaze ends a step: after a look that is long enough, with its delay in the row."""

import pytest

from tests.sessions import request_in
from visavis.analysis.gaze.aoi import LOST
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DesignError
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.study.area_measures import gaze_by_area
from visavis.study.gaze_on import GazeOn, GazeWatch, gaze_on
from visavis.study.measures import SessionGaze, TrialRecord

STUDY = """
from visavis import Factor, Shape, Scene, Study, Text, gaze_on

study = Study("waits", "S", factors=[Factor("side", [-6, 6])], repetitions=2)

@study.trial
def trial(t):
    yield t.show({"cross": Text("+")}, 8, until=gaze_on("cross", 0.3))
    yield t.show({"spot": Shape("ellipse", 2, at_deg=(t.side, 0))}, 8,
                 until=gaze_on("spot", 0.2, pad_deg=2), name="spot")
    yield t.show(Scene("person"), 4, until=gaze_on("active", 0.2))
    yield t.show({"cross": Text("+")}, 0.3, until=gaze_on("cross", 0.5), name="late")
"""


def opened(folder, study=STUDY):
    (folder / "waits.py").write_text(study)
    return find_study(str(folder / "waits.py"))


@pytest.fixture(scope="module", params=[SCREEN_EXAMPLE, EXAMPLE], ids=["screen", "headset"])
def recording(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("waits")
    study = opened(folder)
    about = request_in(folder, study, request.param)
    return Recording(perform_new(about))


def test_gaze_ends_what_is_shown_and_its_delay_is_in_the_row(recording):
    rows = recording.trials()
    frame_ms = 1000 / 60
    for name, seconds in (("stimulus", 0.3), ("spot", 0.2)):
        lasted_ms = (rows[f"{name}_off_ns"] - rows[f"{name}_on_ns"]) / 1e6
        looked_ms = (rows[f"{name}_off_ns"] - rows[f"{name}_gaze_on_ns"]) / 1e6
        delay_ms = rows[f"{name}_gaze_delay_ms"]
        assert rows[f"{name}_gaze_on_ns"].notna().all()
        assert (lasted_ms < 8000).all()
        # a look is over with the first sample that makes it long enough: one step of the tracker
        assert (looked_ms - delay_ms).between(1000 * seconds, 1000 * seconds + 2 * frame_ms).all()
        assert delay_ms.between(0, 200).all()
    assert rows["scene_gaze_on_ns"].notna().any()


def test_a_look_that_was_too_short_leaves_the_time_and_is_missing(recording):
    rows = recording.trials()
    assert rows["late_gaze_delay_ms"].isna().all()
    lasted_ms = (rows["late_off_ns"] - rows["late_on_ns"]) / 1e6
    assert lasted_ms.to_numpy() == pytest.approx(300, abs=20)


def test_the_recorded_gaze_says_the_same_as_what_ended_the_step(recording):
    gaze = SessionGaze(recording)
    for row in recording.trials().to_dict("records"):
        record = TrialRecord(row, recording, gaze.of_part(1).targets)
        on = gaze_by_area(record, "spot", 2.0)
        here = on.samples.t_ns >= row["spot_gaze_on_ns"]
        until = on.samples.t_ns <= row["spot_gaze_on_ns"] + 200_000_000
        assert set(on.area[here & until].tolist()) <= {0, LOST}


def watched(samples):
    """Return what gaze of 20 ms a sample comes to: 1 on the area, 0 elsewhere, LOST."""
    watch = GazeWatch(GazeOn("a", 0.1), (), None, 40_000_000)
    for i, on in enumerate(samples):
        watch._take(i * 20_000_000, on)
    return watch


def test_a_look_begins_at_the_onset_and_a_short_loss_does_not_end_it():
    watch = watched([1, 1, 1, 1, LOST, LOST, 1, 1, 1, 1])
    assert watch.columns("x", 150_000_000) == {"x_gaze_on_ns": 40_000_000, "x_gaze_delay_ms": 10.0}


@pytest.mark.parametrize("between", [[0], [LOST] * 4])
def test_a_sample_elsewhere_or_a_long_loss_begins_a_look_anew(between):
    watch = watched([0, 0, 1, 1, *between, 1, 1, 1, 1, 1, 1])
    assert watch.columns("x", 10**9)["x_gaze_on_ns"] == (4 + len(between)) * 20_000_000
    assert watched([0, 0, 1, 1, *between, 1, 1]).met_ns is None


@pytest.mark.parametrize(
    ("line", "by", "says"),
    [
        ('gaze_on("cross", 0.3)', 'gaze_on("cros", 0.3)', "line 8.*role 'cros'; did you mean 'cro"),
        ('gaze_on("active", 0.2)', 'gaze_on("cross", 0.2)', "no area or role 'cross'; known: act"),
        ("8, until=gaze_on", "until=gaze_on", "say how long"),
        ('{"cross": Text("+")}, 8', 'Text("+"), 8', "nothing that is shown has a name"),
        ('gaze_on("cross", 0.3)', 'gaze_on("cross", 0)', "seconds is 0; above 0"),
    ],
)
def test_gaze_that_cannot_be_waited_for_is_told_before(tmp_path, line, by, says):
    with pytest.raises(DesignError, match=says):
        opened(tmp_path, STUDY.replace(line, by, 1)).experiment({})


def test_a_study_that_waits_for_gaze_needs_an_eye_tracker(tmp_path):
    experiment = opened(tmp_path, STUDY.replace("repetitions=2", "calibrate=False")).experiment({})
    assert "eye_tracker" in experiment.needed_roles
    assert "eye_tracker" not in experiment.spare_roles
    assert experiment.rests_on_gaze
    assert gaze_on("a", 1) == GazeOn("a", 1.0, 1.0)
