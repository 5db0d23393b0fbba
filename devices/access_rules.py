"""Write the udev rules that let the person at a Linux computer use the devices of a lab."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from visavis.devices.registry import driver_spec
from visavis.lab.config import DeviceConfig

RULES_PATH = "/etc/udev/rules.d/70-visavis.rules"
"""Sorts before 73-seat-late.rules, which acts on the tag `uaccess`."""

SERIAL_GROUP = "dialout"
"""Who may use serial ports on Debian, Ubuntu and Fedora; `uucp` on Arch."""

PARALLEL_PORT, PARALLEL_GROUP = "parallel port", "lp"
"""A parallel port has no numbers for a rule; the group of Linux's ppdev gives access."""

MATCHES = {
    "serial port": ('SUBSYSTEM=="tty"', "ATTRS"),
    "USB HID": ('KERNEL=="hidraw*"', "ATTRS"),
    "USB": ('SUBSYSTEM=="usb"', "ATTR"),
}
"""The udev match of a rule, by the wire that a driver's description names."""


@dataclass(frozen=True)
class AccessRules:
    """The text of the rules file, and what a rule cannot do, by role in plain words."""

    text: str
    notes: tuple[str, ...]


def access_rules(devices: Mapping[str, DeviceConfig]) -> AccessRules:
    """Return the rules for all configured devices, simulated ones included.

    A serial port, HID or USB device is matched by its vendor and product number; a parallel port
    needs a group, which a note names; other wires need neither.
    """
    lines = ["# Written by `visavis devices rules`: devices of the lab are for whoever sits here."]
    notes = []
    for role, device in sorted(devices.items()):
        wire = driver_spec(device.driver).wire.medium
        if wire == PARALLEL_PORT:
            notes.append(
                f"{role}: join the group of parallel ports and log in again: "
                f"sudo usermod -aG {PARALLEL_GROUP} $USER"
            )
        if wire not in MATCHES:
            continue
        vid, pid = device.options.get("vid"), device.options.get("pid")
        if vid is None or pid is None:
            notes.append(_without_numbers(role, wire, device.options.get("port")))
            continue
        kind, key = MATCHES[wire]
        where = f'{kind}, {key}{{idVendor}}=="{vid:04x}", {key}{{idProduct}}=="{pid:04x}"'
        lines += [f"# {role} ({device.driver})", f'{where}, MODE="0660", TAG+="uaccess"']
    return AccessRules("\n".join(lines) + "\n", tuple(notes))


def _without_numbers(role: str, wire: str, port: object) -> str:
    if wire == "serial port":
        hint = f" ({port})" if port and re.match(r"[\w/.:-]+$", str(port)) else ""
        return (
            f"{role}: its port is not known by vid and pid{hint}; give both, or join the group of "
            f"serial ports and log in again: sudo usermod -aG {SERIAL_GROUP} $USER"
        )
    return (
        f"{role}: its driver finds it without vid and pid, which a rule needs; with it plugged in, "
        "lsusb shows both as ID vid:pid: copy a line of another device and put them in"
    )
