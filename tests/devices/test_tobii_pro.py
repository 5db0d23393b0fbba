"""Tobii Pro by the maker's SDK: names, times, one of several, a tracker that is unplugged."""

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from tests.devices.openvr_rigs import passer
from tests.devices.wire_ends.fake_titta import FakeTitta, FakeTracker
from visavis.devices.conformance import check_batches, check_eye_tracker, check_lifecycle
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.tobii.driver import TobiiPro
from visavis.devices.drivers.tobii.library import COLUMNS, STREAMS, TobiiSdk
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.gaze.tracker_error import TrackerErrorModel
from visavis.devices.sim.lsl.gaze import TittaSimulator
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import ConfigError, DeviceDisconnected, DeviceNotFound
from visavis.lab.geometry import angle_deg

EXACT = TrackerErrorModel(
    offset_deg=0.0, eye_offset_deg=0.0, gain_sd_01=0.0, white_deg=0.0, slow_deg=0.0
)


def fake(clock, *faults, body=None, **library):
    simulator = TittaSimulator(
        body or FixatingBody(5.0, 3.0, 0.65),
        seed=1,
        clock=clock,
        rate_hz=120.0,
        error=EXACT,
        faults=FaultSchedule.from_config(faults),
    )
    return FakeTitta(simulator, clock, **library)


def tracker_on(titta, **options):
    wire = TobiiSdk(titta.clock, library=titta, **options)
    return TobiiPro("eye_tracker", wire, titta.clock)


def listened(device, clock, seconds, step_s=1 / 90):
    batches, lost = [], 0
    device.start(batches.append)
    for _ in range(round(seconds / step_s)):
        clock.sleep_until_ns(clock.now_ns() + round(step_s * NS_PER_S))
        try:
            device.poll(0.0)
        except DeviceDisconnected:
            lost += 1
    gaze = [b for b in batches if b.schema.name == "gaze"]
    return gaze, lost


def test_driver_keeps_the_contract():
    clock = SimClock()
    titta = fake(clock)
    for check in (check_lifecycle, check_batches, check_eye_tracker):
        check(lambda: tracker_on(titta), passer(clock))


def test_rays_come_from_where_the_eyes_are_and_pupils_are_in_millimetres():
    clock = SimClock()
    body = FixatingBody(5.0, 3.0, 0.65)
    device = tracker_on(fake(clock, body=body))
    device.open(3.0)
    gaze, lost = listened(device, clock, 2.0)
    values = np.concatenate([b.values for b in gaze])
    truth = body.eyes(np.array([0]))[0]
    assert lost == 0
    assert len(values) > 200
    for eye in ("left", "right"):
        seen = values[values[f"{eye}_valid"]]
        assert angle_deg(seen[f"{eye}_direction_head"], truth[f"{eye}_direction_head"]).max() < 0.1
        assert np.nanmedian(seen[f"{eye}_pupil_mm"]) == pytest.approx(3.5, abs=0.2)
    assert "Tobii Pro Spectrum" in device.info.model
    assert "TPSP1" == device.info.serial
    device.close()


def test_times_of_the_tracker_are_put_on_the_sessions_clock():
    clock = SimClock()
    titta = fake(clock)
    device = tracker_on(titta)
    device.open(3.0)
    listened(device, clock, 12.0)
    health = device.health()
    ahead_ns = titta.simulator.source.device_ns(clock.now_ns()) - clock.now_ns()
    assert health.clock_offset_ms == pytest.approx(-ahead_ns / 1e6, abs=0.2)
    pairs = device.clock_pairs()
    assert len(pairs) >= 3
    trips_ns = [pair.host_receive_ns - pair.host_send_ns for pair in pairs]
    assert trips_ns == pytest.approx([300_000] * len(pairs), abs=2)
    device.close()


def test_rate_that_the_tracker_has_not_got_names_those_it_has():
    titta = fake(SimClock())
    with pytest.raises(ConfigError, match="60, 120, 150, 300 times a second, not 1000"):
        tracker_on(titta, rate_hz=1000.0).open(1.0)


def test_two_trackers_are_a_choice_and_none_is_an_error():
    titta = fake(SimClock(), serials=("TPSP1", "TPNA2"))
    with pytest.raises(DeviceNotFound, match="2 Tobii eye trackers fit: TPNA2, TPSP1; give serial"):
        tracker_on(titta).open(1.0)
    tracker_on(titta, serial="TPNA2").open(3.0)
    with pytest.raises(DeviceNotFound, match="no eye tracker with the serial number X; connect"):
        tracker_on(titta, serial="X").open(1.0)


def test_unplugged_tracker_is_told_once_and_found_again():
    clock = SimClock()
    device = tracker_on(fake(clock, {"kind": "disconnect", "start_s": 4.0, "duration_s": 3.0}))
    device.open(3.0)
    gaze, lost = listened(device, clock, 10.0)
    assert lost == 1
    assert DeviceState.STREAMING is device.state
    assert gaze[-1].t_host_ns[-1] > clock.now_ns() - NS_PER_S // 5
    device.close()


def test_genuine_library_has_every_name_that_is_used():
    titta = pytest.importorskip("TittaPy_v2", reason="pip install TittaPy")
    assert isinstance(titta.find_all_eye_trackers(), list)
    assert titta.get_system_timestamp() > 0
    used = {name for name in dir(FakeTracker) if not name.startswith("_")} - {"streams"}
    assert used <= set(dir(titta.EyeTracker))
    assert {"connection_lost", "connection_restored"} <= set(titta.notification_type.__members__)
    with pytest.raises(RuntimeError):
        titta.EyeTracker("tet-tcp://127.0.0.1")


def test_columns_are_named_as_the_stand_in_has_them():
    clock = SimClock()
    tracker = fake(clock).EyeTracker("tet-tcp://169.254.10.20")
    for stream in STREAMS:
        assert tracker.start(stream)
    with pytest.raises(RuntimeError, match="not recognized"):
        tracker.start("gaze_data")
    assert {key for key, _ in COLUMNS} <= set(tracker.consume_N("gaze", 10))
