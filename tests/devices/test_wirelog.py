"""A wire log plays back the same samples, and survives being cut."""

import msgpack
import numpy as np
import pytest

from tests.devices.rigs import Rig
from visavis.devices.drivers.pupil.driver import PupilCore
from visavis.devices.wirelog import ReplayTransport, TeeTransport, read_wire_log
from visavis.lab.clock import SimClock
from visavis.lab.errors import DataError, DeviceNotFound


def recorded(path):
    rig = Rig(wrap=lambda wire, clock: TeeTransport(wire, path, clock)).start().run(2.0)
    rig.pump.stop()
    rig.driver.close()
    return rig


def test_replay_delivers_what_was_recorded(tmp_path):
    rig = recorded(tmp_path / "a.wire")
    clock, got = SimClock(77), []
    driver = PupilCore("eyes", ReplayTransport(tmp_path / "a.wire", clock), clock)
    driver.open(1.0)
    driver.start(got.append)
    for k in range(300):
        clock.sleep_until_ns(77 + k * 10**7)
        driver.poll(0.0)

    values = np.concatenate([batch.values for batch in got])
    np.testing.assert_array_equal(values, np.concatenate([b.values for b in rig.batches]))
    device_ns = np.concatenate([batch.t_device_ns for batch in got])
    np.testing.assert_array_equal(device_ns, rig.stamps("t_device_ns"))
    assert len(driver.clock_pairs()) == len(rig.driver.clock_pairs())


def test_log_says_that_its_wire_was_simulated(tmp_path):
    recorded(tmp_path / "a.wire")

    log = read_wire_log(tmp_path / "a.wire")

    assert log.is_simulated
    assert log.transport == "memory"
    assert log.sent_messages


def test_log_cut_anywhere_reads_up_to_its_last_whole_record(tmp_path):
    recorded(tmp_path / "a.wire")
    whole = (tmp_path / "a.wire").read_bytes()
    count = len(read_wire_log(tmp_path / "a.wire").messages)

    for cut in range(len(whole) - 3000, len(whole), 37):
        (tmp_path / "cut.wire").write_bytes(whole[:cut])
        assert count - 3 <= len(read_wire_log(tmp_path / "cut.wire").messages) <= count


@pytest.mark.parametrize("content", [b"", b"\xc1", msgpack.packb({"format": "other"}), b"hello"])
def test_file_that_is_no_log_is_refused(tmp_path, content):
    path = tmp_path / "x.wire"
    path.write_bytes(content)

    with pytest.raises(DataError, match="not a wire log"):
        read_wire_log(path)


def test_missing_log_is_named(tmp_path):
    clock = SimClock()

    with pytest.raises(DeviceNotFound, match=r"gone\.wire"):
        ReplayTransport(tmp_path / "gone.wire", clock).open(1.0)
