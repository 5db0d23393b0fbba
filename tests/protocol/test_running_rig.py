"""What a session's devices tell the operator together."""

from collections.abc import Callable

import pytest

from tests.devices.test_pump import ToyDevice
from visavis.devices import pump as pump_module
from visavis.lab.clock import SimClock
from visavis.lab.errors import DeviceDisconnected
from visavis.lab.schema import SampleBatch
from visavis.protocol.session.rig import Rig, RunningRig


class OpenedToy(ToyDevice):
    """A toy that can be opened and closed."""

    def open(self, deadline_s: float) -> None: ...

    def close(self) -> None: ...


def running(toy: OpenedToy, sink: Callable[[str, SampleBatch], None]) -> RunningRig:
    rig = RunningRig(Rig(toy, None, {}), toy.clock, sink)
    rig.__enter__()
    rig.start()
    return rig


def test_samples_the_session_did_not_take_are_counted_as_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pump_module, "QUEUE_BATCHES", 5)
    toy, taken = OpenedToy(SimClock()), []
    rig = running(toy, lambda role, batch: taken.append(batch))
    for _ in range(8):
        toy.poll(0.0)

    rig.step()

    health = rig.health()["headset"]
    assert 5 == len(taken)
    assert 4 == health.dropped
    assert 9 == health.received


def test_devices_that_came_back_are_counted() -> None:
    clock = SimClock()
    toy = OpenedToy(clock, ["data", DeviceDisconnected("gone"), "data"])
    rig = running(toy, lambda role, batch: None)
    for _ in range(200):
        clock.sleep_until_ns(clock.now_ns() + 10_000_000)
        rig.step()

    assert 1 == rig.health()["headset"].reconnects
