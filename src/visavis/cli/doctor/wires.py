"""Examine runtimes, ports and the network without opening a device. Never raises."""

import ctypes.util
import json
import os
import socket
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from visavis.cli.doctor.findings import Finding
from visavis.devices.drivers.hid_gaze.reports import hid_library, list_trackers
from visavis.devices.drivers.openxr.offer import ask
from visavis.devices.libraries import HID, OPENXR, SERIAL
from visavis.devices.registry import driver_spec
from visavis.devices.states import is_installed
from visavis.lab.config import DeviceConfig, LabConfig
from visavis.lab.errors import DeviceNotFound

RUNTIME_NAMES = {"openvr": "SteamVR", "openxr": "OpenXR", "fove": "FOVE"}
RUNTIMES, PORTS, NETWORK = "runtimes", "ports", "network"
DIAL_S = 0.5
EYES = "OpenXR eyes"
XR_FOLDERS = (
    "/usr/share/openxr/1",
    "/usr/local/share/openxr/1",
    "/etc/xdg/openxr/1",
    "~/.local/share/openxr/1",
    "~/.steam/steam/steamapps/common/SteamVR",
)
"""Folders where packages and SteamVR put the manifests of their runtimes."""
XR_MANIFESTS = "*xr*.json"
XR_REMEDY = "make your headset's runtime the active one in its own program"
FOVE_REMEDY = "install the FOVE runtime and give FoveClient's path as library_path"
NOBODY = ("192.0.2.1", 9)
"""An address reserved for documentation; connecting a UDP socket to it sends nothing."""


# ---- runtimes --------------------------------------------------------------------------------


def runtimes(lab: LabConfig) -> tuple[Finding, ...]:
    """Return which headset runtimes and vendor libraries are installed."""
    needed_runtimes = {
        driver_spec(d.driver).wire.runtime for d in lab.devices.values() if not d.simulated
    }
    candidates = (
        (RUNTIME_NAMES["openvr"], "openvr", openvr_runtime(), "install and start SteamVR"),
        (RUNTIME_NAMES["openxr"], "openxr", openxr_runtime(), XR_REMEDY),
        (RUNTIME_NAMES["fove"], "fove", fove_library(lab), FOVE_REMEDY),
    )
    rows = [
        Finding(RUNTIMES, name, "ok", location)
        if location
        else Finding(RUNTIMES, name, "missing", "not found", remedy)
        for name, kind, location, remedy in candidates
        if location or kind in needed_runtimes
    ]
    absent = [
        name
        for name, kind, location, _ in candidates
        if not location and kind not in needed_runtimes
    ]
    if absent:
        rows.append(Finding(RUNTIMES, "not needed", "note", f"{', '.join(absent)}: not found"))
    return (*rows, *_eyes(lab))


def _eyes(lab: LabConfig) -> tuple[Finding, ...]:
    """Return whether the active OpenXR runtime offers gaze, or another one would.

    Asking may start a vendor's programs. So runtimes are asked only where a device takes gaze from
    OpenXR, and the others only where the active one offers none.
    """
    gaze_devices = [
        d for d in lab.devices.values() if d.driver == "openxr_gaze" and not d.simulated
    ]
    active = next((m for m in _openxr_manifests() if m.is_file()), None)
    if not gaze_devices or active is None or not is_installed(OPENXR):
        return ()
    offer = ask(active)
    name = _runtime_name(active) if offer is None else offer.runtime
    if offer is not None and offer.tells_gaze:
        how = f"each eye by {offer.eyes_by}" if offer.eyes_by else "one ray of both eyes"
        return (Finding(RUNTIMES, EYES, "ok", f"{name} tells {how}"),)
    offers = [(m, o) for m in openxr_installed() if (o := ask(m)) is not None and o.tells_gaze]
    others = [(manifest, one) for manifest, one in offers if one.runtime != name]
    if others:
        manifest, one = others[0]
        fails = "hides the eye tracker, whose gaze" if offer else "cannot be asked for gaze, which"
        text = f"{name} {fails} {one.runtime} tells"
        remedy = f"make {one.runtime} the active OpenXR runtime in its own program ({manifest})"
        return (Finding(RUNTIMES, EYES, "missing", text, remedy),)
    if offer is not None and not offer.has_headset:
        text = f"{name} finds no headset, so it cannot say whether it tells gaze"
        return (Finding(RUNTIMES, EYES, "warning", text, "connect and switch on the headset"),)
    text = f"{name} tells no gaze" if offer is not None else f"{name} cannot be asked for gaze"
    return (Finding(RUNTIMES, EYES, "missing", text, driver_spec("openxr_gaze").remedy),)


def openxr_installed() -> tuple[Path, ...]:
    """Return the manifests of all OpenXR runtimes of this computer, the active one first."""
    manifests = [*_openxr_manifests(), *_openxr_elsewhere()]
    path_by_target = {path.resolve(): path for path in reversed(manifests) if path.is_file()}
    return tuple(reversed(path_by_target.values()))


def _openxr_elsewhere() -> list[Path]:
    if sys.platform == "win32":
        return [
            Path(name) for name in _windows_names(r"SOFTWARE\Khronos\OpenXR\1\AvailableRuntimes")
        ]
    else:  # else: on Windows mypy calls code after the return unreachable
        return [
            path
            for folder in XR_FOLDERS
            for path in sorted(Path(folder).expanduser().glob(XR_MANIFESTS))
        ]


def _windows_names(key: str) -> list[str]:
    """Return the names of a registry key's values; an empty list where there is no such key."""
    import importlib

    winreg: Any = importlib.import_module("winreg")
    try:
        with winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, key) as registry_key:
            return [
                winreg.EnumValue(registry_key, i)[0]
                for i in range(winreg.QueryInfoKey(registry_key)[1])
            ]
    except OSError:
        return []


def openvr_runtime() -> str:
    """Return the folder of the OpenVR runtime from its registry file; empty without one."""
    override = os.environ.get("VR_PATHREG_OVERRIDE")
    if override:
        registry = Path(override)
    elif sys.platform == "win32":
        registry = Path(os.environ.get("LOCALAPPDATA", "")) / "openvr" / "openvrpaths.vrpath"
    else:
        config = os.environ.get("XDG_CONFIG_HOME", "")
        registry = (Path(config) if config else Path.home() / ".config") / "openvr"
        registry /= "openvrpaths.vrpath"
    folders = _json(registry).get("runtime", [])
    return str(folders[0]) if folders and Path(folders[0]).is_dir() else ""


def openxr_runtime() -> str:
    """Return the active OpenXR runtime: its name, or its library; empty without one."""
    return next((name for m in _openxr_manifests() if (name := _runtime_name(m))), "")


def _runtime_name(manifest: Path) -> str:
    """Return a runtime's name, or its library; empty where the manifest names none."""
    runtime = _json(manifest).get("runtime", {})
    return str(runtime.get("name") or runtime.get("library_path", manifest)) if runtime else ""


def _openxr_manifests() -> list[Path]:
    override = os.environ.get("XR_RUNTIME_JSON")
    if override:
        return [Path(override)]
    if sys.platform == "win32":
        return _openxr_of_windows()
    else:  # else: on Windows mypy calls code after the return unreachable
        return _openxr_of_home()


def _openxr_of_home() -> list[Path]:
    config = os.environ.get("XDG_CONFIG_HOME", "")
    home = Path(config) if config else Path.home() / ".config"
    return [p / "openxr" / "1" / "active_runtime.json" for p in (home, Path("/etc/xdg"))]


def _openxr_of_windows() -> list[Path]:
    import importlib

    winreg: Any = importlib.import_module("winreg")
    try:
        with winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, r"SOFTWARE\Khronos\OpenXR\1") as key:
            return [Path(winreg.QueryValueEx(key, "ActiveRuntime")[0])]
    except OSError:  # no such key: no runtime has ever been active
        return []


def fove_library(lab: LabConfig) -> str:
    """Return the path of FoveClient, configured or found by the system; empty without it."""
    configured_paths = [
        str(d.options.get("library_path", "")) for d in lab.devices.values() if d.driver == "fove"
    ]
    for name in [*configured_paths, "FoveClient"]:
        if name and Path(name).is_file():
            return name
        if path := ctypes.util.find_library(name):
            return path
    return ""


def _json(path: Path) -> dict[str, Any]:
    try:
        read = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):  # no such file, or not JSON
        return {}
    return read if isinstance(read, dict) else {}


# ---- ports -----------------------------------------------------------------------------------


def ports() -> tuple[Finding, ...]:
    """Return the serial and HID devices that are plugged in, with values for lab_config.yaml."""
    return (*_serial_ports(), *_hid_devices())


def _serial_ports() -> list[Finding]:
    if not is_installed(SERIAL):
        return [Finding(PORTS, "serial", "note", "cannot be listed", f"run: {SERIAL.install}")]
    from serial.tools import list_ports

    rows = []
    for port in sorted(list_ports.comports(), key=lambda p: str(p.device)):
        if port.vid is None:
            continue
        number = f", serial_number: {port.serial_number}" if port.serial_number else ""
        rows.append(
            Finding(
                PORTS,
                str(port.device),
                "ok",
                f"vid: 0x{port.vid:04x}, pid: 0x{port.pid:04x}{number}  {port.description or ''}",
            )
        )
    return rows or [Finding(PORTS, "serial", "note", "no USB serial port is plugged in")]


def _hid_devices() -> list[Finding]:
    if not is_installed(HID):
        return [Finding(PORTS, "USB HID", "note", "cannot be listed", f"run: {HID.install}")]
    try:
        library = hid_library()
        trackers, count = list_trackers(library), len(library.enumerate())
    except (DeviceNotFound, OSError) as problem:
        return [Finding(PORTS, "USB HID", "note", f"cannot be listed: {problem}")]
    names = [f"{t.get('product_string')} {t.get('serial_number')}".strip() for t in trackers]
    text = f"{count} devices; eye trackers: {', '.join(names) or 'none'}"
    return [Finding(PORTS, "USB HID", "ok" if names else "note", text)]


# ---- network ---------------------------------------------------------------------------------


def network(lab: LabConfig, *, are_open: bool = False) -> tuple[Finding, ...]:
    """Return our address, which devices answer at theirs, and what the firewall must let in.

    Addresses of open devices are not tried: a device may accept only one connection.
    """
    rows = [Finding(NETWORK, "this computer", "ok", own_address() or "no network")]
    real = [d for d in lab.devices.values() if not d.simulated]
    specs = [(d, driver_spec(d.driver)) for d in real]
    if not are_open:
        rows += [_dial(d) for d, spec in specs if spec.wire.dials]
        rows += [row for d in real for row in _port_conflicts(d)]
    let_in = sorted(
        {
            rule.format(**spec.checked_options(d.role, d.options).model_dump())
            for d, spec in specs
            for rule in spec.wire.listens
        }
    )
    if let_in:
        rows.append(
            Finding(
                NETWORK,
                "firewall",
                "note",
                f"must let in {', '.join(let_in)}",
                f"allow it for {Path(sys.executable).name} in the firewall of this computer",
            )
        )
    return tuple(rows)


def own_address() -> str:
    """Return this computer's address on its network; empty without a network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(NOBODY)
        except OSError:  # no route anywhere: not on a network
            return ""
        return str(probe.getsockname()[0])


def _dial(device: DeviceConfig) -> Finding:
    address, port = str(device.options.get("address", "")), int(device.options.get("port", 0))
    subject = device.role
    try:
        socket.create_connection((address, port), DIAL_S).close()
    except socket.gaierror:
        text = f"the name {address!r} is unknown here; give the number the device shows"
        return Finding(NETWORK, subject, "note", text)
    except TimeoutError:
        text = f"{address}:{port} does not answer: another network, or a firewall"
        return Finding(NETWORK, subject, "note", text)
    except OSError as problem:
        is_refused = isinstance(problem, ConnectionRefusedError)
        text = f"{address}:{port} " + (
            "is there, but no program listens" if is_refused else "is away"
        )
        return Finding(NETWORK, subject, "note", text)
    return Finding(NETWORK, subject, "ok", f"{address}:{port} answers")


def _port_conflicts(device: DeviceConfig) -> Sequence[Finding]:
    key = driver_spec(device.driver).wire.binds
    if not key:
        return ()
    port = int(device.options[key])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return (
                Finding(
                    NETWORK,
                    device.role,
                    "missing",
                    f"UDP {port} is taken by another program",
                    "close the other program that receives this stream",
                ),
            )
    return ()
