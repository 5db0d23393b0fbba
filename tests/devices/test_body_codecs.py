"""Byte vectors written by hand from the cited layouts, and damage, for MVN and NatNet."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.devices.drivers.natnet import codec as natnet
from visavis.devices.drivers.xsens import codec as xsens
from visavis.lab.errors import DataError

MVN_PELVIS = bytes.fromhex(
    "4d5854503032"  # MXTP02
    "00000007"  # sample 7
    "80"  # datagram 0, the last
    "01"  # one item
    "000003e8"  # time code 1000 ms
    "00"  # character 0
    "17000000000020"  # 23 segments, no props, no fingers, reserved, 32 bytes
    "00000001"  # pelvis
    "3f800000400000003f000000"  # x 1, y 2, z 0.5
    "3f3504f300000000000000003f3504f3"  # 90° about z
)


def test_mvn_vector_is_read_and_turned_into_our_frame():
    datagram = xsens.decode_datagram(MVN_PELVIS)
    assert (datagram.sample, datagram.time_code_ms, datagram.is_last) == (7, 1000, True)
    pose = xsens.Assembler().add(datagram)
    # x forward, y left, z up becomes -z forward, -x left, y up.
    assert pose.position_m[0].tolist() == [-2.0, 0.5, -1.0]
    np.testing.assert_allclose(pose.orientation_wxyz[0], [0.5**0.5, 0, 0.5**0.5, 0], atol=1e-7)
    assert pose.valid.tolist() == [True] + [False] * 21
    assert np.isnan(pose.position_m[1]).all()


def test_parts_come_in_any_order_and_a_sample_that_never_completes_is_counted():
    assembler = xsens.Assembler()
    item = MVN_PELVIS[24:]
    parts = [xsens.Datagram(5, i, i == 2, 0, 0, item) for i in range(3)]
    assert assembler.add(parts[2]) is None
    assert assembler.add(parts[0]) is None
    assert assembler.add(parts[1]) is not None
    for sample in range(20, 40):
        assembler.add(xsens.Datagram(sample, 0, False, 0, 0, item))
    assert assembler.incomplete == 20 - xsens.MAX_PENDING


@given(st.binary(max_size=900))
def test_mvn_decoder_survives_any_bytes(data):
    xsens.decode_datagram(data)
    xsens.decode_datagram(b"MXTP02" + data)


@given(st.data())
def test_mvn_decoder_survives_damage(data):
    raw = bytearray(MVN_PELVIS)
    for _ in range(data.draw(st.integers(1, 6))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    found = xsens.decode_datagram(bytes(raw))
    if isinstance(found, xsens.Datagram):
        pose = xsens.decode_pose(found.sample, found.time_code_ms, found.items)
        assert np.isfinite(pose.position_m[pose.valid]).all()


def natnet_frame(sized):
    def section(n, content):
        return struct.pack("<ii" if sized else "<i", *((n, len(content)) if sized else (n,))) + (
            content
        )

    body = struct.pack("<i3f4ffh", 4, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0, 0.001, 1)
    payload = struct.pack("<i", 99) + section(0, b"") + section(0, b"") + section(1, body)
    payload += section(0, b"")
    payload += section(0, b"") if sized else b""
    payload += section(0, b"") * 3
    payload += struct.pack("<IIdQQQ", 0, 0, 1.5, 15_000_000, 15_010_000, 15_020_000)
    payload += struct.pack("<II", 0, 0) if sized else b""
    return payload + struct.pack("<Hi", 2, 0)


@pytest.mark.parametrize(("version", "sized"), [((3, 0), False), ((4, 0), False), ((4, 1), True)])
def test_natnet_frame_is_read_in_every_layout(version, sized):
    frame = natnet.decode_frame(natnet_frame(sized), version)
    assert (frame.number, frame.exposure_ticks, frame.models_changed) == (99, 15_000_000, True)
    assert frame.bodies[4] == natnet.RigidBody(4, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), True)


def test_natnet_header_with_a_wrong_size_is_refused():
    with pytest.raises(DataError, match="says 5 bytes and has 1"):
        natnet.split_message(bytes.fromhex("0700050000"))


@given(st.binary(max_size=400), st.sampled_from([(3, 0), (4, 0), (4, 1), (4, 2)]))
def test_natnet_decoders_raise_nothing_but_data_error(data, version):
    for decode in (natnet.decode_frame, natnet.decode_models):
        try:
            decode(data, version)
        except DataError:
            pass
    try:
        natnet.decode_server(data)
    except DataError:
        pass


@given(st.data())
def test_natnet_decoder_survives_damage(data):
    raw = bytearray(natnet_frame(sized=True))
    for _ in range(data.draw(st.integers(1, 6))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    try:
        natnet.decode_frame(bytes(raw), (4, 1))
    except DataError:
        pass


MOTIVE_2_1_BODY = ((0.1744466, 1.4471314, -0.7343040),
                   (-0.05459423, 0.5099482, 0.04370357, -0.8573577))  # fmt: skip
MOTIVE_2_1_CLOCK_HZ = 3_312_787
MOTIVE_2_1_EXPOSURE = 1_416_497_730_518
"""What Motive 2.1 sent over NatNet 3.0, as OptiTrack's SampleClient read it: the numbers that the
tests of mje-nz/python_natnet (MIT) state for two recorded packets, which are rebuilt here."""


def test_server_info_of_a_genuine_motive_is_read():
    name = b"Motive".ljust(256, b"\0")
    clock = struct.pack("<QHB4B", MOTIVE_2_1_CLOCK_HZ, 1511, 1, 239, 255, 42, 99)
    server = natnet.decode_server(name + bytes((2, 1, 0, 0, 3, 0, 0, 0)) + clock)

    assert (server.program, server.program_version) == ("Motive", "2.1.0.0")
    assert (server.version, server.clock_hz) == ((3, 0), MOTIVE_2_1_CLOCK_HZ)
    assert (server.data_port, server.multicast) == (1511, "239.255.42.99")


def test_frame_of_a_genuine_motive_is_read_past_all_its_markers():
    place, turn_xyzw = MOTIVE_2_1_BODY
    payload = struct.pack("<iii", 162_734, 0, 5) + struct.pack("<15f", *range(15))
    payload += struct.pack("<ii7ffh", 1, 2, *place, *turn_xyzw, 0.0005152203, 1)
    payload += struct.pack("<ii", 0, 6)
    payload += 6 * struct.pack("<i3ffhf", 131_073, 0.127, 1.505, -0.886, 0.0214, 10, 0.0002)
    payload += struct.pack("<ii", 0, 0)
    times = (MOTIVE_2_1_EXPOSURE, 1_416_497_745_808, 1_416_497_748_722)
    payload += struct.pack("<IIdQQQ", 0, 0, 1356.117, *times) + struct.pack("<Hi", 0, 0)
    frame = natnet.decode_frame(payload, (3, 0))

    assert (frame.number, frame.exposure_ticks) == (162_734, MOTIVE_2_1_EXPOSURE)
    assert frame.bodies[2].is_tracked
    assert frame.bodies[2].position == pytest.approx(place)
    assert frame.bodies[2].turn_xyzw == pytest.approx(turn_xyzw)
    # 15290 and 2914 ticks after it: received 4.6 ms, transmitted 5.5 ms after the exposure
    assert (times[2] - times[0]) / MOTIVE_2_1_CLOCK_HZ == pytest.approx(0.0055, abs=1e-4)
