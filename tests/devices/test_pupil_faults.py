"""Every fault a wire can have ends in a clear outcome, never in silence or an exception."""

import numpy as np
import pytest

from tests.devices.rigs import Rig
from visavis.devices.contracts import DeviceState
from visavis.devices.faults import FAULT_KINDS, FaultSchedule, WireFault
from visavis.lab.clock import SimClock
from visavis.lab.errors import ConfigError, DeviceTimeout, ProtocolViolation


def kinds_of(events):
    return [event.kind for event in events]


def test_perfect_wire_has_no_fault_but_missing_calibration():
    rig = Rig().start().run(2.0)

    assert rig.messages() == "not calibrated since it was opened"
    assert rig.pump.take_events() == ()


def test_late_start_times_out_then_opens():
    rig = Rig({"kind": "late_start", "duration_s": 3.0})

    with pytest.raises(DeviceTimeout, match="Pupil Remote on port 50020"):
        rig.driver.open(2.0)
    assert rig.driver.state is DeviceState.CLOSED
    rig.clock.sleep_until_ns(3 * 10**9)
    rig.driver.open(2.0)
    assert rig.driver.state is DeviceState.OPEN


def test_peer_that_never_answers_times_out_at_the_deadline():
    rig = Rig({"kind": "mute"})

    with pytest.raises(DeviceTimeout, match="eyes: nobody answered in time; start Pupil Capture"):
        rig.driver.open(2.0)
    assert rig.clock.now_ns() == 2 * 10**9


def test_old_version_is_refused_by_name():
    rig = Rig({"kind": "version", "text": "1.23"})

    with pytest.raises(ProtocolViolation, match=r"version '1\.23'; this driver needs 2\.0"):
        rig.driver.open(2.0)


def test_short_silence_is_a_warning_and_resumes():
    rig = Rig({"kind": "silence", "start_s": 1.0, "duration_s": 0.5}).start().run(1.4)

    assert "no data for" in rig.messages()
    rig.run(0.5)
    assert "no data" not in rig.messages()
    assert kinds_of(rig.pump.take_events()) == ["silent", "resumed"]
    assert rig.pump.health().gaps == 1
    assert rig.pump.health().longest_gap_ms == pytest.approx(508, abs=9)


def test_silence_of_a_second_is_blocking():
    rig = Rig({"kind": "silence", "start_s": 1.0, "duration_s": 5.0}).start().run(3.0)

    assert rig.pump.faults()[0].severity == "blocking"
    assert kinds_of(rig.pump.take_events()) == ["silent", "stalled"]


def test_disconnect_is_told_and_recovers_with_its_gap():
    rig = Rig({"kind": "disconnect", "start_s": 1.0, "duration_s": 4.0}).start().run(4.0)

    assert "disconnected" in rig.messages()
    assert rig.driver.state is DeviceState.FAULT
    rig.run(6.0)
    events = rig.pump.take_events()
    assert rig.driver.state is DeviceState.STREAMING
    assert kinds_of(events)[-2:] == ["disconnected", "reconnected"]
    assert events[-1].gap_ms > 4000
    assert rig.pump.health().reconnects == 1
    before = len(rig.batches)
    rig.run(0.5)
    assert len(rig.batches) > before


def test_lost_samples_show_as_gaps_in_device_stamps():
    rig = Rig({"kind": "loss", "amount": 0.05}).start().run(20.0)

    missing = 1 - rig.stamps("seq").size / 2400
    assert missing == pytest.approx(0.05, abs=0.02)
    assert rig.pump.health().gaps > 50


def test_duplicates_are_delivered_and_told():
    rig = Rig({"kind": "duplicate", "amount": 0.1}).start().run(5.0)

    assert (np.diff(rig.stamps("t_device_ns")) == 0).sum() > 20
    assert "repeated time stamps" in rig.messages()


def test_reordered_samples_are_delivered_and_told():
    rig = Rig({"kind": "reorder", "amount": 0.1}).start().run(5.0)

    assert (np.diff(rig.stamps("t_device_ns")) < 0).any()
    assert "backward time stamps" in rig.messages()


def test_burst_after_a_stall_keeps_every_sample():
    rig = Rig({"kind": "burst", "start_s": 1.0, "duration_s": 0.5}).start().run(3.0)

    assert (np.diff(rig.stamps("t_device_ns")) < 9_000_000).all()
    assert np.diff(rig.stamps("t_host_ns")).max() > 400_000_000
    assert kinds_of(rig.pump.take_events()) == ["silent", "resumed"]


def test_clock_jump_of_the_device_is_told_and_offset_follows():
    rig = Rig({"kind": "clock_jump", "start_s": 2.0, "amount": 100.0}).start().run(1.5)
    before_ms = rig.pump.health().clock_offset_ms

    rig.run(3.0)

    assert "clock jumped 1 times, last by 100000 ms" in rig.messages()
    assert rig.pump.health().clock_offset_ms == pytest.approx(before_ms - 100_000, abs=0.1)


def test_backward_stamps_are_told():
    rig = Rig({"kind": "backward", "start_s": 1.0, "duration_s": 0.2, "amount": 0.05})

    rig.start().run(2.0)

    assert "1 backward time stamps" in rig.messages()


def test_drift_is_measured():
    rig = Rig({"kind": "drift", "amount": 50.0}).start().run(60.0)

    assert rig.pump.health().clock_drift_ppm == pytest.approx(-50.0, abs=2.0)


def test_both_eyes_lost_is_blocking_and_never_zero():
    rig = Rig({"kind": "eyes_lost", "start_s": 0.5}).start().run(3.0)

    assert not rig.column("valid")[-100:].any()
    assert "neither eye is seen" in rig.messages()
    lengths = np.linalg.norm(rig.column("direction_head"), axis=1)
    assert not (lengths == 0).any()


@pytest.mark.parametrize(("eye", "bit"), [("left", 2), ("right", 1)])
def test_one_eye_lost_leaves_the_other(eye, bit):
    rig = Rig({"kind": "eyes_lost", "start_s": 0.5, "eyes": eye}).start().run(3.0)

    assert (rig.column("eyes_used")[-100:] == bit).all()
    assert rig.column("valid")[-100:].all()
    assert np.isnan(rig.column(f"{eye}_direction_head")[-100:]).all()
    assert f"the {eye} eye is not seen" in rig.messages()


def test_requests_unanswered_while_samples_go_on_are_told():
    rig = Rig({"kind": "mute", "start_s": 1.0}).start().run(6.0)

    assert rig.driver.state is DeviceState.STREAMING
    assert "no answer to time requests" in rig.messages()


def test_garbage_is_counted_and_leaves_holes_in_seq():
    rig = Rig({"kind": "garbage", "amount": 0.2}).start().run(5.0)

    assert "messages could not be read" in rig.messages()
    assert (np.diff(rig.stamps("seq")) > 1).any()


def test_eye_process_that_stopped_is_named():
    rig = Rig({"kind": "notify", "start_s": 1.0, "text": "eye_process.stopped"})

    rig.start().run(2.0)

    assert "the eye camera's process stopped" in rig.messages()


@pytest.mark.parametrize("seed", range(5))
def test_random_sessions_never_break_the_pump(seed):
    schedule = FaultSchedule.random(np.random.default_rng(seed), 20.0)
    rows = [
        {"kind": f.kind, "start_s": f.start_s, "duration_s": f.duration_s, "amount": f.amount}
        for f in schedule.faults
        if f.kind not in ("disconnect", "silence") or f.start_s > 0.5
    ]
    rig = Rig(*rows).start().run(25.0)

    assert "failed" not in kinds_of(rig.pump.take_events())
    assert rig.driver.state is DeviceState.STREAMING


def test_unknown_fault_names_the_nearest():
    with pytest.raises(ConfigError, match="did you mean 'silence'"):
        FaultSchedule.from_config([{"kind": "silenc"}])


def test_all_faults_of_a_configuration_are_reported_at_once():
    with pytest.raises(ConfigError, match=r"fault 1: .*did you mean 'start_s'.*fault 2: .*share"):
        FaultSchedule.from_config([{"kind": "loss", "start": 1}, {"kind": "loss", "amount": 3}])


def test_every_kind_of_fault_is_described():
    assert all(FAULT_KINDS.values())
    assert WireFault("silence", 1.0, 2.0).end_ns == 3 * 10**9
    assert SimClock().now_ns() == 0
