"""Sensors on Bluetooth LE: the documents' bytes, missing values, and bleak over a BlueZ of ours."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices.test_ble_link import bluez as bluez
from visavis.devices.byte_links import MemoryLink
from visavis.devices.drivers.ble_sensor import codec
from visavis.devices.drivers.ble_sensor.driver import BleSensor
from visavis.devices.drivers.ble_sensor.spec import BleSensorOptions
from visavis.devices.drivers.links.ble import BleLink
from visavis.devices.faults import FaultSchedule
from visavis.devices.pump import Pump
from visavis.devices.registry import driver_wiring
from visavis.devices.sim.ble_sensor import BleSensorSimulator
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock
from visavis.lab.errors import ConfigError, DataError, DeviceTimeout

HEART_RATE_SERVICE = "0000180d-0000-1000-8000-00805f9b34fb"
POLAR_SERVICE = "fb005c80-02e7-f387-1cad-8acd2d8df0c8"


@pytest.mark.parametrize(
    ("packet", "rows"),
    [
        ("0048", [(72.0, np.nan, np.nan)]),  # 8 bits, nothing else
        ("06 48", [(72.0, np.nan, 1.0)]),  # contact is told, and there
        ("04 00", [(np.nan, np.nan, 0.0)]),  # contact is told, and not there
        ("01 2c01", [(300.0, np.nan, np.nan)]),  # 16 bits
        ("16 48 0004", [(72.0, 1000.0, 1.0)]),  # an interval of 1024/1024 s
        ("1e 48 3412 0002 0003", [(72.0, 500.0, 1.0), (72.0, 750.0, 1.0)]),  # after energy
    ],
)
def test_heart_rate_is_read_by_its_flags(packet, rows):
    found = [row.numbers for row in codec.read_heart_rate(bytes.fromhex(packet))]

    np.testing.assert_array_equal(np.array(found), np.array(rows))


def test_beats_of_one_packet_are_dated_back_by_the_intervals_after_them():
    rows = codec.read_heart_rate(bytes.fromhex("10 48 0002 0003 0004"))

    assert [row.before_ns for row in rows] == [1_750_000_000, 1_000_000_000, 0]


@pytest.mark.parametrize("packet", ["", "16", "10 48", "10 48 00", "01 48", "08 48"])
def test_cut_heart_rate_is_refused(packet):
    with pytest.raises(DataError):
        codec.read_heart_rate(bytes.fromhex(packet))


def test_start_of_the_ecg_is_polars_own():
    assert codec.START_ECG == bytes.fromhex("02 00 00 01 82 00 01 01 0e 00")


def test_ecg_is_signed_microvolts_with_the_time_of_the_last_sample():
    packet = bytes.fromhex("00 ea54a2428b455208 00 ffffff 010000 000080 ffff7f")
    rows = codec.read_polar_ecg(packet)

    assert [row.numbers[0] for row in rows] == [-1.0, 1.0, -8388608.0, 8388607.0]
    assert rows[-1].t_device_ns == 599_618_164_814_402_794  # as the document says of these bytes
    assert rows[-1].t_device_ns - rows[0].t_device_ns == 3 * NS_PER_S // 130


def test_refusal_of_the_strap_is_told_in_words():
    assert codec.read_polar_ecg(bytes.fromhex("f0 02 00 00 00")) == ()
    with pytest.raises(DataError, match="packets of this adapter are too short"):
        codec.read_polar_ecg(bytes.fromhex("f0 02 00 0a 00"))


@given(st.binary(max_size=300))
def test_any_packet_is_read_or_refused(packet):
    own = codec.own_profile([codec.Column("x", 1, "f4")], "", "", b"", 0.0)
    for read in (codec.read_heart_rate, codec.read_polar_ecg, own.read):
        try:
            for row in read(packet):
                assert all(abs(n) < 2**63 or n != n for n in row.numbers) or read is own.read
        except DataError:
            pass


@pytest.mark.parametrize(
    ("kind", "big", "packet", "number"),
    [
        ("u2", False, "00 0102", 513.0),
        ("u2", True, "00 0102", 258.0),
        ("i3", False, "00 feffff", -2.0),
        ("f4", False, "00 0000803f", 1.0),
    ],
)
def test_own_column_is_read_where_it_stands(kind, big, packet, number):
    column = codec.Column("x", 1, kind, factor=2.0, is_big_endian=big)

    assert column.number(bytes.fromhex(packet)) == 2 * number


def recorded(clock, link, profile, seconds, **options):
    batches = []
    device = BleSensor("heart", link, clock, profile=profile, **options)
    device.open(5.0)
    pump = Pump(device, batches.append, clock)
    pump.start()
    until_ns = clock.now_ns() + round(seconds * NS_PER_S)
    while clock.now_ns() < until_ns:
        clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 50)
        pump.step()
    pump.stop()
    faults = device.check()
    device.close()
    values = np.concatenate([batch.values for batch in batches])
    return values, np.concatenate([batch.t_device_ns for batch in batches]), faults


def simulated(profile, *faults):
    clock = SimClock()
    peer = BleSensorSimulator(
        "heart", clock, profile=profile, seed=1, faults=FaultSchedule.from_config(faults)
    )
    return clock, MemoryLink(peer, clock)


def test_ecg_comes_at_130_hz_without_gaps():
    values, stamps, faults = recorded(*simulated("polar_ecg"), codec.POLAR_ECG, 10.0)

    assert len(values) == pytest.approx(1300, abs=80)
    steps = np.diff(stamps)
    assert steps.min() > 0.9 * NS_PER_S / 130
    assert steps.max() < 1.1 * NS_PER_S / 130
    assert not faults
    assert values["ecg_uv"].max() > 900


def test_lost_packet_of_the_ecg_is_a_gap_that_is_told():
    fault = {"kind": "loss", "amount": 0.3}
    _, _, faults = recorded(*simulated("polar_ecg", fault), codec.POLAR_ECG, 20.0)

    assert "gaps in the stream" in " ".join(fault.message for fault in faults)


def test_strap_that_refuses_its_ecg_says_why():
    clock, link = simulated("polar_ecg")
    wrong = codec.POLAR_ECG.__class__(**{**codec.POLAR_ECG.__dict__, "hello": b"\x02\x00\x01"})

    with pytest.raises(DeviceTimeout, match="refuses to send its ECG: invalid command"):
        BleSensor("heart", link, clock, profile=wrong).open(2.0)


def test_heart_rate_is_about_the_hearts():
    values, _, _ = recorded(*simulated("heart_rate"), codec.HEART_RATE, 20.0)

    assert values["heart_rate"].mean() == pytest.approx(68, abs=2)
    assert values["interval_ms"].mean() == pytest.approx(60_000 / 68, abs=40)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"profile": "own"}, "needs notify_uuid and columns"),
        ({"profile": "heart_rate", "notify_uuid": "FFE1"}, "write profile: own"),
        ({"name": ""}, "give the device's address or the name"),
    ],
)
def test_half_described_sensor_is_refused(options, problem):
    with pytest.raises(ConfigError, match=problem):
        driver_wiring("ble_sensor").spec.checked_options("heart", options)


def test_sensor_of_a_labs_own_is_described_by_options():
    options = BleSensorOptions(
        profile="own",
        name="Belt",
        notify_uuid="FFE1",
        rate_hz=25.0,
        columns=[{"name": "stretch", "at": 0, "kind": "u2", "unit": "1", "factor": 0.001}],
    )
    link = driver_wiring("ble_sensor").on_wire("breath", SimClock(), **options.model_dump())

    (schema,) = link.describe()
    assert [(f.name, f.unit) for f in schema.fields] == [("stretch", "1")]
    assert schema.nominal_rate_hz == 25.0


@pytest.mark.parametrize(
    ("profile", "uuids"),
    [
        (codec.HEART_RATE, (HEART_RATE_SERVICE, codec.HEART_RATE.notify_uuid)),
        (codec.POLAR_ECG, (POLAR_SERVICE, codec.POLAR_ECG.write_uuid, codec.POLAR_ECG.notify_uuid)),
    ],
    ids=["heart_rate", "polar_ecg"],
)
def test_strap_is_recorded_by_bleak(bluez, profile, uuids):
    clock = SystemClock()
    name = "heart_rate" if profile is codec.HEART_RATE else "polar_ecg"
    peer = BleSensorSimulator("heart", clock, profile=name, seed=1)
    host = bluez(peer, name="Polar H10 1234", mtu=247, uuids=(*uuids, uuids[-1])[:3])
    link = BleLink(
        clock,
        name="Polar H10",
        splits=False,
        write_uuid=profile.write_uuid,
        notify_uuid=profile.notify_uuid,
        thread=host.thread,
    )

    values, _, faults = recorded(clock, link, profile, 2.5)

    assert len(values) >= 2
    assert not faults
