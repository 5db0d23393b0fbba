"""Qualisys: packets in any chunks, rotations, and the vendor's own client against our simulator."""

import asyncio
import math
import select
import socket
import struct
import threading
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices.body_rigs import BodyRig, WalkingBody
from tests.devices.openvr_rigs import passer
from visavis.devices.conformance import check_batches, check_body_tracker, check_lifecycle
from visavis.devices.drivers.links.stream_socket import StreamSocket
from visavis.devices.drivers.qualisys import codec
from visavis.devices.drivers.qualisys.driver import Qualisys
from visavis.devices.sim.qualisys import QualisysSimulator
from visavis.devices.transports import MemoryTransport
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock
from visavis.lab.errors import ConfigError, DeviceTimeout, ProtocolViolation
from visavis.lab.geometry import rotate

WORN = {"Wand": "right_hand", "Cap": "head"}
SIMULATE, DRIVE = partial(QualisysSimulator, bodies=WORN), partial(Qualisys, bodies=WORN)


def test_driver_keeps_the_contract():
    clock = SimClock()

    def make():
        peer = SIMULATE(WalkingBody(), clock, seed=1)
        return DRIVE("body", MemoryTransport(peer, clock), clock)

    check_lifecycle(make, passer(clock))
    check_batches(make, passer(clock))
    check_body_tracker(make, passer(clock))


def test_poses_are_the_bodys_in_metres_and_our_axes():
    rig = BodyRig(SIMULATE, DRIVE).start().run(2.0)
    t_ns = rig.stamps("t_device_ns") - rig.simulator.device_ns(0)
    places, turns = rig.body.segments(tuple(WORN.values()), t_ns)

    np.testing.assert_allclose(rig.column("position_m"), places, atol=1e-5)
    dots = np.abs((rig.column("orientation_wxyz") * turns).sum(axis=-1))
    np.testing.assert_allclose(dots, 1.0, atol=1e-6)
    assert rig.column("valid").all()
    assert rig.messages() == ""


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: math.hypot(*q) > 0.1))
def test_every_rotation_comes_back_from_its_columns(numbers):
    q = np.array(numbers) / math.hypot(*numbers)
    columns = tuple(float(v) for axis in np.eye(3) for v in rotate(q, axis))

    assert abs(float(np.dot(codec.quaternion(columns), q))) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.8, 0), (-0.6, 0, 0.8)])
def test_half_turns_come_back_too(axis):
    q = np.array((0.0, *axis))
    columns = tuple(float(v) for unit in np.eye(3) for v in rotate(q, unit))

    assert abs(float(np.dot(codec.quaternion(columns), q))) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("columns", [(math.nan,) * 9, (0.0,) * 9, (2.0, *(0.0,) * 8)])
def test_numbers_that_are_no_rotation_are_none(columns):
    assert codec.quaternion(columns) is None


@given(st.lists(st.integers(1, 40), max_size=30))
def test_any_chunking_gives_the_same_packets(cuts):
    stream = codec.command("version 1.24") + codec.packet(codec.EVENT, b"\x03") * 3
    reader, found, at = codec.PacketReader(), [], 0
    for size in [*cuts, len(stream)]:
        found += reader.feed(stream[at : at + size])
        at += size

    assert [kind for kind, _ in found] == [codec.COMMAND, codec.EVENT, codec.EVENT, codec.EVENT]
    assert reader.malformed == 0


def test_command_is_laid_out_as_the_vendors_client_does():
    assert codec.command("qtmversion") == struct.pack("<II10sc", 19, 1, b"qtmversion", b"\0")


def test_body_that_is_not_seen_is_missing():
    rig = BodyRig(SIMULATE, DRIVE, {"kind": "standby", "start_s": 1.0}).start().run(2.0)

    assert not rig.column("valid")[-1].any()
    assert np.isnan(rig.column("position_m")[-1]).all()


def test_body_that_qtm_does_not_know_is_named():
    rig = BodyRig(SIMULATE, partial(Qualisys, bodies={"Wand": "right_hand", "Belt": "hips"}))
    rig.start().run(0.3)

    assert "QTM knows no 6DOF body Belt; it has Wand, Cap" in rig.messages()


def test_rate_of_the_measurement_is_compared():
    rig = BodyRig(SIMULATE, DRIVE, rate_hz=250.0).start().run(0.3)

    assert "QTM measures 250 times a second, lab_config.yaml says 100" in rig.messages()


def test_project_with_another_axis_upwards_is_refused():
    rig = BodyRig(SIMULATE, DRIVE)
    rig.simulator.up = "-X"

    with pytest.raises(ProtocolViolation, match="the axis -X upwards; let \\+Z or \\+Y"):
        rig.driver.open(2.0)


def test_qtm_that_measures_nothing_says_what_to_start():
    rig = BodyRig(SIMULATE, DRIVE)
    rig.simulator.is_measuring = False

    with pytest.raises(DeviceTimeout, match=r"measures nothing .*start QTM's preview"):
        rig.driver.open(1.0)


def test_unmapped_bodies_are_refused():
    with pytest.raises(ConfigError, match="map each 6DOF body"):
        Qualisys("body", None, SimClock(), bodies={})


class WalkingAgainBody(WalkingBody):
    """Begins its walk anew every ten seconds: the clock of this computer may run for months."""

    def segments(self, names, t_ns):
        return super().segments(names, t_ns % (10 * NS_PER_S))


class Host:
    """The simulator behind a TCP port, with the greeting that QTM sends; one client at a time."""

    def __init__(self, simulator, clock):
        self._simulator, self._clock = simulator, clock
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self._over.set()
        self._thread.join(5.0)
        self._server.close()

    def _serve(self):
        ready, _, _ = select.select([self._server], [], [], 5.0)
        if not ready:
            return
        connection, _ = self._server.accept()
        with connection:
            connection.sendall(codec.packet(codec.COMMAND, b"QTM RT Interface connected\0"))
            while not self._over.is_set():
                if select.select([connection], [], [], 0.002)[0]:
                    data = connection.recv(4096)
                    if not data:
                        return
                    answer = self._simulator.answer(data, self._clock.now_ns())
                    connection.sendall(answer or b"")
                now_ns = self._clock.now_ns()
                self._simulator.advance(now_ns)
                for message in self._simulator.outgoing(now_ns):
                    connection.sendall(message.frames[0])


def test_driver_reads_a_socket():
    clock = SystemClock()
    with Host(SIMULATE(WalkingAgainBody(), clock, seed=1), clock) as host:
        driver = DRIVE("body", StreamSocket("127.0.0.1", host.port, clock), clock)
        batches = []
        driver.open(5.0)
        driver.start(batches.append)
        until_ns = clock.now_ns() + NS_PER_S
        while clock.now_ns() < until_ns:
            driver.poll(0.02)
        driver.close()

    assert 80 < sum(map(len, batches)) < 120
    assert np.concatenate([batch.values["valid"] for batch in batches]).all()


def test_vendors_own_client_reads_our_simulator():
    qtm_rt = pytest.importorskip("qtm_rt", reason="qtm-rt is not installed: pip install qtm-rt")
    clock = SystemClock()
    simulator = SIMULATE(WalkingBody(), clock, seed=1)

    async def read(port):
        packets = []
        connection = await qtm_rt.connect("127.0.0.1", port, version="1.24", timeout=5)
        xml = await connection.get_parameters(["general", "3d", "6d"])
        await connection.stream_frames(components=["6dres"], on_packet=packets.append)
        while len(packets) < 20:
            await asyncio.sleep(0.01)
        connection.disconnect()
        return xml, packets

    with Host(simulator, clock) as host:
        xml, packets = asyncio.run(read(host.port))

    assert codec.decode_settings(codec.text_of(xml)).names == tuple(WORN)
    for packet in packets:
        info, bodies = packet.get_6d_residual()
        ours = codec.decode_frame(packet.data)
        assert (info.body_count, packet.framenumber) == (2, ours.number)
        assert packet.timestamp == ours.t_us
        for (place, rotation, _), (place_m, columns) in zip(bodies, ours.bodies, strict=True):
            assert place_m == pytest.approx([v / 1000 for v in place])
            assert columns == tuple(rotation.matrix)
    assert all(b.framenumber - a.framenumber == 1 for a, b in pairwise(packets))
