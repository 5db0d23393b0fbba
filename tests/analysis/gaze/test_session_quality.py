"""The page on a session's gaze, of sessions performed by a simulated participant."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.sessions import perform
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.session_page import headline_facts, session_page
from visavis.analysis.gaze.session_quality import SessionQuality, session_quality
from visavis.analysis.report import render_page
from visavis.lab.errors import DataError
from visavis.recording.reader import Recording


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return perform("duel", tmp_path_factory.mktemp("quality"), repetitions=1, practice=1)


@pytest.fixture(scope="module")
def quality(recording: Recording) -> SessionQuality:
    return session_quality(recording)


def test_accuracy_and_precision_are_those_of_the_recorded_validations(recording, quality):
    events = recording.events()
    recorded = list(events.loc[events["name"] == "validation", "payload"])
    assert [v["accuracy_deg"] for v in recorded] == [v.accuracy_deg for v in quality.validations]
    stds = [p["std_deg"] for p in recorded[0]["points"] if p["eye"] == "combined"]
    assert np.mean(stds) == pytest.approx(quality.validations[0].std_deg)
    assert ["block_start", "end"] == [v.moment for v in quality.validations]


def test_loss_and_effective_rate_make_the_stated_rate(quality):
    assert ["combined", "left", "right"] == [e.eye for e in quality.eyes]
    for eye in quality.eyes:
        whole = eye.loss.effective_rate_hz / (1 - eye.loss.lost_01)
        assert quality.nominal_rate_hz == pytest.approx(whole, rel=1e-6)
        assert eye.rms_s2s_calmest_deg < eye.rms_s2s_median_deg < 1


def test_latency_counts_from_the_sample_to_the_frame_that_used_it(quality):
    assert 0 <= quality.latency.handed_over_ms <= quality.latency.shown_ms < 200


def test_movements_are_found_in_world_with_the_eye_in_the_head_beside_them(quality):
    assert quality.movements.share_01(Movement.FIXATION) > 0.5
    assert np.isfinite(quality.movements.eye_deg_s).any()


def test_pupil_of_finished_trials_stands_beside_their_baseline(recording, quality):
    assert quality.pupil is not None
    assert recording.trials()["trial_id"].tolist() == [t.trial_id for t in quality.pupil_trials]
    assert all(abs(t.response.change_mm) < 2 for t in quality.pupil_trials)


def test_page_names_every_measure_of_the_standard_and_the_confound(quality):
    html = render_page(session_page(quality))
    for name, value in headline_facts(quality):
        assert name in html
        assert value in html
    assert "Light moves the pupil more" in html
    assert "Engbert–Kliegl" in html
    assert "SIMULATED" in html


def test_what_is_missing_is_a_dash_and_a_sentence(quality):
    bare = replace(quality, validations=(), pupil=None, pupil_trials=())
    html = render_page(session_page(bare))
    assert "accuracy is unknown" in html
    assert "Pupil size" not in html
    assert ("Accuracy", "–") in headline_facts(bare)


def test_a_session_without_gaze_says_what_to_do(recording, monkeypatch):
    monkeypatch.setattr(Recording, "stream_names", ("head",))
    with pytest.raises(DataError, match="no gaze was recorded"):
        session_quality(Recording(Path(recording.path)))
