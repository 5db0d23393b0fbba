"""Which devices were seen with their makers' own software: the table in docs/genuine-software.md.

    python -m tests.genuine.seen [WORD …]

runs the tests of every row (or of those that name a word) and writes the table. A row whose
software is not installed here keeps what was seen before.
"""

import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Final

from visavis.lab.clock import SystemClock

ROOT: Final = Path(__file__).parents[2]
PAGE: Final = ROOT / "docs" / "genuine-software.md"
HEAD: Final = "| device | software | version | seen | what was seen |"
NOT_YET: Final = "not yet"


@dataclass(frozen=True)
class Row:
    """Drivers, a package of genuine software (PyPI's, or "debian:NAME"), and tests that use it."""

    devices: tuple[str, ...]
    package: str
    tests: tuple[str, ...]
    what: str

    @property
    def key(self) -> tuple[str, str]:
        """Return what the row is found by."""
        return ", ".join(f"`{name}`" for name in self.devices), self.package.removeprefix("debian:")


ROWS: Final = (
    Row(
        ("openxr_headset",),
        "debian:monado-service",
        ("genuine/test_monado.py",),
        "poses put by its remote driver arrive exactly, headless and with pictures; eyes moved "
        "apart; its service killed and started anew; sessions ended in every way; whole sessions "
        "of stare, crowd, waving and a study of one's own, in which check finds nothing but "
        "lateness",
    ),
    Row(
        ("openxr_headset", "openxr_controllers", "openxr_gaze", "openxr_hands"),
        "pyopenxr",
        ("devices/test_openxr_rules.py", "devices/test_openxr_hands.py"),
        "Khronos' loader runs whole sessions, and its validation layer finds nothing in them; "
        "runtime of our own",
    ),
    Row(
        ("openvr_headset",),
        "openvr",
        ("devices/test_openvr_headset.py",),
        "Valve's loader and package run whole sessions; `vrclient` of our own",
    ),
    Row(
        ("openvr_headset",),
        "opencomposite",
        ("genuine/test_opencomposite.py",),
        "OpenComposite over Monado: poses put by Monado's remote driver arrive exactly, pictures "
        "are taken; built by hand, see below",
    ),
    Row(
        ("tobii_pro",),
        "TittaPy",
        ("devices/test_tobii_pro.py",),
        "Tobii's SDK starts, finds no tracker and refuses an address; every name that is used",
    ),
    Row(
        ("eyelink",),
        "sr-research-pylink",
        ("devices/test_eyelink.py",),
        "SR Research's dummy tracker takes every call and draws its set-up on our screen",
    ),
    Row(
        ("neon",),
        "pupil-labs-realtime-api",
        ("devices/test_neon.py",),
        "Pupil Labs' client reads gaze, clock and events off our simulator, and records",
    ),
    Row(
        ("lsl_gaze", "lsl_stream", "lsl_body"),
        "pylsl",
        (
            "devices/test_lsl_gaze.py",
            "devices/test_lsl_stream.py",
            "devices/test_lsl_outlet.py",
        ),
        "genuine outlets of another process are found, read and timed; ours are received",
    ),
    Row(
        ("hid_gaze",),
        "hidapi",
        ("devices/test_hid_gaze_hidraw.py",),
        "hidapi reads whole reports off a hidraw node that umockdev plays",
    ),
    Row(
        ("qualisys",),
        "qtm-rt",
        ("devices/test_qualisys.py",),
        "Qualisys' client reads names and poses off our simulator, number for number",
    ),
    Row(
        ("pupil_core",),
        "pyzmq",
        ("devices/test_zmq_wire.py",),
        "gaze, calibration and annotations over genuine ZeroMQ",
    ),
    Row(
        ("xid_buttons",),
        "pyxid2",
        ("devices/test_buttons.py",),
        "presses read by Cedrus' client as by ours",
    ),
    Row(
        ("xid_triggers",),
        "pyxid2",
        ("devices/test_triggers.py",),
        "lines raised, and the width of pulses packed, as Cedrus' client does",
    ),
    Row(
        ("labjack_triggers",),
        "LabJackPython",
        ("devices/test_triggers.py",),
        "packets are those of LabJack's own client",
    ),
    Row(
        ("parallel_triggers",),
        "pyparallel",
        ("devices/test_triggers.py",),
        "the kernel is asked what pyparallel asks it",
    ),
    Row(
        ("ble_armband", "neosensory_buzz", "vhp_slim", "ble_sensor"),
        "bleak",
        ("devices/test_ble_link.py",),
        "bleak finds, connects, loses and finds again, over a BlueZ of our own",
    ),
    Row(
        ("usb_armband",),
        "pyusb",
        ("devices/test_usb_links.py",),
        "pyusb drives a band on a bus of our own",
    ),
    Row(
        ("bhaptics",),
        "websockets",
        ("devices/test_websocket_link.py",),
        "a real WebSocket; the Player is ours",
    ),
    Row(
        ("bhaptics_sdk",),
        "bhaptics-python",
        ("devices/test_bhaptics_sdk.py",),
        "bHaptics' SDK2 proves who calls and carries frames to the port of a Player of our own",
    ),
)


def version_of(package: str) -> str | None:
    """Return the version of a package that is installed; None where it is not."""
    kind, _, name = package.rpartition(":")
    if kind == "debian":
        asked = ["dpkg-query", "-W", "-f", "${Version}", name]
        try:
            done = subprocess.run(asked, capture_output=True, text=True, check=False)
        except OSError:
            return None
        return re.split("[+-]", done.stdout)[0] if done.returncode == 0 else None
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def read_page(text: str) -> dict[tuple[str, str], tuple[str, str]]:
    """Return version and day of every row of a page, by device and software."""
    rows = {}
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("| ").split(" | ")]
        if len(cells) == 5 and cells[0].startswith("`"):
            rows[cells[0], cells[1]] = (cells[2], cells[3])
    return rows


def write_page(seen: Mapping[tuple[str, str], tuple[str, str]], before: str) -> str:
    """Return the page with its table written anew; what stands around the table is kept."""
    lines = [HEAD, "| --- | --- | --- | --- | --- |"]
    for row in ROWS:
        version, day = seen.get(row.key, ("–", NOT_YET))
        lines.append(f"| {row.key[0]} | {row.key[1]} | {version} | {day} | {row.what} |")
    start = before.index(HEAD)
    table = before[start:].split("\n\n", 1)[0]
    return before.replace(table.rstrip("\n"), "\n".join(lines))


def passes(tests: Sequence[str]) -> bool:
    """Run tests in a process of their own; tell whether they passed and any was performed."""
    command = [sys.executable, "-m", "pytest", "-n0", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*command, *(f"tests/{test}" for test in tests)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    last = done.stdout.strip().splitlines()[-1:]
    sys.stdout.write(f"{' '.join(tests)}: {' '.join(last)}\n")
    return done.returncode == 0


def main(words: Sequence[str]) -> None:
    """Run the rows that are asked for and write the page."""
    text = PAGE.read_text("utf-8")
    seen = read_page(text)
    for row in ROWS:
        names = " ".join((*row.devices, row.package))
        version = version_of(row.package)
        if version is None or (words and not any(word in names for word in words)):
            continue
        if not passes(row.tests):
            raise SystemExit(f"{names}: its tests fail with {version}")
        seen[row.key] = (version, SystemClock().wall_iso()[:10])
    PAGE.write_text(write_page(seen, text), "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
