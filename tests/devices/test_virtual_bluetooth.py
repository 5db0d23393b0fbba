"""Our armband on a virtual radio: RFCOMM or GATT on one side, pyserial on the other."""

import contextlib

import pytest

from tests.devices.band_makers import spp_armband
from visavis.devices import conformance
from visavis.devices.contracts import HAPTICS, DeviceState
from visavis.devices.sim.armband.simulator import ArmbandSimulator
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.errors import DeviceDisconnected

ON = (1.0, 0.5, 0.0, 0.25)
CLOCK = SystemClock()
either = pytest.mark.parametrize("kind", ["classic", "le"])


@pytest.fixture
def radio():
    pytest.importorskip("bumble", reason="bumble is not installed: pip install bumble")
    pytest.importorskip("serial", reason="pyserial is not installed: pip install pyserial")
    pytest.importorskip("tty", reason="pseudo-terminals need Linux or macOS")
    from tests.devices.wire_ends.virtual_bluetooth import VirtualBluetooth

    with contextlib.ExitStack() as stack:

        def join(kind):
            peer = ArmbandSimulator("arm", CLOCK, seed=1, latency_ms=0, jitter_ms=0)
            return peer, stack.enter_context(VirtualBluetooth(peer, CLOCK, kind))

        yield join


def poll_until(driver, holds, seconds=8.0):
    end_ns = CLOCK.now_ns() + round(seconds * NS_PER_S)
    while not holds():
        assert CLOCK.now_ns() < end_ns, "it did not happen in time"
        driver.keep_alive()
        driver.poll(0.02)


@either
def test_command_is_acknowledged_and_the_band_left_silent(radio, kind):
    peer, host = radio(kind)
    driver = spp_armband("arm", CLOCK, port=host.port)
    batches = []

    driver.open(5.0)
    driver.start(batches.append)
    number = driver.set_amplitudes(ON, 5000)

    def acknowledged():
        rows = [row for b in batches if b.schema is HAPTICS for row in b.values]
        return any(row["command"] == number and row["acknowledged"] for row in rows)

    poll_until(driver, acknowledged)
    assert peer.firmware.is_running
    driver.close()

    assert not any(peer.firmware.duties)
    if kind == "classic":
        assert host.found_channel == 4


@either
def test_lost_connection_is_told(radio, kind):
    _, host = radio(kind)
    driver = spp_armband("arm", CLOCK, port=host.port)
    driver.open(5.0)
    driver.start(lambda batch: None)

    host.drop()

    with pytest.raises(DeviceDisconnected, match="arm"):
        poll_until(driver, lambda: False)
    assert driver.state is DeviceState.FAULT
    driver.close()


@either
def test_wireless_armband_keeps_the_life_of_a_device(radio, kind):
    _, host = radio(kind)

    def let_pass(seconds):
        CLOCK.sleep_until_ns(CLOCK.now_ns() + round(seconds * NS_PER_S))

    conformance.check_lifecycle(lambda: spp_armband("arm", CLOCK, port=host.port), let_pass)
