"""Reports over USB: the real pyusb over a backend of our own, hidapi's calls over a stand-in."""

from types import SimpleNamespace

import pytest

from tests.devices.band_makers import hid_armband, usb_armband
from tests.devices.other_band_rigs import LAYOUT
from tests.devices.wire_ends.usb_bus import FakeHidapi, FakeUsbBus
from visavis.devices.drivers.links.usb import HidLink, UsbLink
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.bands.plain import ReportBandSimulator
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound, DeviceTimeout

CLOCK = SystemClock()
IDS = {"vid": 0x1209, "pid": 0x0001}
ON = (1.0, 0.5, 0.0, 0.25)


def hid_bench(*faults):
    schedule = FaultSchedule.from_config(faults)
    peer = ReportBandSimulator("arm", CLOCK, latency_ms=0, faults=schedule)
    bus = FakeHidapi(peer, CLOCK, serial_number="B7", **IDS)
    return peer, bus, lambda **wanted: HidLink(CLOCK, library=bus, **{**IDS, **wanted})


def usb_bench(*faults):
    pytest.importorskip("usb", reason="pyusb is not installed: pip install pyusb")
    schedule = FaultSchedule.from_config(faults)
    peer = ReportBandSimulator("arm", CLOCK, latency_ms=0, faults=schedule, number=None)
    bus = FakeUsbBus(peer, CLOCK, serial_number="B7", **IDS)
    return peer, bus, lambda **wanted: UsbLink(CLOCK, backend=bus.backend(), **{**IDS, **wanted})


BENCHES = {"hid": (hid_bench, hid_armband), "usb": (usb_bench, usb_armband)}
either = pytest.mark.parametrize("bench", BENCHES)


@either
def test_band_is_found_vibrates_and_is_left_silent(bench):
    make, driver_of = BENCHES[bench]
    peer, _, link = make()
    driver = driver_of("arm", CLOCK, layout=LAYOUT, link=link(), **IDS)

    driver.open(2.0)
    driver.start(lambda batch: None)
    driver.set_amplitudes(ON, 5000)
    driver.poll(0.0)
    peer.advance(CLOCK.now_ns())
    assert peer.levels_01 == pytest.approx(ON, abs=0.01)
    peer.tell_battery(81, CLOCK.now_ns())
    driver.poll(0.05)
    assert driver.health().battery_01 == 0.81
    driver.close()
    peer.advance(CLOCK.now_ns())

    assert not any(peer.levels_01)
    assert peer.refused_count == 0


@either
def test_other_serial_number_is_not_taken(bench):
    _, _, link = BENCHES[bench][0]()

    with pytest.raises(DeviceNotFound, match="1209:0001 B8"):
        link(serial_number="B8").open(1.0)
    opened = link(serial_number="B7")
    opened.open(1.0)
    opened.close()


@either
def test_unplugged_band_is_disconnected_and_comes_back(bench):
    _, bus, link = BENCHES[bench][0]()
    opened = link()
    opened.open(1.0)

    bus.is_plugged = False
    with pytest.raises(DeviceDisconnected):
        opened.write(bytes(9))
    with pytest.raises(DeviceDisconnected):
        opened.read(0.01)
    opened.close()
    with pytest.raises(DeviceNotFound):
        opened.open(1.0)
    bus.is_plugged = True
    opened.open(1.0)
    assert list(opened.read(0.0)) == []
    opened.close()


def test_usb_band_that_takes_nothing_times_out():
    _, bus, link = usb_bench()
    opened = link()
    opened.open(1.0)
    bus.takes = False

    with pytest.raises(DeviceTimeout, match="takes nothing"):
        opened.write(bytes(8))
    opened.close()


@either
@pytest.mark.parametrize("serial_number", ["", "B7"])
def test_a_device_that_may_not_be_used_points_to_the_rules(bench, serial_number):
    _, bus, link = BENCHES[bench][0]()
    bus.is_allowed = False

    with pytest.raises(DeviceNotFound, match=r"udev rule .*visavis devices rules"):
        link(serial_number=serial_number).open(1.0)


def test_wrong_hid_library_is_told_apart(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "hid", SimpleNamespace(Device=object))

    with pytest.raises(DeviceNotFound, match="pip uninstall hid"):
        HidLink(CLOCK, **IDS).open(1.0)


@pytest.mark.parametrize(("library", "link"), [("hid", HidLink), ("usb.core", UsbLink)])
def test_missing_library_says_what_to_install(monkeypatch, library, link):
    monkeypatch.setitem(__import__("sys").modules, library, None)

    with pytest.raises(DeviceNotFound, match=r"pip install 'visavis\[usb\]'"):
        link(CLOCK, **IDS).open(1.0)


def test_closed_links_say_so():
    for link in (HidLink(CLOCK, **IDS), UsbLink(CLOCK, **IDS)):
        link.close()
        with pytest.raises(DeviceDisconnected, match="closed"):
            link.write(b"x")
    assert CLOCK.now_ns() > NS_PER_S // 10**9
