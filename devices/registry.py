"""Find a driver by the name written in `lab_config.yaml` and build it, importing it only then."""

import difflib
import importlib
from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

from devices.contracts import Device
from lab.errors import ConfigError, DeviceNotFound

ENTRY_POINT_GROUP = "visavis.drivers"
"""Installed packages add drivers under this entry-point group."""

BUILT_IN: dict[str, str] = {
    "lsl_body": "devices.drivers.lsl.body:LslBody",
    "natnet": "devices.drivers.natnet.driver:NatNet",
    "openvr_controllers": "devices.drivers.openvr.controllers:OpenVrControllers",
    "openvr_headset": "devices.drivers.openvr.headset:OpenVrHeadset",
    "openvr_trackers": "devices.drivers.openvr.trackers:OpenVrTrackers",
    "openxr_controllers": "devices.drivers.openxr.controllers:OpenXrControllers",
    "openxr_gaze": "devices.drivers.openxr.gaze:OpenXrGaze",
    "openxr_headset": "devices.drivers.openxr.headset:OpenXrHeadset",
    "eyelink": "devices.drivers.eyelink.driver:EyeLink",
    "fove": "devices.drivers.fove.driver:Fove",
    "gazepoint": "devices.drivers.gazepoint.driver:Gazepoint",
    "hid_gaze": "devices.drivers.hid_gaze.driver:HidGaze",
    "lsl_gaze": "devices.drivers.lsl.gaze:LslGaze",
    "tobii_lsl": "devices.drivers.lsl.gaze:TobiiLsl",
    "neon": "devices.drivers.neon.driver:Neon",
    "pupil_core": "devices.drivers.pupil.driver:PupilCore",
    "serial_armband": "devices.drivers.links.serial_port:serial_armband",
    "simulated_body": "devices.sim.body.tracker:SimulatedBodyTracker",
    "simulated_armband": "devices.sim.armband.simulator:simulated_armband",
    "xsens": "devices.drivers.xsens.driver:XsensMvn",
    "ascii_armband": "devices.drivers.bands.builders:ascii_armband",
    "bhaptics": "devices.drivers.bands.builders:bhaptics",
    "ble_armband": "devices.drivers.armband.wireless:ble_armband",
    "hid_armband": "devices.drivers.bands.builders:hid_armband",
    "neosensory_buzz": "devices.drivers.bands.builders:neosensory_buzz",
    "spp_armband": "devices.drivers.armband.wireless:spp_armband",
    "usb_armband": "devices.drivers.bands.builders:usb_armband",
    "vhp_sleeve": "devices.drivers.bands.builders:vhp_sleeve",
    "vhp_slim": "devices.drivers.bands.builders:vhp_slim",
    "simulated_headset": "devices.sim.headset:SimulatedHeadset",
    "simulated_responses": "devices.sim.responses:SimulatedResponses",
}
"""Driver name -> "module:Class" of the drivers that ship with Visavis."""

EXTRA_OF_LIBRARY: dict[str, str] = {
    "zmq": "pyzmq",
    "msgpack": "msgpack",
    "serial": "visavis[serial]",
}
"""Import name -> what `pip install` calls it."""


def driver_names() -> tuple[str, ...]:
    """Return every driver name known here, sorted."""
    return tuple(sorted(_targets()))


def load(name: str) -> Callable[..., Device]:
    """Import a driver and return its class.

    Raises ConfigError for an unknown name, with the nearest one, and DeviceNotFound when a
    library that it needs is missing, with the command that installs it.
    """
    targets = _targets()
    if name not in targets:
        near = difflib.get_close_matches(name, targets, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ConfigError(f"unknown driver {name!r}; {hint}Known: {', '.join(sorted(targets))}")
    module_name, _, class_name = targets[name].partition(":")
    try:
        module = importlib.import_module(module_name)
    except ImportError as cause:
        library = (cause.name or "").partition(".")[0]
        if not library or library == module_name.partition(".")[0]:
            raise ConfigError(
                f"driver {name!r} names {targets[name]!r}, which cannot be imported: {cause}"
            ) from cause
        package = EXTRA_OF_LIBRARY.get(library, library)
        raise DeviceNotFound(
            f"driver {name!r} needs the library {library!r}, which is not installed",
            remedy=f"run: pip install {package}",
        ) from cause
    try:
        driver: Callable[..., Device] = getattr(module, class_name)
    except AttributeError as cause:
        raise ConfigError(
            f"driver {name!r} names {targets[name]!r}, but the module has no {class_name!r}"
        ) from cause
    return driver


def create(name: str, *args: Any, **kwargs: Any) -> Device:
    """Build a driver by name with its constructor's arguments."""
    return load(name)(*args, **kwargs)


def _targets() -> dict[str, str]:
    found = {point.name: point.value for point in entry_points(group=ENTRY_POINT_GROUP)}
    return found | BUILT_IN
