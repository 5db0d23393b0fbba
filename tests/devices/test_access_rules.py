"""The rules that let a person use the lab's devices on Linux."""

import errno
import os

import pytest
from typer.testing import CliRunner

from visavis.cli.commands.devices import install_rules
from visavis.cli.main import app
from visavis.devices.access_rules import access_rules
from visavis.devices.drivers.buttons.hid import HidButtonLink
from visavis.devices.drivers.hid_gaze.reports import HidReports
from visavis.devices.drivers.links.serial_port import SerialLink
from visavis.lab.clock import SystemClock
from visavis.lab.config import DeviceConfig
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DeviceNotFound, UsageError


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
    rules = rules_for(device("armband_left", driver, vid=0x0403, pid=0x6001))

    assert f'{expected}, MODE="0660", TAG+="uaccess"' in rules.text.splitlines()
    assert rules.notes == ()


def test_what_no_rule_can_match_is_told_with_another_way():
    rules = rules_for(
        device("armband_left", "serial_armband", port="/dev/ttyUSB0"),
        device("eye_tracker", "hid_gaze"),
        device("headset", "openvr_headset"),
    )

    assert [line for line in rules.text.splitlines() if not line.startswith("#")] == []
    assert "usermod -aG dialout" in rules.notes[0]
    assert rules.notes[1].startswith("eye_tracker: ")


def test_a_parallel_port_is_its_groups():
    rules = rules_for(device("triggers", "parallel_triggers", port="/dev/parport0"))

    assert [line for line in rules.text.splitlines() if not line.startswith("#")] == []
    assert len(rules.notes) == 1
    assert rules.notes[0].startswith("triggers: ")
    assert "usermod -aG lp $USER" in rules.notes[0]


LABJACK = """  triggers:
    driver: labjack_triggers
    codes: {trial_start: 1}
    simulated: true
"""
PARALLEL = """  triggers:
    driver: parallel_triggers
    codes: {trial_start: 1}
    simulated: true
"""


def typed(folder, triggers, *options):
    text = EXAMPLE.read_text("utf-8")
    assert "\ndevices:\n" in text
    config = folder / "lab_config.yaml"
    config.write_text(text.replace("\ndevices:\n", f"\ndevices:\n{triggers}", 1), "utf-8")
    return CliRunner().invoke(app, ["devices", "rules", "--config", str(config), *options])


def test_the_command_prints_a_rule_with_the_numbers_the_driver_takes_by_itself(tmp_path):
    answer = typed(tmp_path, LABJACK)

    assert answer.exit_code == 0, answer.output
    expected = 'SUBSYSTEM=="usb", ATTR{idVendor}=="0cd5", ATTR{idProduct}=="0003", MODE="0660"'
    assert [line.partition(", TAG")[0] for line in answer.stdout.splitlines()][-1] == expected
    assert "# triggers (labjack_triggers)" in answer.stdout.splitlines()
    assert "triggers" not in answer.stderr


def test_the_command_keeps_notes_out_of_what_is_piped_into_the_file(tmp_path):
    answer = typed(tmp_path, PARALLEL)

    assert answer.exit_code == 0, answer.output
    assert "usermod -aG lp $USER" in answer.stderr
    assert all(line.startswith("#") for line in answer.stdout.splitlines())
    assert "usermod" not in answer.stdout


def udevadm(monkeypatch, folder, code):
    """Put a program `udevadm` before the system's, which keeps what it was asked."""
    program = folder / "udevadm"
    program.write_text(
        f'#!/bin/sh\necho "$@" > "{folder}/asked"\necho no udev here >&2\nexit {code}\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder), prepend=os.pathsep)
    return folder / "asked"


@pytest.mark.skipif(os.name == "nt", reason="udev is Linux's")
def test_installed_rules_are_in_the_file_and_udev_is_told(tmp_path, monkeypatch):
    calls = udevadm(monkeypatch, tmp_path, 0)
    monkeypatch.setattr(
        "visavis.cli.commands.devices.RULES_PATH", str(tmp_path / "70-visavis.rules")
    )
    answer = typed(tmp_path, LABJACK, "--install")

    assert answer.exit_code == 0, answer.output
    assert "is in force" in answer.output
    assert (tmp_path / "70-visavis.rules").read_text("utf-8") == typed(tmp_path, LABJACK).stdout
    assert calls.read_text() == "control --reload\n"


@pytest.mark.skipif(os.name == "nt", reason="udev is Linux's")
def test_rules_that_udev_does_not_read_are_not_said_to_be_in_force(tmp_path, monkeypatch):
    udevadm(monkeypatch, tmp_path, 1)

    with pytest.raises(UsageError, match=r"udev did not read it \(no udev here\)"):
        install_rules("# rules\n", tmp_path / "70-visavis.rules")


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


class ForbiddenHid:
    """hidapi's functions where one device is plugged in and may not be opened."""

    def __init__(self, usage_page, usage):
        self._row = {"usage_page": usage_page, "usage": usage, "path": b"/dev/hidraw9"}

    def enumerate(self):
        return [{**self._row, "vendor_id": 0x1209, "product_id": 1, "product_string": "box"}]

    def device(self):
        return self

    def open_path(self, path):
        raise OSError("open failed")


@pytest.mark.parametrize(
    "link",
    [
        HidReports("", SystemClock(), library=ForbiddenHid(0x12, 0x01)),
        HidButtonLink(SystemClock(), library=ForbiddenHid(0x01, 0x05)),
    ],
    ids=["eye tracker", "gamepad"],
)
def test_a_hid_that_may_not_be_opened_points_to_the_rules(link):
    with pytest.raises(DeviceNotFound, match="visavis devices rules"):
        link.open(1.0)
