"""A device that tells a sample per line: damaged lines are counted, never raised, never kept."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.devices.byte_links import Chunk, MemoryLink
from visavis.devices.drivers.streaming.line_device import Line, LineDevice
from visavis.devices.faults import FaultSchedule
from visavis.devices.options import Options
from visavis.devices.pump import Pump
from visavis.devices.sim.line_peer import LinePeer
from visavis.devices.spec import DriverSpec, Product
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock
from visavis.lab.errors import DeviceTimeout
from visavis.lab.schema import Field

SPEC = DriverSpec(name="scale", kind="other", options=Options, product=Product(model="scale"))


class Scale(LineDevice):
    spec = SPEC
    rate_hz = 2.0
    columns = (Field("load", "f4", "N"), Field("count", "u2", "1"))

    def read(self, line):
        kind, ms, *numbers = line.split()
        return Line(int(ms) * NS_PER_MS, [float(n) for n in numbers]) if kind == b"L" else None


class ScalePeer(LinePeer):
    rate_hz = 2.0

    def line(self, t_s, t_device_ns, rng):
        return b"L %d %.2f %d" % (t_device_ns // NS_PER_MS, t_s, round(t_s * 2))


class Said:
    """A device that has said these bytes at once."""

    def __init__(self, data):
        self._data = [Chunk(0, data)]

    def connect(self, t_ns):
        pass

    def accept(self, data, t_ns):
        pass

    def outgoing(self, until_ns):
        said, self._data = self._data, []
        return said


def running(faults=(), seconds=10.0):
    clock = SimClock()
    peer = ScalePeer("scale", clock, seed=3, faults=FaultSchedule.from_config(faults))
    device = Scale("scale", MemoryLink(peer, clock), clock)
    device.open(5.0)
    batches = []
    pump = Pump(device, batches.append, clock)
    pump.start()
    told = []
    for _ in range(round(seconds * 50)):
        clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 50)
        pump.step()
        told += [event.kind for event in pump.take_events()]
    return device, batches, told


def column(batches, name):
    return np.concatenate([batch.values[name] for batch in batches])


def test_numbers_lie_in_their_columns_under_the_devices_own_time():
    _, batches, told = running()
    assert column(batches, "load").tolist() == [t / 2 for t in range(1, 21)]
    assert column(batches, "count").tolist() == list(range(1, 21))
    device_ns = np.concatenate([batch.t_device_ns for batch in batches])
    assert np.diff(device_ns).tolist() == [NS_PER_S // 2] * 19
    assert told == []


def test_a_device_of_two_samples_a_second_is_not_taken_for_silent_but_unplugging_is_told():
    faults = [{"kind": "disconnect", "start_s": 3, "duration_s": 2}]
    _, batches, told = running(faults)
    assert [told.count(kind) for kind in ("silent", "disconnected", "reconnected")] == [0, 1, 1]
    assert batches[-1].values["load"][-1] == 10.0


def test_damaged_lines_leave_a_hole_and_are_told():
    device, batches, _ = running([{"kind": "garbage", "amount": 0.3}], 30.0)
    seq = np.concatenate([batch.seq for batch in batches])
    lost = int(seq[-1] - seq[0]) + 1 - seq.size
    assert lost > 5
    assert "lines could not be read" in device.check()[0].message
    assert set(np.diff(column(batches, "load")).tolist()) <= {0.5 * k for k in range(1, 12)}


def test_lines_that_are_no_samples_are_waited_through_until_the_deadline():
    clock = SimClock()
    device = Scale("scale", MemoryLink(Said(b"boot ok\nversion 3\n"), clock), clock)
    with pytest.raises(DeviceTimeout, match="18 bytes came, but no sample"):
        device.open(1.0)
    with pytest.raises(DeviceTimeout, match="the device says nothing"):
        device.open(1.0)


GOOD = b"L 1 2.5 3\n"


@given(st.binary(max_size=60), st.integers(1, 9))
@settings(max_examples=300, deadline=None)
def test_whatever_comes_nothing_raises_and_good_lines_survive(noise, cut):
    clock = SimClock()
    device = Scale("scale", MemoryLink(Said(GOOD), clock), clock)
    device.open(1.0)
    batches = []
    device.start(batches.append)
    data = noise + b"\n" + GOOD
    for start in range(0, len(data), cut):
        device._take(_messages(data[start : start + cut], clock))
    assert batches[-1].values["load"][-1] == 2.5


def _messages(data, clock):
    from visavis.devices.transports import Message

    return [Message(clock.now_ns(), (data,))]


@pytest.mark.parametrize(
    "line",
    [
        b"L 1 2.5",
        b"L 1 2.5 3 4",
        b"L 1 1e300 3",
        b"L 1 2.5 70000",
        b"L 1 2.5 0.5",
        b"L 1 2.5 nan",
        b"L 99999999999999999999999 1 1",
        b"L x 1 1",
        b"L 1 2,5 3",
    ],
)
def test_numbers_that_have_no_place_are_damage(line):
    device = Scale("scale", MemoryLink(Said(b""), SimClock()), SimClock())
    device._prepare()
    assert device._sample(line, 0) is None
    assert device._malformed == 1


def test_a_number_that_is_not_known_is_missing():
    device = Scale("scale", MemoryLink(Said(b""), SimClock()), SimClock())
    device._prepare()
    assert math.isnan(device._sample(b"L 1 nan 3", 7).numbers[0])


class Chatty(Scale):
    def read(self, line):
        return Line(None, (1.0, 2.0))


def test_without_a_time_of_its_own_a_sample_is_stamped_when_it_arrives():
    device = Chatty("scale", MemoryLink(Said(b""), SimClock()), SimClock())
    device._prepare()
    assert device._sample(b"x", 77).t_device_ns == 77
