"""The real bleak over a fake BlueZ on a private D-Bus: find, connect, notify, lose, come back."""

import asyncio
import contextlib
import shutil
import sys

import pytest

from tests.devices.band_makers import ble_armband, neosensory_buzz, vhp_slim
from visavis.devices import conformance
from visavis.devices.byte_links import MemoryLink
from visavis.devices.contracts import HAPTICS, DeviceState
from visavis.devices.drivers.armband.spec import BleArmbandOptions
from visavis.devices.drivers.links.ble import BleLink, BleThread
from visavis.devices.sim.armband.simulator import ArmbandSimulator
from visavis.devices.sim.bands.buzz import BuzzSimulator
from visavis.devices.sim.bands.vhp import SlimBoardSimulator
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound, DeviceTimeout

ON = (1.0, 0.5, 0.0, 0.25)
CLOCK = SystemClock()


async def leave_bus():
    """Close the connection that bleak keeps for as long as its event loop lives."""
    from bleak.backends.bluezdbus import manager

    found = manager._global_instances.pop(asyncio.get_running_loop(), None)
    if found is not None and found._bus is not None:
        found._bus.disconnect()
        await found._bus.wait_for_disconnect()


@pytest.fixture
def bluez(monkeypatch):
    """Give a function that puts a simulator behind a BlueZ of its own, and a thread for links."""
    if shutil.which("dbus-daemon") is None:
        pytest.skip("dbus-daemon is not installed: apt install dbus")
    pytest.importorskip("dbus_fast", reason="dbus-fast is not installed: pip install dbus-fast")
    pytest.importorskip("bleak", reason="bleak is not installed: pip install bleak")
    from tests.devices.wire_ends.fake_bluez import FakeBluez, PrivateBus

    with contextlib.ExitStack() as stack:
        bus = stack.enter_context(PrivateBus())
        monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", bus.address)

        def serve(peer, **options):
            host = stack.enter_context(FakeBluez(bus.address, peer, CLOCK, **options))
            thread = BleThread()
            stack.callback(thread.close)
            stack.callback(lambda: thread.begin(leave_bus()).result(5.0))
            host.thread = thread
            return host

        yield serve


def poll_until(driver, holds, *, seconds=8.0):
    end_ns = CLOCK.now_ns() + round(seconds * NS_PER_S)
    while not holds():
        assert CLOCK.now_ns() < end_ns, "it did not happen in time"
        driver.keep_alive()
        with contextlib.suppress(DeviceDisconnected):
            driver.poll(0.02)


def test_buzz_is_found_by_name_and_vibrates_over_split_packets(bluez):
    peer = BuzzSimulator("arm", CLOCK)
    host = bluez(peer, name="Buzz 1234")
    link = BleLink(CLOCK, name="Buzz", is_simulated=True, thread=host.thread)
    driver = neosensory_buzz("arm", CLOCK, link=link)
    batches = []

    driver.open(8.0)
    driver.start(batches.append)
    driver.set_amplitudes(ON, 2000)
    poll_until(driver, lambda: peer.levels_01[0] == 1.0)
    assert peer.levels_01 == pytest.approx(ON, abs=0.01)
    assert max(map(len, host.packets)) == 20
    poll_until(driver, lambda: driver.health().battery_01 == 0.76)
    driver.close()

    assert not any(peer.levels_01)
    assert driver.info.serial == "BZ-0042"
    assert "motors stop" in peer.commands


def test_lost_band_comes_back_silent(bluez):
    peer = BuzzSimulator("arm", CLOCK)
    host = bluez(peer)
    link = BleLink(CLOCK, address="AA:BB:CC:DD:EE:01", thread=host.thread)
    driver = neosensory_buzz("arm", CLOCK, link=link)
    driver.open(8.0)
    driver.start(lambda batch: None)
    driver.set_amplitudes(ON, 10_000)
    poll_until(driver, lambda: any(peer.levels_01))

    host.is_near = False
    host.drop()
    poll_until(driver, lambda: driver.state is DeviceState.FAULT)
    for _ in range(20):
        driver.poll(0.01)
    assert driver.state is DeviceState.FAULT
    host.is_near = True
    poll_until(driver, lambda: driver.state is DeviceState.STREAMING)
    poll_until(driver, lambda: not any(peer.levels_01))
    driver.close()

    assert not any(peer.levels_01)


def test_slim_board_gets_each_message_in_one_packet(bluez):
    peer = SlimBoardSimulator("arm", CLOCK)
    host = bluez(peer, name="Slim", mtu=247)
    link = BleLink(CLOCK, name="Slim", splits=False, thread=host.thread)
    driver = vhp_slim("arm", CLOCK, link=link)

    driver.open(8.0)
    driver.start(lambda batch: None)
    driver.set_amplitudes(ON, 5000)
    poll_until(driver, lambda: any(peer.levels_01))
    driver.close()

    assert peer.invalid == 0
    assert {4 + packet[3] for packet in host.packets} == {len(p) for p in host.packets}
    assert not any(peer.levels_01)


def test_message_longer_than_a_packet_is_refused_where_it_must_not_be_cut(bluez):
    peer = SlimBoardSimulator("arm", CLOCK)
    host = bluez(peer, name="Slim", mtu=23)
    link = BleLink(CLOCK, name="Slim", splits=False, thread=host.thread)
    link.open(8.0)

    with pytest.raises(DeviceError, match=r"30 bytes does not fit a packet of 20"):
        link.write(bytes(30))
    link.close()


def test_absent_band_runs_into_the_deadline_and_is_found_later(bluez):
    host = bluez(BuzzSimulator("arm", CLOCK))
    host.is_near = False
    link = BleLink(CLOCK, name="Buzz", thread=host.thread)

    with pytest.raises(DeviceTimeout, match="switch the device on"):
        link.open(0.3)
    link.close()
    host.is_near = True
    link.open(8.0)
    link.close()


def test_other_name_is_not_taken(bluez):
    host = bluez(BuzzSimulator("arm", CLOCK), name="Fuzz 1")
    link = BleLink(CLOCK, name="Buzz", thread=host.thread)

    with pytest.raises(DeviceTimeout):
        link.open(0.5)


HM_10 = tuple(f"0000ffe{n}-0000-1000-8000-00805f9b34fb" for n in (0, 1, 1))
OWN = tuple(f"1234000{n}-0000-4000-8000-000000000000" for n in (0, 1, 2))


@pytest.mark.parametrize(
    ("uuids", "options"),
    [
        (HM_10, {}),  # the module of the parts list: one characteristic for both ways
        (HM_10, {"write_uuid": "FFE1", "notify_uuid": "FFE1"}),
        (OWN, {"write_uuid": OWN[1].upper(), "notify_uuid": OWN[2]}),
    ],
)
def test_armband_answers_over_any_serial_service(bluez, uuids, options):
    peer = ArmbandSimulator("arm", CLOCK, seed=1)
    host = bluez(peer, name="Visavis arm", uuids=uuids)
    given = BleArmbandOptions(name="Visavis", **options)
    link = BleLink(
        CLOCK,
        name=given.name,
        write_uuid=given.write_uuid,
        notify_uuid=given.notify_uuid,
        thread=host.thread,
    )
    driver = ble_armband("arm", CLOCK, link=link)

    driver.open(8.0)
    driver.close()

    assert driver.info.serial


def test_unknown_service_is_named_with_what_to_give(bluez):
    host = bluez(BuzzSimulator("arm", CLOCK), uuids=OWN)
    link = BleLink(CLOCK, name="Buzz", thread=host.thread)

    with pytest.raises(DeviceNotFound, match=rf"its services: {OWN[0]}; give write_uuid"):
        link.open(8.0)


def test_two_bands_of_one_name_are_refused_and_an_address_chooses(bluez):
    peer = BuzzSimulator("arm", CLOCK)
    host = bluez(peer, others=[("Buzz 99", "AA:BB:CC:DD:EE:02")])

    with pytest.raises(DeviceNotFound, match=r"2 Bluetooth devices .*Buzz 1234 .*Buzz 99 .*02\)"):
        BleLink(CLOCK, name="Buzz", thread=host.thread).open(8.0)
    link = BleLink(CLOCK, address="AA:BB:CC:DD:EE:01", thread=host.thread)
    link.open(8.0)
    link.close()


def test_computer_without_bluetooth_is_told(monkeypatch):
    pytest.importorskip("bleak", reason="bleak is not installed: pip install bleak")
    monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nowhere/bus")
    thread = BleThread()
    link = BleLink(CLOCK, name="Buzz", thread=thread)

    with pytest.raises(DeviceNotFound, match="switch Bluetooth on"):
        link.open(5.0)
    thread.close()


def test_ble_band_keeps_the_life_of_a_device(bluez):
    peer = BuzzSimulator("arm", CLOCK)
    host = bluez(peer)

    def make():
        link = BleLink(CLOCK, name="Buzz", thread=host.thread)
        return neosensory_buzz("arm", CLOCK, link=link)

    def let_pass(seconds):
        CLOCK.sleep_until_ns(CLOCK.now_ns() + round(seconds * NS_PER_S))

    conformance.check_lifecycle(make, let_pass)


def test_own_framed_protocol_runs_over_bluez(bluez):
    peer = ArmbandSimulator("arm", CLOCK, seed=1)
    host = bluez(peer, name="Visavis arm", mtu=64)
    link = BleLink(CLOCK, name="Visavis", thread=host.thread)
    driver = ble_armband("arm", CLOCK, link=link)
    batches = []

    driver.open(8.0)
    driver.start(batches.append)
    number = driver.set_amplitudes(ON, 5000)

    def commands():
        return [row for b in batches if b.schema is HAPTICS for row in b.values]

    poll_until(driver, lambda: any(row["acknowledged"] for row in commands()))
    poll_until(driver, lambda: peer.firmware.is_running)
    driver.close()

    assert any(row["command"] == number and row["acknowledged"] for row in commands())
    assert not any(peer.firmware.duties)
    assert len(driver.clock_pairs()) > 5


def test_own_armband_comes_back_after_the_radio_lost_it(bluez):
    peer = ArmbandSimulator("arm", CLOCK, seed=1)
    host = bluez(peer, name="Visavis arm", mtu=64)
    link = BleLink(CLOCK, name="Visavis", thread=host.thread)
    driver = ble_armband("arm", CLOCK, link=link)
    driver.open(8.0)
    driver.start(lambda batch: None)

    host.drop()
    poll_until(driver, lambda: driver.state is DeviceState.FAULT)
    poll_until(driver, lambda: driver.state is DeviceState.STREAMING)
    driver.close()


def test_same_bytes_reach_the_band_over_memory_and_over_bluez(bluez):
    lines = []
    for over_bluez in (False, True):
        peer = BuzzSimulator("arm", CLOCK)
        link = MemoryLink(peer, CLOCK)
        if over_bluez:
            host = bluez(peer)
            link = BleLink(CLOCK, name="Buzz", thread=host.thread)
        driver = neosensory_buzz("arm", CLOCK, link=link)
        driver.open(8.0)
        driver.close()
        peer.advance(CLOCK.now_ns() + NS_PER_S)
        lines.append(peer.commands)

    assert lines[0] == lines[1]


def test_missing_bleak_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "bleak", None)

    with pytest.raises(DeviceNotFound, match=r"pip install 'visavis\[ble\]'"):
        BleLink(CLOCK, name="Buzz").open(1.0)
