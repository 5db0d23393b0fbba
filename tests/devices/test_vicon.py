"""Vicon Tracker's UDP object stream: its bytes, rotations, packets that do not hold a frame."""

import math
import struct
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.devices.body_rigs import BodyRig
from visavis.devices.drivers.vicon import codec
from visavis.devices.drivers.vicon.driver import Vicon
from visavis.devices.sim.vicon import ViconSimulator
from visavis.lab.clock import SimClock
from visavis.lab.errors import ConfigError, DataError, DeviceTimeout

WORN = {"Wand": "right_hand", "Cap": "head"}
SIMULATE, DRIVE = partial(ViconSimulator, bodies=WORN), partial(Vicon, bodies=WORN)
MANY = {f"Object {n}": name for n, name in enumerate(("head", "left_hand", "right_hand", "hips"))}


def packet(number, *objects, size=256):
    """Lay a packet out by hand, as the public structures have it, without gaps between fields."""
    items = b"".join(
        struct.pack("<BH24s6d", 0, 72, name.encode(), *numbers) for name, numbers in objects
    )
    return (struct.pack("<IB", number, len(objects)) + items).ljust(size, b"\0")


def test_fields_lie_where_public_clients_read_them():
    data = packet(4711, ("Wand", (100.0, -200.0, 300.0, 0.1, 0.2, 0.3)))
    assert struct.unpack("<L", data[0:4])[0] == 4711
    assert data[4] == 1
    assert data[8:12] == b"Wand"
    assert struct.unpack("<d", data[40:48])[0] == -200.0
    read = codec.decode(data)
    assert (read.number, read.is_last) == (4711, True)
    assert read.objects == {"Wand": ((100.0, -200.0, 300.0), (0.1, 0.2, 0.3))}


def test_three_objects_fill_a_packet_of_256_bytes():
    one = ("Wand", (1.0, 2.0, 3.0, 0.0, 0.0, 0.0))
    assert [codec.decode(packet(1, *[one] * n)).is_last for n in (1, 2, 3)] == [True, True, False]


def test_items_of_other_kinds_are_stepped_over():
    other = struct.pack("<BH", 7, 10) + b"0123456789"
    wand = struct.pack("<BH24s6d", 0, 72, b"Wand", 1, 2, 3, 0, 0, 0)
    read = codec.decode((struct.pack("<IB", 9, 2) + other + wand).ljust(256, b"\0"))
    assert list(read.objects) == ["Wand"]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        packet(1)[:-1],
        packet(1)[:4] + b"\4" + packet(1, *[("Wand", (1.0,) * 6)] * 3)[5:],
        struct.pack("<IBBH", 1, 1, 0, 252).ljust(256, b"\0"),
        struct.pack("<IBBH", 1, 1, 0, 60).ljust(256, b"\0"),
    ],
    ids=["empty", "not padded", "one object more", "object too long", "object too short"],
)
def test_packet_that_cannot_be_one_is_refused(data):
    with pytest.raises(DataError, match="Vicon"):
        codec.decode(data)


@pytest.mark.parametrize("angles", [(0.1, 0.2, 0.3), (-2.0, 0.4, 3.0), (3.1, -1.5, -3.1)])
def test_rotation_is_about_x_then_the_new_y_then_the_new_z(angles):
    x, y, z, w = Rotation.from_euler("XYZ", angles).as_quat()
    dot = abs(float(np.dot(codec.quaternion(angles), (w, x, y, z))))
    assert dot == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("up", ["+Z", "+Y"])
def test_poses_are_the_bodys_in_metres_and_our_axes(up):
    rig = BodyRig(partial(SIMULATE, up=up), partial(DRIVE, up=up)).start().run(2.0)
    places, turns = rig.body.segments(tuple(WORN.values()), rig.stamps("t_device_ns"))
    np.testing.assert_allclose(rig.column("position_m"), places, atol=1e-6)
    dots = np.abs((rig.column("orientation_wxyz") * turns).sum(axis=-1))
    np.testing.assert_allclose(dots, 1.0, atol=1e-9)
    assert rig.column("valid").all()
    assert rig.messages() == ""


def test_frame_that_needs_two_packets_is_one_sample():
    rig = BodyRig(
        partial(ViconSimulator, bodies=MANY, packet_bytes=256), partial(Vicon, bodies=MANY)
    )
    rig.start().run(1.0)
    assert rig.column("valid").all()
    assert (np.diff(rig.stamps("seq")) == 1).all()


def test_full_packets_alone_come_one_frame_later():
    three = dict(list(MANY.items())[:3])
    rig = BodyRig(
        partial(ViconSimulator, bodies=three, packet_bytes=256), partial(Vicon, bodies=three)
    )
    rig.start().run(1.0)
    assert rig.column("valid").all()
    assert (np.diff(rig.stamps("seq")) == 1).all()


@pytest.mark.parametrize("leaves_out", [False, True])
def test_object_that_is_not_seen_is_missing(leaves_out):
    rig = BodyRig(SIMULATE, DRIVE, {"kind": "standby", "start_s": 1.0})
    rig.simulator.leaves_out = leaves_out
    rig.start().run(2.0)
    assert rig.column("valid")[0].all()
    assert not rig.column("valid")[-1].any()
    assert np.isnan(rig.column("position_m")[-1]).all()
    assert "not tracked now: right_hand, head" in rig.messages()


def test_object_that_tracker_does_not_send_is_named():
    rig = BodyRig(SIMULATE, partial(Vicon, bodies={"Wand": "right_hand", "Belt": "hips"}))
    rig.start().run(0.3)
    assert "Tracker has sent no object Belt; it sends Cap, Wand" in rig.messages()


def test_other_frame_rate_than_configured_is_refused_with_both_numbers():
    rig = BodyRig(SIMULATE, DRIVE, rate_hz=200.0).start().run(6.0)
    assert "Tracker sends 200 frames a second, lab_config.yaml says 100" in rig.messages()


@pytest.mark.parametrize(
    "numbers",
    [
        (0.0,) * 6,
        (1.0, 2.0, math.nan, 0.0, 0.0, 0.0),
        (1.0, 2.0, math.inf, 0.0, 0.0, 0.0),
        (1.0, 2.0, 3.0, 90.0, 0.0, 0.0),
    ],
)
def test_numbers_that_are_no_pose_are_missing(numbers):
    assert not codec.is_seen(numbers[:3], numbers[3:])


def test_nobody_who_streams_says_what_to_switch_on():
    rig = BodyRig(SIMULATE, DRIVE, {"kind": "late_start", "start_s": 0.0, "duration_s": 9.0})
    with pytest.raises(DeviceTimeout, match=r"heard nothing from Tracker .*UDP object stream"):
        rig.driver.open(1.0)


def test_unmapped_objects_are_refused():
    with pytest.raises(ConfigError, match="map each object"):
        Vicon("body", None, SimClock(), bodies={})
