"""What every eye tracker beyond Pupil Core must do, whatever its wire."""

import numpy as np
import pytest

from tests.devices import gaze_rigs
from tests.devices.gaze_rigs import PERFECT, GazeRig
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.eyelink.driver import EyeLink
from visavis.devices.drivers.fove.driver import Fove
from visavis.devices.drivers.gazepoint.driver import Gazepoint
from visavis.devices.drivers.hid_gaze.driver import HidGaze
from visavis.devices.drivers.lsl.gaze import LslGaze
from visavis.devices.drivers.neon.driver import Neon
from visavis.devices.sim.eyelink import EyeLinkSimulator
from visavis.devices.sim.fove import FoveSimulator
from visavis.devices.sim.gazepoint import GazepointSimulator
from visavis.devices.sim.hid_gaze import HidGazeSimulator
from visavis.devices.sim.lsl.gaze import LslGazeSimulator
from visavis.devices.sim.neon import NeonSimulator
from visavis.lab.errors import DeviceTimeout
from visavis.lab.geometry import angle_deg
from visavis.people.observer.observer import Observer

TRACKERS = {
    "fove": (Fove, FoveSimulator),
    "neon": (Neon, NeonSimulator),
    "hid_gaze": (HidGaze, HidGazeSimulator),
    "lsl_gaze": (LslGaze, LslGazeSimulator),
    "eyelink": (EyeLink, EyeLinkSimulator),
    "gazepoint": (Gazepoint, GazepointSimulator),
}
TIGHT_DEG = 0.01


@pytest.fixture(params=TRACKERS)
def tracker(request):
    return TRACKERS[request.param]


def test_contract_is_kept_in_memory(tracker):
    gaze_rigs.keeps_the_contract_in_memory(*tracker)


def test_contract_is_kept_on_a_replayed_wire_log(tracker, tmp_path):
    gaze_rigs.keeps_the_contract_on_a_replay(*tracker, tmp_path / "séance 1.wire")


def test_perfect_tracker_reports_the_body_direction(tracker):
    rig = GazeRig(*tracker, error=PERFECT).start().run(1.0)

    errors_deg = angle_deg(rig.column("direction_head").astype("f8"), rig.body.direction)
    assert rig.column("valid").all()
    assert errors_deg.max() < TIGHT_DEG
    np.testing.assert_allclose(rig.column("origin_m"), 0.0, atol=1e-4)


def test_left_and_right_eye_are_not_exchanged(tracker):
    rig = GazeRig(*tracker, error=PERFECT).start().run(1.0)
    truth = rig.body.eyes(np.zeros(1, np.int64))[0]

    for eye in ("left", "right"):
        if "per_eye" in rig.driver.info.capabilities:
            seen = rig.column(f"{eye}_direction_head")[-1].astype("f8")
            assert angle_deg(seen, truth[f"{eye}_direction_head"]) < TIGHT_DEG
        if "pupil" in rig.driver.info.capabilities:
            np.testing.assert_allclose(rig.column(f"{eye}_pupil_mm"), 3.5, rtol=1e-5)


def test_host_stamp_is_the_arrival(tracker):
    rig = GazeRig(*tracker, error=PERFECT).start().run(3.0)

    delay_ns = rig.stamps("t_host_ns") - rig.stamps("t_device_ns")
    assert np.ptp(delay_ns) < 1_100_000  # the coarsest device clock counts milliseconds


def test_every_sample_arrives_once_and_in_order(tracker):
    rig = GazeRig(*tracker).start().run(3.0)

    assert (np.diff(rig.stamps("seq")) == 1).all()
    rate_hz = rig.driver.describe()[0].nominal_rate_hz
    assert rig.stamps("seq").size == pytest.approx(3.0 * rate_hz, abs=0.03 * rate_hz)
    assert rig.kinds() == []
    assert rig.pump.health().gaps == 0


def test_lost_samples_are_gaps(tracker):
    rig = GazeRig(*tracker, {"kind": "loss", "amount": 0.05}).start().run(10.0)

    assert rig.pump.health().gaps > 10


def test_duplicates_are_told(tracker):
    rig = GazeRig(*tracker, {"kind": "duplicate", "amount": 0.1}).start().run(5.0)

    assert "repeated time stamps" in rig.messages()
    assert (np.diff(rig.stamps("seq")) > 0).all()


def test_reordered_samples_are_told(tracker):
    rig = GazeRig(*tracker, {"kind": "reorder", "amount": 0.1}).start().run(5.0)

    assert "backward time stamps" in rig.messages()
    assert (np.diff(rig.stamps("seq")) > 0).all()


def test_burst_after_a_stall_keeps_every_sample(tracker):
    rig = GazeRig(*tracker, {"kind": "burst", "start_s": 1.0, "duration_s": 0.5}).start().run(3.0)

    assert rig.pump.health().gaps == 0
    assert np.diff(rig.stamps("t_host_ns")).max() > 400_000_000
    assert rig.kinds() == ["silent", "resumed"]


def test_garbage_is_counted_and_never_raises(tracker):
    rig = GazeRig(*tracker, {"kind": "garbage", "amount": 0.2}).start().run(5.0)

    assert "could not be read" in rig.messages()
    assert rig.driver.state is DeviceState.STREAMING


def test_both_eyes_lost_is_blocking_and_never_zero(tracker):
    rig = GazeRig(*tracker, {"kind": "eyes_lost", "start_s": 0.5}).start().run(3.0)

    assert not rig.column("valid")[-100:].any()
    assert "neither eye is seen" in rig.messages()
    lengths = np.linalg.norm(rig.column("direction_head"), axis=1)
    assert not (lengths == 0).any()


@pytest.mark.parametrize(("eye", "bit"), [("left", 2), ("right", 1)])
def test_one_eye_lost_leaves_the_other(tracker, eye, bit):
    fault = {"kind": "eyes_lost", "start_s": 0.5, "eyes": eye}
    rig = GazeRig(*tracker, fault, error=PERFECT).start().run(3.0)
    if "per_eye" not in rig.driver.info.capabilities:
        return

    assert (rig.column("eyes_used")[-50:] == bit).all()
    assert rig.column("valid")[-50:].all()
    assert not rig.column(f"{eye}_valid")[-50:].any()
    assert f"the {eye} eye is not seen" in rig.messages()


def test_blink_loses_validity(tracker):
    rig = GazeRig(*tracker).start().run(0.5)
    rig.body.openness_01 = 0.0
    rig.batches.clear()
    rig.run(0.5)

    rate_hz = rig.driver.describe()[0].nominal_rate_hz
    assert not rig.column("valid")[round(0.1 * rate_hz) :].any()


def test_disconnect_is_told_and_back_in_two_seconds(tracker):
    fault = {"kind": "disconnect", "start_s": 1.0, "duration_s": 9.0}
    rig = GazeRig(*tracker, fault).start().run(8.0)

    assert "disconnected" in rig.messages()
    assert rig.driver.state is DeviceState.FAULT
    rig.run(4.0)
    events = rig.pump.take_events()
    assert [e.kind for e in events][-2:] == ["disconnected", "reconnected"]
    assert events[-1].t_ns - 10 * 10**9 < 2 * 10**9
    assert events[-1].gap_ms > 8000
    before = rig.driver.health().received
    rig.run(0.5)
    assert rig.driver.health().received > before


def test_drift_of_the_device_clock_is_measured(tracker):
    rig = GazeRig(*tracker, {"kind": "drift", "amount": 50.0}).start().run(40.0)

    assert rig.pump.health().clock_drift_ppm == pytest.approx(-50.0, abs=8.0)


def test_clock_jump_is_told(tracker):
    jump = {"kind": "clock_jump", "start_s": 2.0, "amount": 100.0}
    rig = GazeRig(*tracker, jump).start().run(6.0)

    assert "clock jumped 1 times" in rig.messages()


def test_silent_peer_times_out_or_is_not_found(tracker):
    rig = GazeRig(*tracker, {"kind": "late_start", "duration_s": 3.0})

    with pytest.raises(DeviceTimeout, match="eyes: "):
        rig.driver.open(2.0)
    assert rig.driver.state is DeviceState.CLOSED
    rig.clock.sleep_until_ns(4 * 10**9)
    rig.driver.open(2.0)
    assert rig.driver.state is DeviceState.OPEN


@pytest.mark.parametrize("seed", range(2))
def test_random_sessions_never_break_the_pump(tracker, seed):
    rng = np.random.default_rng(seed)
    schedule = gaze_rigs.FaultSchedule.random(rng, 20.0)
    rows = [
        {"kind": f.kind, "start_s": f.start_s, "duration_s": f.duration_s, "amount": f.amount}
        for f in schedule.faults
        if f.kind not in ("disconnect", "silence") or f.start_s > 0.5
    ]
    rig = GazeRig(*tracker, *rows).start().run(25.0)

    assert "failed" not in rig.kinds()
    assert rig.driver.state is DeviceState.STREAMING


def test_gaze_left_for_later_is_that_of_every_frame(tracker):
    def perform(*, may_wait):
        rig = GazeRig(*tracker, seed=3, body=Observer(2, 5)).start().run(0.5)
        before = len(rig.batches)
        for _ in range(3):
            rig.run(0.4, may_wait=may_wait)
            rig.pump.step()
        return rig, len(rig.batches) - before

    (each, of_each), (seldom, of_seldom) = perform(may_wait=False), perform(may_wait=True)

    assert of_seldom <= 3 < 60 < of_each
    n = min(len(each.stamps("seq")), len(seldom.stamps("seq")))  # a question may take its time
    for stamp in ("seq", "t_device_ns", "t_host_ns"):
        np.testing.assert_array_equal(each.stamps(stamp)[:n], seldom.stamps(stamp)[:n])
    rows = [np.concatenate([b.values for b in rig.batches])[:n] for rig in (each, seldom)]
    assert rows[0].tobytes() == rows[1].tobytes()


def test_gaze_that_a_fault_may_befall_is_not_left_for_later(tracker):
    late = {"kind": "loss", "start_s": 100.0, "duration_s": 1.0, "amount": 0.5}
    rig = GazeRig(*tracker, late, body=Observer(2, 5)).start()

    rig.run(0.2, may_wait=True)

    assert not rig.pump.is_put_off
    assert len(rig.batches) > 5
