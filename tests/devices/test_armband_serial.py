"""The serial link: found by what is plugged in, bounded writes, unplugging, URLs."""

import gc
import os
import socket
import struct
import sys
import threading
import warnings
from types import SimpleNamespace

import pytest

from tests.devices.band_makers import serial_armband
from visavis.devices.drivers.links import serial_port as armband_serial
from visavis.devices.drivers.links.serial_port import SerialLink, find_port
from visavis.devices.registry import driver_wiring
from visavis.devices.sim.armband.firmware import ArmbandFirmware
from visavis.lab.clock import SystemClock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound, DeviceTimeout

pytest.importorskip("serial", reason="pip install 'visavis[serial]'")
needs_pty = pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals here")


@pytest.fixture
def terminal():
    import tty

    own, other = os.openpty()
    tty.setraw(other)
    ends = SimpleNamespace(own=own, port=os.ttyname(other), open={own, other})
    ends.unplug = lambda: [os.close(ends.open.pop()) for _ in tuple(ends.open)]
    yield ends
    ends.unplug()


@needs_pty
def test_write_that_nobody_takes_ends_in_a_timeout(terminal):
    link = SerialLink(SystemClock(), port=terminal.port)
    link.open(1.0)
    with pytest.raises(DeviceTimeout, match="takes no bytes"):
        link.write(bytes(200_000))
    link.close()


@needs_pty
def test_unplugging_is_a_disconnection_on_both_ways(terminal):
    link = SerialLink(SystemClock(), port=terminal.port, device="armband")
    link.open(1.0)
    terminal.unplug()
    with pytest.raises(DeviceDisconnected, match="plug the armband in"):
        link.read(0.5)
    with pytest.raises(DeviceDisconnected):
        link.write(b"x")
    link.close()
    link.close()
    with pytest.raises(DeviceDisconnected, match="closed"):
        link.read(0.0)


@needs_pty
def test_port_is_held_for_one_program(terminal):
    first, second = (SerialLink(SystemClock(), port=terminal.port) for _ in range(2))
    first.open(1.0)
    with pytest.raises(DeviceNotFound, match="cannot open"):
        second.open(1.0)
    first.close()


def test_port_that_is_not_there_says_what_to_do():
    with pytest.raises(DeviceNotFound, match="visavis doctor"):
        SerialLink(SystemClock(), port="/dev/no-such-port").open(1.0)


def test_link_without_port_or_description_is_refused():
    with pytest.raises(DeviceNotFound, match="give port, or vid and pid"):
        SerialLink(SystemClock())


def port(device, vid, pid, serial_number):
    return SimpleNamespace(device=device, vid=vid, pid=pid, serial_number=serial_number)


@pytest.fixture
def plugged(monkeypatch):
    from serial.tools import list_ports

    ports = [
        port("COM3", 0x0403, 0x6001, "A1"),
        port("COM9", 0x0403, 0x6001, "B2"),
        port("COM1", None, None, None),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)


def test_port_is_found_by_vendor_product_and_serial(plugged):
    assert find_port(0x0403, 0x6001, "B2") == "COM9"


def test_two_bands_that_fit_ask_for_the_serial_number(plugged):
    with pytest.raises(DeviceNotFound, match=r"2 serial ports fit.*COM3, COM9.*serial_number"):
        find_port(0x0403, 0x6001, "")


def test_no_band_that_fits_lists_what_there_is(plugged):
    everything = r"COM3 \(vid 0403.*COM9 \(vid 0403.*without a USB identity.*port: COM1"
    with pytest.raises(DeviceNotFound, match=everything):
        find_port(0x2341, None, "")


@pytest.mark.parametrize(
    ("vid", "pid", "needs"),
    [
        (0x0403, 0x6001, False),  # FTDI
        (0x1A86, 0x7523, False),  # CH340 of a Nano
        (0x10C4, 0xEA60, False),  # CP2102 of an ESP32
        (0x2341, 0x0043, False),  # Arduino Uno: a second processor is its converter
        (0x2341, 0x8036, True),  # Leonardo
        (0x2E8A, 0x000A, True),  # Pico, with arduino-pico or the SDK
        (0x16C0, 0x0483, True),  # Teensy
        (0x239A, 0x800B, True),  # Feather M0
        (None, None, False),  # a pty, a paired Bluetooth port
    ],
)
def test_board_with_its_own_usb_gets_dtr_and_one_with_a_converter_does_not(
    monkeypatch, vid, pid, needs
):
    from serial.tools import list_ports

    port = SimpleNamespace(device="/dev/board", vid=vid, pid=pid, serial_number="1")
    monkeypatch.setattr(list_ports, "comports", lambda: [port])

    assert lines_of(monkeypatch)["dtr"] is needs
    assert lines_of(monkeypatch, dtr="on")["dtr"] is True
    assert lines_of(monkeypatch, dtr="off")["dtr"] is False


def test_esp32_behind_a_converter_is_not_kept_in_reset(monkeypatch):
    from serial.tools import list_ports

    port = SimpleNamespace(device="/dev/board", vid=0x10C4, pid=0xEA60, serial_number="1")
    monkeypatch.setattr(list_ports, "comports", lambda: [port])

    lines = lines_of(monkeypatch)
    assert (lines["dtr"], lines["rts"]) == (False, False)


def lines_of(monkeypatch, **options):
    """Return the lines of a port as they were when it was opened."""
    import serial

    lines = {}

    def open_port(name, **settings):
        port = SimpleNamespace(dtr=True, rts=True)
        port.open = lambda: lines.update(dtr=port.dtr, rts=port.rts)
        port.close = lambda: None
        port.fileno = lambda: -1
        return port

    monkeypatch.setattr(serial, "serial_for_url", open_port)
    SerialLink(SystemClock(), port="/dev/board", **options).open(1.0)
    return lines


@pytest.mark.parametrize(
    ("driver", "options"),
    [("serial_armband", {}), ("serial_triggers", {"codes": {"trial": 1}}), ("byte_buttons", {})],
)
def test_remedy_names_the_device_that_is_missing(driver, options):
    wiring = driver_wiring(driver)
    device = wiring.on_wire("role", SystemClock(), port="/dev/no-such-port", **options)

    with pytest.raises(DeviceNotFound, match=f"plug the {wiring.spec.product.model} in"):
        device.open(1.0)


def test_missing_library_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(DeviceNotFound, match=r"pip install 'visavis\[serial\]'"):
        SerialLink(SystemClock(), port="COM4").open(1.0)


def poll_for_ever(driver):
    while True:
        driver.poll(0.1)


def test_band_behind_a_socket_url_is_driven_and_its_end_is_noticed():
    firmware = ArmbandFirmware()
    server = socket.create_server(("127.0.0.1", 0))

    def serve():
        connection, _ = server.accept()
        with connection:
            while firmware.granted_duties != (255,) * 4:
                connection.sendall(firmware.feed(connection.recv(4096), 0))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    url = f"socket://127.0.0.1:{server.getsockname()[1]}"
    driver = serial_armband("arm", SystemClock(), port=url)
    rows = []
    driver.open(5.0)
    driver.start(rows.append)
    driver.set_amplitudes((1,) * 4, 1000)
    with pytest.raises(DeviceDisconnected):
        poll_for_ever(driver)
    thread.join(5.0)
    driver.close()
    server.close()

    commands = [batch for batch in rows if batch.schema.name == "haptics"]
    assert commands[0].values["acknowledged"][0]
    assert armband_serial.BAUD == 38_400


def read_for_ever(link):
    while True:
        link.read(0.1)


def test_close_leaves_no_socket_open_when_the_other_end_was_reset():
    server = socket.create_server(("127.0.0.1", 0))
    link = SerialLink(SystemClock(), port=f"socket://127.0.0.1:{server.getsockname()[1]}")
    link.open(5.0)
    connection, _ = server.accept()
    server.close()
    reset_at_close = struct.pack("hh" if os.name == "nt" else "ii", 1, 0)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset_at_close)
    connection.close()
    with pytest.raises(DeviceDisconnected):
        read_for_ever(link)

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        link.close()
        gc.collect()

    assert [] == [str(one.message) for one in told]
