"""bHaptics over a real WebSocket: connect, play, lose the Player, find it again."""

import contextlib

import pytest

from tests.devices.band_makers import bhaptics
from visavis.devices import conformance
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.links.websocket import WebSocketLink
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.bands.bhaptics import BhapticsPlayerSimulator
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound

ON = (1.0, 0.5, 0.0, 0.25)
CLOCK = SystemClock()


@pytest.fixture
def serve():
    pytest.importorskip("websockets", reason="websockets is not installed: pip install websockets")
    from tests.devices.wire_ends.websocket_host import WebSocketHost

    with contextlib.ExitStack() as stack:

        def start(*faults):
            schedule = FaultSchedule.from_config(faults)
            peer = BhapticsPlayerSimulator("arm", CLOCK, faults=schedule)
            return peer, stack.enter_context(WebSocketHost(peer, CLOCK))

        yield start


def poll_until(driver, holds, seconds=5.0):
    end_ns = CLOCK.now_ns() + round(seconds * NS_PER_S)
    while not holds():
        assert CLOCK.now_ns() < end_ns, "it did not happen in time"
        driver.keep_alive()
        with contextlib.suppress(DeviceDisconnected):
            driver.poll(0.02)


def test_player_plays_frames_for_as_long_as_they_are_sent(serve):
    peer, host = serve()
    driver = bhaptics("arm", CLOCK, port=host.port)

    driver.open(5.0)
    driver.start(lambda batch: None)
    driver.set_amplitudes(ON, 400)
    poll_until(driver, lambda: peer.levels_01[0] == 1.0)
    poll_until(driver, lambda: not any(peer.levels_01))
    driver.close()

    assert (1.0, 0.0, 0.5, 0.0, 0.0, 0.25) in [levels for _, levels in peer.log]
    assert host.paths == ["/v2/feedbacks?app_id=visavis&app_name=Visavis"]
    assert peer.refusals == []


def test_player_that_leaves_is_found_again(serve):
    peer, host = serve()
    driver = bhaptics("arm", CLOCK, port=host.port)
    driver.open(5.0)
    driver.start(lambda batch: None)

    peer._faults = FaultSchedule.from_config([{"kind": "disconnect"}])
    poll_until(driver, lambda: driver.state is DeviceState.FAULT)
    peer._faults = FaultSchedule()
    poll_until(driver, lambda: driver.state is DeviceState.STREAMING)
    driver.close()


def test_bhaptics_on_a_real_socket_keeps_the_life_of_a_device(serve):
    _, host = serve()

    def let_pass(seconds):
        CLOCK.sleep_until_ns(CLOCK.now_ns() + round(seconds * NS_PER_S))

    conformance.check_lifecycle(lambda: bhaptics("arm", CLOCK, port=host.port), let_pass)


def test_absent_player_is_named_with_the_cure():
    pytest.importorskip("websockets", reason="websockets is not installed: pip install websockets")
    with pytest.raises(DeviceNotFound, match="start the bHaptics Player"):
        bhaptics("arm", CLOCK, port=9).open(1.0)


def test_missing_library_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "websockets", None)

    with pytest.raises(DeviceNotFound, match=r"pip install 'visavis\[bhaptics\]'"):
        WebSocketLink("ws://localhost:1", CLOCK, remedy="x").open(1.0)
