"""The HID driver over the real hidapi and a hidraw node that umockdev plays."""

import importlib.util
import json
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from tests.devices.gaze_rigs import PERFECT, GazeRig
from visavis.devices.drivers.hid_gaze.driver import HidGaze
from visavis.devices.sim.hid_gaze import DESCRIPTOR, PRODUCT_ID, SERIAL, VENDOR_ID, HidGazeSimulator
from visavis.lab.clock import NS_PER_S, SimClock

ROOT = Path(__file__).parents[2]
N_REPORTS = 120
USB = "/devices/pci0000:00/0000:00:14.0/usb1/1-1"
HID = f"{USB}/1-1:1.0/0003:{VENDOR_ID:04X}:{PRODUCT_ID:04X}.0001"

NODES = f"""\
P: {HID}/hidraw/hidraw0
N: hidraw0
E: DEVNAME=/dev/hidraw0
E: SUBSYSTEM=hidraw
L: device=../../../{HID.rpartition("/")[2]}

P: {HID}
E: SUBSYSTEM=hid
E: HID_ID=0003:{VENDOR_ID:08X}:{PRODUCT_ID:08X}
E: HID_NAME=Simulated eye tracker
E: HID_UNIQ={SERIAL}
E: HID_PHYS=usb-0000:00:14.0-1/input0
H: report_descriptor={DESCRIPTOR.hex().upper()}

P: {USB}/1-1:1.0
E: DEVTYPE=usb_interface
E: SUBSYSTEM=usb
A: bInterfaceNumber=00

P: {USB}
N: bus/usb/001/002
E: DEVNAME=/dev/bus/usb/001/002
E: DEVTYPE=usb_device
E: SUBSYSTEM=usb
A: idVendor={VENDOR_ID:04x}
A: idProduct={PRODUCT_ID:04x}
A: manufacturer=Visavis
A: product=Simulated eye tracker
A: serial={SERIAL}
A: bcdDevice=0100
"""


def scripted(raw):
    """Write bytes as umockdev's scripts do: control characters as ^X, the caret as ^`."""
    marks = {b: bytes((0x5E, b + 64)) for b in range(32)} | {0x5E: b"^`"}
    return b"".join(marks.get(b, bytes((b,))) for b in raw)


def reports():
    clock = SimClock()
    simulator = HidGazeSimulator(FixatingBody(5.0, 3.0), clock=clock, seed=1, error=PERFECT)
    shots = simulator.source.take(N_REPORTS * NS_PER_S // 120)
    return [simulator.report(shot) for shot in shots[:N_REPORTS]]


def test_real_hidapi_reads_whole_reports_from_a_hidraw_node(tmp_path):
    if shutil.which("umockdev-run") is None:
        pytest.skip("no umockdev-run: install the package umockdev to play a hidraw node")
    if importlib.util.find_spec("hidraw") is None:
        pytest.skip("no hidraw: install hidapi to read a hidraw node")
    GazeRig(HidGaze, HidGazeSimulator).start().run(0.5)  # compiled before the script's time runs
    (tmp_path / "nodes").write_text(NODES)
    described = struct.pack("<I", len(DESCRIPTOR)) + DESCRIPTOR.ljust(4096, b"\0")
    identity = struct.pack("<Ihh", 3, VENDOR_ID, PRODUCT_ID)
    (tmp_path / "ioctl").write_text(
        "@DEV /dev/hidraw0\n"
        f"HIDIOCGRDESCSIZE 0 {struct.pack('<i', len(DESCRIPTOR)).hex().upper()}\n"
        f"HIDIOCGRDESC 0 {described.hex().upper()}\n"
        f"HIDIOCGRAWINFO 0 {identity.hex().upper()}\n"
    )
    lines = [b"r 8 " + scripted(report) + b"\n" for report in reports()]
    (tmp_path / "script").write_bytes(b"".join([b"r 1500 " + lines[0][4:], *lines[1:]]))
    command = [
        "umockdev-run",
        f"--device={tmp_path / 'nodes'}",
        f"--ioctl=/dev/hidraw0={tmp_path / 'ioctl'}",
        f"--script=/dev/hidraw0={tmp_path / 'script'}",
        "--",
        sys.executable,
        "-m",
        "tests.devices.hid_gaze_child",
        str(N_REPORTS - 20),
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.run(
        command, capture_output=True, text=True, timeout=60, env=environment, cwd=ROOT
    )
    assert child.returncode == 0, child.stderr
    found = json.loads(child.stdout.splitlines()[-1])
    assert found["end"] == "all", found
    np.testing.assert_allclose(found["direction"], FixatingBody(5.0, 3.0).direction, atol=1e-4)
    assert np.ptp(found["steps_ms"]) < 0.01
    assert found["serial"] == SERIAL
    assert found["transport"].startswith("hid 2104:0124")
    assert not any("could not be read" in fault for fault in found["faults"])
