"""HID usage page 0x12: the descriptor walker, golden reports, and hidapi's surface."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices import gaze_rigs
from tests.devices.bodies import FixatingBody
from tests.devices.gaze_rigs import PERFECT, GazeRig
from tests.devices.wire_ends.hid_tracker import FakeHidapi
from visavis.devices import libraries
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.hid_gaze import codec
from visavis.devices.drivers.hid_gaze.driver import HidGaze
from visavis.devices.drivers.hid_gaze.reports import HidReports
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.pump import Pump
from visavis.devices.sim.hid_gaze import DESCRIPTOR, REPORT, SERIAL, HidGazeSimulator
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import DeviceNotFound, ProtocolViolation

SCREEN = Screen(500.0, 300.0, 600.0)
NONE = 2**31 - 1
REPORTS = codec.walk_descriptor(DESCRIPTOR)
LAYOUT = codec.tracking_layout(REPORTS)


def row_of(*values):
    ticks, row = codec.decode_report(REPORT.pack(0x10, *values), LAYOUT, SCREEN, 60.0)
    return ticks, rows_to_values([row])[0]


def test_descriptor_gives_the_report_of_44_bytes():
    assert LAYOUT.size == 44
    assert LAYOUT.timestamp == codec.Place(4, 8)
    assert [p.at for p in LAYOUT.gaze] == [12, 16]
    assert [p.at for p in LAYOUT.left] == [20, 24, 28]
    assert [p.at for p in LAYOUT.right] == [32, 36, 40]


def test_eight_bytes_with_one_usage_are_one_value():
    stamp = b"\x05\x12\x09\x01\xa1\x01\x85\x10\x09\x20\x75\x08\x95\x08\x81\x02\xc0"

    ((_, layout),) = codec.walk_descriptor(stamp).items()
    assert layout.size == 9
    assert list(layout.places.values()) == [codec.Place(1, 8)]


def test_micrometres_from_the_top_left_make_a_ray():
    eyes = (220_000, 150_000, 600_000, 280_000, 150_000, 600_000)
    ticks, row = row_of(123_456, 250_000, 0, *eyes)

    assert ticks == 123_456
    up = np.array([0.0, 0.15, -0.6])
    np.testing.assert_allclose(row["direction_head"], up / np.linalg.norm(up), atol=1e-6)
    np.testing.assert_allclose(row["origin_m"], 0.0, atol=1e-9)
    assert (row["valid"], row["eyes_used"]) == (True, 3)
    assert np.isnan(row["left_direction_head"]).all()


def test_largest_value_is_missing_never_a_place():
    _, row = row_of(1, NONE, NONE, *[NONE] * 6)

    assert not row["valid"]
    assert np.isnan(row["direction_head"]).all()


def test_one_seen_eye_still_gives_the_middle():
    _, row = row_of(1, 250_000, 150_000, 220_000, 150_000, 600_000, NONE, NONE, NONE)

    np.testing.assert_allclose(row["origin_m"], 0.0, atol=1e-9)
    assert row["eyes_used"] == 1


@pytest.mark.parametrize("ticks_per_s", [1_000_000, 10_000_000, 1000])
def test_unit_of_the_stamps_is_found_from_the_rate(ticks_per_s):
    rig = GazeRig(HidGaze, HidGazeSimulator, ticks_per_s=ticks_per_s).start().run(2.0)

    steps_ms = np.diff(rig.stamps("t_device_ns")) / 1e6
    assert steps_ms.mean() == pytest.approx(1000 / 120, rel=0.01)


@given(st.binary(max_size=120))
def test_any_descriptor_is_walked_without_raising(raw):
    codec.tracking_layout(codec.walk_descriptor(raw))


@given(st.integers(0, len(DESCRIPTOR) - 1), st.integers(0, 255), st.binary(max_size=60))
def test_damaged_descriptor_and_report_never_raise(place, byte, report):
    damaged = bytearray(DESCRIPTOR)
    damaged[place] = byte
    layout = codec.tracking_layout(codec.walk_descriptor(bytes(damaged)))
    if layout is not None:
        codec.decode_report(report.ljust(layout.size, b"\xff")[: layout.size], layout, SCREEN, 60)
    assert codec.decode_report(b"x" * 43, LAYOUT, SCREEN, 60.0) is None


def test_screen_size_and_mode_go_both_ways():
    rig = GazeRig(HidGaze, HidGazeSimulator, screen=Screen(400.0, 250.0), error=PERFECT)
    rig.start().run(0.5)

    assert rig.simulator.modes == [2]
    assert (
        codec.feature_value(
            rig.simulator.feature(0x12), REPORTS[codec.FEATURE, 0x12], codec.SCREEN_WIDTH
        )
        == 400_000
    )
    seen = rig.column("direction_head")[-1]
    np.testing.assert_allclose(seen, rig.body.direction, atol=1e-4)


def test_needed_calibration_is_blocking():
    rig = GazeRig(HidGaze, HidGazeSimulator, status=4).start()

    assert "needs its user calibrated" in rig.messages()


def test_device_without_gaze_is_refused():
    rig = GazeRig(HidGaze, HidGazeSimulator, descriptor=DESCRIPTOR[:2] + b"\xa1\x01\xc0")

    with pytest.raises(ProtocolViolation, match="describes no gaze point"):
        rig.driver.open(2.0)


class Usb:
    def __init__(self, **options):
        self.clock = SimClock()
        self.simulator = HidGazeSimulator(
            FixatingBody(5.0, 3.0), clock=self.clock, seed=1, error=PERFECT
        )
        self.library = FakeHidapi(self.simulator, self.clock)

    def driver(self, serial=""):
        wire = HidReports(serial, self.clock, library=self.library, is_simulated=True)
        return HidGaze("eyes", wire, self.clock)


def test_hidapi_surface_keeps_the_contract():
    usb = Usb()

    gaze_rigs.keeps_the_contract(usb.driver, gaze_rigs.let_pass_on(usb.clock))


def test_tracker_is_found_by_serial_and_named():
    usb = Usb()
    driver = usb.driver(SERIAL)
    driver.open(2.0)
    assert driver.info.serial == SERIAL
    assert driver.info.transport == "hid 2104:0124 SIM12"
    with pytest.raises(DeviceNotFound, match=r"no HID eye tracker 'other' \(found: SIM12\)"):
        usb.driver("other").open(2.0)


def test_unplugged_tracker_comes_back_within_two_seconds():
    usb = Usb()
    driver = usb.driver()
    driver.open(2.0)
    batches = []
    pump = Pump(driver, batches.append, usb.clock)
    pump.start()
    back_ns = gaze_rigs.lose_for(usb.simulator, usb.clock, 5.0)
    gaze_rigs.step_until(usb.clock, pump, lambda: driver.state is DeviceState.FAULT)
    gaze_rigs.step_until(usb.clock, pump, lambda: driver.state is DeviceState.STREAMING)
    pump.step()

    assert pump.take_events()[-1].kind == "reconnected"
    assert usb.clock.now_ns() - back_ns < 2 * NS_PER_S


def test_foreign_module_of_the_same_name_is_refused(monkeypatch):
    monkeypatch.setattr(libraries.importlib, "import_module", lambda name: struct)

    with pytest.raises(DeviceNotFound, match="pip uninstall hid"):
        HidGaze("eyes", HidReports("", SimClock()), SimClock()).open(1.0)
