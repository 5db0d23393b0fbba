"""The rules that let a person use the lab's devices on Linux."""

import errno
import os

import pytest

from cli.commands.devices import install_rules
from devices.access_rules import access_rules
from devices.drivers.links.serial_port import SerialLink
from lab.clock import SystemClock
from lab.config import DeviceConfig
from lab.errors import DeviceNotFound, UsageError


def device(role, driver, **options):
    return DeviceConfig(role=role, driver=driver, simulated=False, options=options)


def rules_for(*devices):
    return access_rules({d.role: d for d in devices})


@pytest.mark.parametrize(
    ("driver", "expected"),
    [
        ("labjack_triggers", 'SUBSYSTEM=="usb", ATTR{idVendor}=="0403", ATTR{idProduct}=="6001"'),
        ("serial_armband", 'SUBSYSTEM=="tty", ATTRS{idVendor}=="0403", ATTRS{idProduct}=="6001"'),
        ("hid_armband", 'KERNEL=="hidraw*", ATTRS{idVendor}=="0403", ATTRS{idProduct}=="6001"'),
        ("usb_armband", 'SUBSYSTEM=="usb", ATTR{idVendor}=="0403", ATTR{idProduct}=="6001"'),
    ],
)
def test_a_device_is_matched_on_its_own_wire_by_its_numbers(driver, expected):
    found = rules_for(device("armband_left", driver, vid=0x0403, pid=0x6001))

    assert f'{expected}, MODE="0660", TAG+="uaccess"' in found.text.splitlines()
    assert found.notes == ()


def test_what_no_rule_can_match_is_told_with_another_way():
    found = rules_for(
        device("armband_left", "serial_armband", port="/dev/ttyUSB0"),
        device("eye_tracker", "hid_gaze"),
        device("headset", "openvr_headset"),
    )

    assert [line for line in found.text.splitlines() if not line.startswith("#")] == []
    assert "usermod -aG dialout" in found.notes[0]
    assert found.notes[1].startswith("eye_tracker: ")


def test_rules_that_cannot_be_written_say_how(tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: "/bin/true")

    with pytest.raises(UsageError, match="sudo tee"):
        install_rules("", tmp_path / "none" / "70-visavis.rules")


def test_a_port_that_may_not_be_used_points_to_the_rules(monkeypatch):
    serial = pytest.importorskip("serial", reason="pip install pyserial")

    def refused(self):
        raise serial.SerialException(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(serial.Serial, "open", refused)
    with pytest.raises(DeviceNotFound, match="visavis devices rules"):
        SerialLink(SystemClock(), port="/dev/ttyUSB0").open(1.0)
