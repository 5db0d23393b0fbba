"""Tables of a session hold gaze turned by the head of its own time; older ones are mended."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

from benchmarks.gaze_while_turning import PERFECT, TARGET_M, TurningHead
from tests.faults.sessions import lab
from tests.sessions import opened
from visavis.devices.sim.native_build import find_compiler
from visavis.lab.config import DeviceConfig
from visavis.lab.geometry import angle_deg
from visavis.recording.bids import _head_poses
from visavis.recording.cached import CachedRecording
from visavis.recording.reader import Recording
from visavis.recording.stream_file import Columns
from visavis.results.opened_study import OpenedStudy
from visavis.results.reevaluation import (
    Pairing,
    ahead_ms,
    pair_by_own_time,
    paired_by_arrival,
    targets_again,
)
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

LOOK_AHEAD_MS = 40.0
LIMIT_DEG = 0.1


class Turner(TurningHead):
    """A participant who turns the head to and fro and looks at a mark, or else straight ahead."""

    def __init__(self, person: Any, deg_per_s: float) -> None:
        super().__init__(deg_per_s)
        self._person = person

    def look_at(self, target_world_m: Sequence[float] | None, t_ns: int) -> None:
        """Follow the instruction."""
        self.target_m = TARGET_M if target_world_m is None else np.array(target_world_m)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._person, name)


def performed(data_root: Path, deg_per_s: float, headset: str = "simulated_headset") -> Recording:
    config = lab(data_root)
    devices: Mapping[str, DeviceConfig] = {
        **config.devices,
        "headset": DeviceConfig(
            role="headset",
            driver=headset,
            simulated=True,
            options={"look_ahead_ms": LOOK_AHEAD_MS, "display_rate_hz": 90},
        ),
    }
    study = opened("duel")
    request = simulated_request(
        study,
        study.experiment({"repetitions": 1, "practice": 0}),
        config.model_copy(update={"devices": devices}),
        label="S01",
        index=0,
        seed=1,
    )
    of_study = OpenedStudy.participant

    def turner(*arguments: Any, **named: Any) -> Any:
        return Turner(of_study(*arguments, **named), deg_per_s)

    with (
        mock.patch.object(OpenedStudy, "participant", turner),
        mock.patch("visavis.devices.sim.gaze.source.TrackerErrorModel", return_value=PERFECT),
        mock.patch("visavis.devices.sim.pupil.capture.TrackerErrorModel", return_value=PERFECT),
    ):
        return CachedRecording(perform_new(replace(request)))


def errors_deg(recording: Recording, targets: Columns | None = None) -> Any:
    """Return the angles between gaze and the target in trials, turns round left out."""
    if targets is None:
        targets = recording.stream_arrays("gaze_targets")
    t_ns, truth = targets["t_sample_ns"], TARGET_M - targets["origin_world_m"].astype(np.float64)
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    trials = recording.trials()
    in_trial = np.zeros(len(t_ns), bool)
    for start_ns, end_ns in zip(trials["t_start_ns"], trials["t_end_ns"], strict=True):
        in_trial |= (t_ns > start_ns) & (t_ns < end_ns)
    is_steady = TurningHead(0.0).since_turned_round_s(t_ns) > 0.12
    here = in_trial & is_steady & targets["valid"]
    assert here.sum() > 100
    return angle_deg(targets["direction_world"][here].astype(np.float64), truth[here])


@pytest.mark.parametrize(
    ("deg_per_s", "headset"), [(50.0, "simulated_headset"), (150.0, "openxr_headset")]
)
def test_in_a_recorded_session_eyes_on_a_target_stay_there_while_the_head_turns(
    deg_per_s: float, headset: str, tmp_path: Path
) -> None:
    if headset != "simulated_headset":
        pytest.importorskip("xr", reason="pip install pyopenxr")
        if find_compiler() is None:
            pytest.skip("the simulated runtime needs a C compiler: apt-get install gcc")
    recording = performed(tmp_path, deg_per_s, headset)
    assert np.percentile(errors_deg(recording), 95) <= LIMIT_DEG
    validations = recording.events_named("validation", 1)["payload"]
    assert len(validations)
    assert max(v["accuracy_deg"] for v in validations) <= 2 * LIMIT_DEG


class Older(CachedRecording):
    """A session as versions before recorded it: no measured head, and gaze turned by the other."""

    @property
    def stream_names(self) -> tuple[str, ...]:
        """Return the streams of then."""
        return tuple(name for name in super().stream_names if name != "head_measured")


@pytest.fixture(scope="module")
def older(tmp_path_factory: pytest.TempPathFactory) -> Older:
    recording = Older(performed(tmp_path_factory.mktemp("older"), 100.0).path)
    views_of = opened("duel").views_of
    then = targets_again(recording, views_of, 1, Pairing.AS_RECORDED)
    del then["head_beyond_ms"]
    recording.amend(1, "gaze_targets", then)
    return recording


def test_in_older_recordings_gaze_is_off_by_what_the_head_turned_within_the_look_ahead(
    older: Older,
) -> None:
    assert paired_by_arrival(older, 1)
    assert LOOK_AHEAD_MS == pytest.approx(ahead_ms(older))
    assert np.median(errors_deg(older)) == pytest.approx(100.0 * LOOK_AHEAD_MS / 1000, abs=0.2)


def test_older_recordings_are_paired_anew_and_the_report_says_so(older: Older) -> None:
    study = opened("duel")
    again = Older(older.path)
    assert pair_by_own_time(again, study.views_of)
    assert np.percentile(errors_deg(again), 95) <= LIMIT_DEG
    intake = study.measure(again)
    assert "40.0 ms ahead, and is evaluated again" in intake.facts["latency"]
    assert len(older.stream_arrays("gaze_targets")["seq"]) == len(
        again.stream_arrays("gaze_targets")["seq"]
    )


def test_new_recordings_are_left_as_they_are(tmp_path: Path) -> None:
    recording = performed(tmp_path, 50.0)
    assert not pair_by_own_time(recording, opened("duel").views_of)
    assert not recording.is_amended(1, "gaze_targets")
    beyond_ms = recording.stream_arrays("gaze_targets")["head_beyond_ms"]
    assert (beyond_ms == 0.0).all()


@pytest.mark.parametrize("kind", [CachedRecording, Older])
def test_a_head_that_leaves_for_others_has_the_times_its_poses_describe(
    kind: type[CachedRecording], older: Older
) -> None:
    head = _head_poses(kind(older.path), 1)
    assert head is not None
    t_ns, turns = head["t_host_ns"], head["orientation_wxyz"].astype(np.float64)
    yaw_deg = np.degrees(2 * np.arctan2(turns[:, 2], turns[:, 0]))
    body = TurningHead(100.0)
    truth = np.array([body.head(int(t))[1] for t in t_ns])
    truth_deg = np.degrees(2 * np.arctan2(truth[:, 2], truth[:, 0]))
    is_steady = (body.since_turned_round_s(t_ns) > 0.12) & (np.arange(len(t_ns)) > 2)
    assert np.percentile(np.abs(yaw_deg - truth_deg)[is_steady], 99) < 0.01
