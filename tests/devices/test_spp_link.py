"""Bluetooth classic: the guard where Python has no such sockets, and a link over any socket."""

import socket

import pytest

from visavis.devices.drivers.links.rfcomm import RfcommLink, connect_rfcomm
from visavis.lab.clock import SystemClock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound, DeviceTimeout

CLOCK = SystemClock()


@pytest.fixture
def pair():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        link = RfcommLink(CLOCK, address="AA:BB:CC:DD:EE:02", connect=lambda *_: ours)
        link.open(1.0)
        yield link, theirs


def test_bytes_cross_in_both_directions(pair):
    link, band = pair

    link.write(b"\x00\x01\x02")
    band.sendall(b"abc")

    assert band.recv(10) == b"\x00\x01\x02"
    assert [chunk.data for chunk in link.read(1.0)] == [b"abc"]
    assert link.read(0.0) == ()


def test_band_that_hangs_up_is_disconnected(pair):
    link, band = pair
    band.close()

    with pytest.raises(DeviceDisconnected, match="closed by the other end"):
        link.read(1.0)
    with pytest.raises(DeviceDisconnected):
        link.write(b"x")


def test_python_without_bluetooth_sockets_says_what_to_do(monkeypatch):
    monkeypatch.delattr(socket, "AF_BLUETOOTH", raising=False)

    with pytest.raises(DeviceNotFound, match="give the serial port it gets"):
        connect_rfcomm("AA:BB:CC:DD:EE:02", 1, 0.1)


@pytest.mark.parametrize(
    ("problem", "raised"),
    [(TimeoutError("late"), DeviceTimeout), (OSError(112, "Host is down"), DeviceNotFound)],
)
def test_failure_to_connect_is_named(problem, raised):
    def fail(*_):
        raise problem

    link = RfcommLink(CLOCK, address="AA:BB:CC:DD:EE:02", connect=fail)

    with pytest.raises(raised, match="AA:BB:CC:DD:EE:02"):
        link.open(0.1)
    with pytest.raises(DeviceDisconnected):
        link.read(0.0)
