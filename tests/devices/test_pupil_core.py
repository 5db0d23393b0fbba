"""The Pupil Core driver against its simulator on the memory wire."""

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from tests.devices.rigs import Rig
from visavis.devices.contracts import DeviceState, SessionName
from visavis.devices.sim.gaze.tracker_error import TrackerErrorModel
from visavis.devices.sim.pupil.capture import PupilCoreSimulator
from visavis.lab.clock_fit import offset_ns
from visavis.lab.geometry import angle_deg
from visavis.people.observer import Observer

PERFECT = TrackerErrorModel(
    offset_deg=0, eye_offset_deg=0, gain_sd_01=0, white_deg=0, slow_deg=0, latency_jitter_ms=0
)


def test_perfect_tracker_reports_the_body_direction():
    rig = Rig(error=PERFECT).start().run(1.0)

    errors_deg = angle_deg(rig.column("direction_head").astype("f8"), rig.body.direction)
    assert errors_deg.max() < 0.01
    assert (rig.column("left_pupil_mm") == 3.5).all()
    np.testing.assert_allclose(rig.column("origin_m"), 0.0, atol=1e-9)


def test_left_and_right_eye_are_not_exchanged():
    rig = Rig(error=PERFECT).start().run(1.0)
    truth = rig.body.eyes(np.zeros(1, np.int64))[0]

    for eye in ("left", "right"):
        seen = rig.column(f"{eye}_direction_head")[-1].astype("f8")
        assert angle_deg(seen, truth[f"{eye}_direction_head"]) < 0.01


def test_offset_from_clock_pairs_is_exact_without_drift():
    rig = Rig().start().run(5.0)

    expected = -rig.simulator.device_ns(0)
    assert offset_ns(rig.driver.clock_pairs()) == expected
    sampled = rig.stamps("t_device_ns") + expected
    grid = np.array([k * 10**9 // 120 for k in range(1000)])
    assert np.isin(sampled, grid).all()


def test_host_stamp_is_the_arrival():
    rig = Rig(error=PERFECT).start().run(1.0)

    delay_ns = (
        rig.stamps("t_host_ns") - rig.stamps("t_device_ns") - offset_ns(rig.driver.clock_pairs())
    )
    assert (delay_ns == 12_000_000).all()


def test_calibration_succeeds_when_the_eyes_follow():
    rig = Rig().start()

    outcome = rig.calibrate()

    assert outcome.succeeded
    assert "not calibrated" not in rig.messages()


def test_calibration_fails_with_a_reason_when_the_eyes_wander():
    body_looks_away = Rig().start()
    body_looks_away.body.look(40.0, 20.0)

    outcome = body_looks_away.calibrate(looks=False)

    assert not outcome.succeeded
    assert "do not fit" in outcome.message


def test_calibration_without_references_fails():
    rig = Rig().start()
    rig.driver.begin_calibration()

    assert not rig.driver.end_calibration(3.0).succeeded


def test_calibration_makes_gaze_more_accurate():
    def mean_error(rig):
        rig.batches.clear()
        rig.body.look(5.0, 3.0)
        rig.run(1.0)
        return angle_deg(rig.column("direction_head").astype("f8"), rig.body.direction).mean()

    before, after = [], []
    for seed in range(8):
        rig = Rig(seed=seed).start().run(0.1)
        before.append(mean_error(rig))
        rig.calibrate()
        after.append(mean_error(rig))
    assert np.mean(after) < 0.5 * np.mean(before)


def test_marks_of_a_session_stand_in_captures_own_recording(tmp_path):
    rig = Rig()
    rig.driver.open(2.0)
    rig.driver.annotate("too early", rig.clock.now_ns())
    rig.driver.begin_recording(SessionName("stare", "S001", 1, 2), tmp_path)
    rig.pump.start()
    rig.driver.annotate("trial 1", rig.clock.now_ns())
    rig.driver.close()

    (found,) = rig.simulator.recordings.items()
    assert (found[0], [mark["label"] for mark in found[1]]) == ("stare_S001_001_02", ["trial 1"])
    rig.driver.open(2.0)
    rig.driver.annotate("too late", rig.clock.now_ns())
    assert [mark["label"] for mark in found[1]] == ["trial 1"]


def test_blink_loses_confidence_and_validity():
    rig = Rig().start().run(0.5)
    rig.body.openness_01 = 0.0
    rig.batches.clear()
    rig.run(0.5)

    assert not rig.column("valid")[5:].any()
    assert rig.column("confidence_01")[5:].max() < 0.1


def test_repeated_stretch_repeats_bit_for_bit():
    def stretch(warm_up_s):
        rig = Rig().start().run(warm_up_s)
        start_ns = -(-rig.clock.now_ns() // 10**9) * 10**9
        rig.clock.sleep_until_ns(start_ns - 1)
        rig.pump.step()
        rig.body.stretch_number = 7
        rig.batches.clear()
        rig.run(1.0)
        device_ns = rig.stamps("t_device_ns") + offset_ns(rig.driver.clock_pairs())
        return np.concatenate([b.values for b in rig.batches])[device_ns >= start_ns][:100]

    np.testing.assert_array_equal(stretch(0.5), stretch(3.2))


def test_gaze_left_for_later_is_that_of_every_frame():
    def performed(may_wait):
        rig = Rig(seed=3).start()
        rig.calibrate()
        rig.pump.step()
        before = len(rig.batches)
        for stretch in range(3):
            rig.body.stretch_number = stretch
            rig.body.look(5.0 * stretch, 2.0)
            rig.run(0.9, may_wait=may_wait)
            rig.body.openness_01 = 0.2 * stretch
            rig.run(0.4, may_wait=may_wait)
        rig.pump.step()
        return rig, len(rig.batches) - before

    (each, of_each), (seldom, of_seldom) = performed(False), performed(True)

    # exchanges of time, twice a second, go on without samples
    assert 1 == of_seldom < of_each - 200
    for stamp in ("seq", "t_device_ns", "t_host_ns"):
        np.testing.assert_array_equal(each.stamps(stamp), seldom.stamps(stamp))
    rows = [np.concatenate([b.values for b in rig.batches]).tobytes() for rig in (each, seldom)]
    assert rows[0] == rows[1]
    assert each.driver.clock_pairs() == seldom.driver.clock_pairs()


@pytest.mark.parametrize("put_off_s", [0.0, 0.1])
def test_gaze_told_ahead_is_what_arrives(put_off_s):
    rig = Rig(seed=3, body=Observer(2, 5)).start()
    rig.run(0.4)
    rig.run(put_off_s, may_wait=True)
    before, until_ns = len(rig.batches), rig.clock.now_ns() + 200_000_000

    told = rig.driver.gaze_ahead(until_ns)
    again = rig.driver.gaze_ahead(until_ns)
    rig.run(0.1)
    rig.clock.sleep_until_ns(until_ns)
    rig.pump.step()
    delivered = rig.batches[before:]

    assert 20 < len(told) == len(again) == sum(map(len, delivered))
    for stamp in ("t_device_ns", "t_host_ns"):
        arrived = np.concatenate([getattr(batch, stamp) for batch in delivered])
        assert arrived.tolist() == getattr(told, stamp).tolist() == getattr(again, stamp).tolist()
    assert told.values.tobytes() == b"".join(batch.values.tobytes() for batch in delivered)


def test_gaze_is_not_told_ahead_where_it_may_come_otherwise():
    def told(*faults, body):
        rig = Rig(*faults, body=body).start()
        rig.run(0.4)
        return rig.driver.gaze_ahead(rig.clock.now_ns() + 10**8)

    late = {"kind": "loss", "start_s": 100.0, "duration_s": 1.0, "amount": 0.5}
    assert told(body=FixatingBody()) is None  # has no plans
    assert told(late, body=Observer(0, 1)) is None
    assert told(body=Observer(0, 1)) is not None

    calibrating = Rig(body=Observer(0, 1)).start()
    calibrating.run(0.4)
    calibrating.driver.begin_calibration()
    assert calibrating.driver.gaze_ahead(calibrating.clock.now_ns() + 10**8) is None


def test_gaze_that_a_fault_may_befall_is_not_left_for_later():
    rig = Rig({"kind": "loss", "start_s": 100.0, "duration_s": 1.0, "amount": 0.5}).start()

    rig.run(0.1, may_wait=True)

    assert not rig.pump.is_put_off
    assert len(rig.batches) > 5


def test_annotation_arrives_on_the_device_clock():
    rig = Rig().start().run(1.0)
    t_ns = rig.clock.now_ns()

    rig.driver.annotate("trial 1", t_ns)

    (annotation,) = rig.simulator.annotations
    assert annotation["label"] == "trial 1"
    assert annotation["timestamp"] == pytest.approx(rig.simulator.device_ns(t_ns) / 1e9, abs=1e-6)


def test_info_says_simulated_and_names_the_version():
    rig = Rig().start()

    assert rig.driver.info.is_simulated
    assert rig.driver.info.model == "Core (Capture 3.5.1)"
    assert rig.driver.state is DeviceState.STREAMING


def test_messages_of_a_stretch_are_foreseen_as_they_come_and_none_of_a_new_one():
    body = Observer(0, 1)
    simulator = PupilCoreSimulator(body, seed=1)
    simulator.advance(20_000_000)
    foreseen = simulator.arriving(100_000_000)
    simulator.advance(100_000_000)
    assert len(foreseen) > 5
    assert list(simulator.outgoing(100_000_000)) == foreseen
    body.prepare(1, 110_000_000)  # its noise is another one, drawn when its first sample is taken
    assert simulator.arriving(200_000_000) is None
