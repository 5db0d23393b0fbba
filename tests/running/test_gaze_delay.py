"""A tracker's own delay, as configured: recorded, taken off every sample, told in the report."""

from pathlib import Path

import numpy as np
import pytest

from tests.faults.sessions import lab
from tests.sessions import opened
from visavis.lab.clock import NS_PER_MS
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

DELAY_MS = 24.0


def performed(root: Path, **tracker: float) -> Recording:
    duel = opened("duel")
    experiment = duel.experiment({"repetitions": 1, "practice": 0})
    config = lab(root, **tracker)
    made = simulated_request(duel, experiment, config, label="S01", index=0, seed=1)
    return Recording(perform_new(made))


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return performed(tmp_path_factory.mktemp("late"), gaze_delay_ms=DELAY_MS)


def test_it_is_recorded_with_the_tracker(late: Recording) -> None:
    tracker = next(d for d in late.manifest.devices if d["role"] == "eye_tracker")
    assert DELAY_MS == tracker["gaze_delay_ms"]


def test_samples_are_held_against_what_was_on_display_when_the_eye_was_there(
    late: Recording,
) -> None:
    gaze, seen = late.stream_arrays("gaze"), late.stream_arrays("gaze_targets")
    stamped = dict(zip(gaze["seq"].tolist(), gaze["t_device_ns"].tolist(), strict=True))
    compared = 0
    for trial in late.trials().itertuples():
        rows = (seen["t_sample_ns"] >= trial.t_start_ns) & (seen["t_sample_ns"] < trial.t_end_ns)
        at = [stamped[s] for s in seen["gaze_seq"][rows].tolist()]
        expected = np.array(at) + int(trial.clock_offset_ns) - round(DELAY_MS * NS_PER_MS)
        assert expected.tolist() == seen["t_sample_ns"][rows].tolist()
        compared += rows.sum()
    assert compared > 100


def test_the_report_says_that_it_was_taken_off(late: Recording) -> None:
    facts = opened("duel").measure(late).facts
    assert "the tracker's own delay, 24 ms, is taken off every sample's time" in facts["latency"]
