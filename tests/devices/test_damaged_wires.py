"""Whatever comes over a wire, a driver delivers it, counts it or refuses it with a remedy."""

from contextlib import ExitStack

import msgpack
import numpy as np
import pytest

from tests.wire.record import FOLDER
from visavis.devices.building import build_device
from visavis.devices.byte_links import Chunk
from visavis.devices.captures import device_of
from visavis.devices.registry import built_in
from visavis.devices.wirelog import ReplayLink, ReplayTransport, read_wire_log
from visavis.devices.wires import ReplayedWires
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import DeviceError

STORED = sorted(path.stem for path in FOLDER.glob("*.wire"))
SEEDS = range(8)
DAMAGED_01 = (0.05, 0.5)
NONSENSE = tuple(
    msgpack.packb(value)
    for value in ([], {}, None, -1, 1e300, float("nan"), "x", [None] * 8, [[None]], {"a": [1]})
)


class Damage:
    """Cut, flip, swap or drop a share of what comes, drawn from a seed."""

    def __init__(self, seed):
        self._rng = np.random.default_rng(seed)
        self._share = DAMAGED_01[seed % 2]
        self.count = 0

    def of_bytes(self, data):
        rng = self._rng
        self.count += 1
        kind = rng.integers(5)
        if kind == 0:
            return data[: rng.integers(len(data) + 1)]
        if kind == 1:
            return rng.bytes(len(data))
        if kind == 2:
            return NONSENSE[rng.integers(len(NONSENSE))]
        if kind == 3:
            return data + rng.bytes(3)
        flipped = bytearray(data)
        for at in rng.integers(0, len(data), min(len(data), 3)) if data else ():
            flipped[at] ^= 1 << int(rng.integers(8))
        return bytes(flipped)

    def of_frames(self, frames):
        rng = self._rng
        if rng.random() > self._share:
            return frames
        if rng.random() < 0.15:
            return frames[: rng.integers(1, len(frames) + 1)]
        which = rng.integers(len(frames))
        return tuple(self.of_bytes(f) if i == which else f for i, f in enumerate(frames))

    def of_chunk(self, data):
        return data if self._rng.random() > self._share else self.of_bytes(data)


def damaged_wires(path, clock, damage):
    class Messages(ReplayTransport):
        def request(self, frames, timeout_s):
            exchange = super().request(frames, timeout_s)
            return type(exchange)(
                damage.of_frames(exchange.frames), exchange.t_send_ns, exchange.t_receive_ns
            )

        def receive(self, timeout_s):
            return [
                m._replace(frames=damage.of_frames(m.frames)) for m in super().receive(timeout_s)
            ]

    class Bytes(ReplayLink):
        def read(self, timeout_s):
            return [Chunk(c.t_host_ns, damage.of_chunk(c.data)) for c in super().read(timeout_s)]

    class Wires(ReplayedWires):
        def messages(self, role, make):
            return Messages(path, clock)

        def link(self, role, make):
            return Bytes(path, clock)

    return Wires(path, clock)


@pytest.mark.parametrize("driver", STORED)
def test_damage_is_survived_or_refused_with_a_remedy(driver):
    path = FOLDER / f"{driver}.wire"
    config = device_of(path, read_wire_log(path))
    damaged, without_remedy = 0, []
    for seed in SEEDS:
        clock, damage = SimClock(3600 * NS_PER_S), Damage(seed)
        with ExitStack() as stack:
            wires = damaged_wires(path, clock, damage)
            device = build_device(config, clock, None, 1, stack, wires)
            for _ in range(40):
                try:
                    use(device, clock)
                except DeviceError as problem:
                    without_remedy += [] if problem.remedy else [repr(problem)]
            device.close()
        damaged += damage.count
    assert damaged or built_in()[driver].wire.carries == "bytes"  # a band may have nothing to say
    assert without_remedy == []


def use(device, clock):
    """Do what is due in the device's life, one step of session time."""
    clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 100)
    if device.state == "closed":
        device.open(0.5)
    elif device.state == "open":
        device.start(lambda batch: None)
    else:
        if hasattr(device, "wait_frame"):
            device.submit(device.wait_frame(), ())
        if hasattr(device, "set_amplitudes"):
            device.set_amplitudes([0.5] * device.motor_count, 100)
            device.keep_alive()
        device.poll(0.0)
        device.check()
        device.health()
