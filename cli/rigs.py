"""Put a session's devices together from the lab's configuration."""

import importlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack

from cli.wires import BARE, Wires
from devices import registry
from devices.contracts import Body, Device, EyeTracker, Headset
from lab.clock import Clock
from lab.config import DeviceConfig, LabConfig
from lab.errors import ConfigError
from protocol.experiment import Experiment, demands_of
from protocol.rig import Rig

ESSENTIAL_ROLES = ("headset", "eye_tracker")
"""What a lab is expected to have; a study may do without the eye tracker."""

_GAZE = ("eyelink", "fove", "gazepoint", "hid_gaze", "lsl_gaze", "neon", "tobii_lsl")
_BODY = ("lsl_body", "natnet", "openvr_controllers", "openvr_headset", "openvr_trackers",
         "openxr_controllers", "openxr_gaze", "openxr_headset", "xsens")  # fmt: skip
_BANDS = ("ascii_armband", "bhaptics", "ble_armband", "hid_armband", "neosensory_buzz",
          "serial_armband", "simulated_armband", "spp_armband", "usb_armband", "vhp_sleeve",
          "vhp_slim")  # fmt: skip
_BASIC = ("pupil_core", "simulated_body", "simulated_headset", "simulated_responses")

BUILDERS: Mapping[str, str] = {
    **dict.fromkeys(_BASIC, "cli.basic_builders:BASIC_BUILDERS"),
    **dict.fromkeys(_GAZE, "cli.gaze_builders:GAZE_BUILDERS"),
    **dict.fromkeys(_BODY, "cli.body_builders:BODY_BUILDERS"),
    **dict.fromkeys(_BANDS, "cli.armband_builders:ARMBAND_BUILDERS"),
}
"""Driver name -> the table that holds its builder, imported when the driver is asked for."""

Builder = Callable[[str, DeviceConfig, Clock, Body | None, int, ExitStack, Wires], Device]


def build_rig(
    config: LabConfig, clock: Clock, body: Body | None, seed: int, stack: ExitStack
) -> Rig:
    """Build every device the configuration names; what needs closing goes on `stack`.

    Raises:
        ConfigError: there is no headset, or a simulated device has no body to measure.
        DeviceNotFound: the configuration wants a real device that has no driver yet.
    """
    if "headset" not in config.devices:
        raise ConfigError(
            f"{config.path}: devices has no headset; "
            "add the role with its driver (see docs/configuration.md)"
        )
    made: dict[str, Device] = {}
    for role, device in config.devices.items():
        made[role] = build_device(device, clock, body, seed, stack)
    headset, tracker = made.pop("headset"), made.pop("eye_tracker", None)
    return Rig(_as_headset(headset), None if tracker is None else _as_eye_tracker(tracker), made)


def devices_for(config: LabConfig, experiment: Experiment) -> LabConfig:
    """Leave out devices that a study does not use; the others of a lab may stay configured.

    Raises:
        ConfigError: a device that the study cannot do without is not configured.
    """
    needed, useful = experiment.needed_roles, experiment.useful_roles
    missing = [r for r in needed if r not in config.devices]
    if missing:
        raise ConfigError(
            f"{config.path}: {experiment.name} needs {', '.join(missing)} under devices; add the "
            "role with its driver (see docs/configuration.md)"
        )
    kept = {"headset", "responses", *needed, *useful}
    devices = {role: d for role, d in config.devices.items() if role in kept}
    return config.model_copy(update={"devices": devices})


def check_room(config: LabConfig, experiment: Experiment) -> None:
    """Compare the room, where the configuration tells its size, with the floor a study needs.

    Raises:
        ConfigError: the study does not fit in.
    """
    needed_m = demands_of(experiment).floor_side_m
    sides = {"width_m": config.room.width_m, "depth_m": config.room.depth_m}
    short = [f"room.{name} {m:g}" for name, m in sides.items() if m is not None and m < needed_m]
    if short:
        raise ConfigError(
            f"{config.path}: {experiment.name} needs {needed_m:.1f} m to walk on each side, but "
            f"there {', '.join(short)} is written; use a larger room, or correct the file"
        )


def is_simulated(config: LabConfig) -> bool:
    """Tell whether any device of the configuration is simulated; then the session is."""
    return any(d.simulated for d in config.devices.values())


NO_PICTURE_REMEDY = "set it to headset or window, or rehearse with --devices sim"


def shows_nothing(config: LabConfig) -> bool:
    """Tell whether a person would sit before real devices with nothing to see."""
    return config.display.show == "none" and not is_simulated(config)


def require_picture(config: LabConfig) -> None:
    """Refuse a session with a person that draws nothing.

    Raises:
        ConfigError: the devices are real and `display.show` is none.
    """
    if shows_nothing(config):
        raise ConfigError(
            f"{config.path}: display.show is none: the participant would see nothing; "
            f"{NO_PICTURE_REMEDY}"
        )


def build_device(
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    stack: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build the device of one role; a driver from an installed package takes its options as such.

    Raises:
        ConfigError: a simulated device has no body to measure, or no simulator.
        DeviceNotFound: the driver is unknown, or needs a library that is not installed.
    """
    role = device.role
    if device.simulated and body is None:
        raise ConfigError(f"{role}: a simulated device needs a simulated participant")
    if device.driver not in BUILDERS:
        if device.simulated:
            raise ConfigError(
                f"devices.{role}: driver {device.driver!r} comes from another package, whose "
                "simulator is not known here; set `simulated: false`"
            )
        return registry.load(device.driver)(role, clock, **device.options)
    return _builder(device.driver)(role, device, clock, body, seed, stack, wires)


def _builder(driver: str) -> Builder:
    module, _, table = BUILDERS[driver].partition(":")
    found: Builder = getattr(importlib.import_module(module), table)[driver]
    return found


def _as_headset(device: Device) -> Headset:
    if not hasattr(device, "wait_frame"):
        raise ConfigError(f"{device.info.driver} is no headset; give the headset role another")
    return device  # type: ignore[return-value]  # has the verbs that make it one


def _as_eye_tracker(device: Device) -> EyeTracker:
    if not hasattr(device, "begin_calibration"):
        raise ConfigError(f"{device.info.driver} is no eye tracker; give the role another")
    return device  # type: ignore[return-value]  # has the verbs that make it one
