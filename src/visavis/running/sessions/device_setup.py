"""Put a session's devices together from the lab's configuration."""

from collections.abc import Collection, Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from visavis.devices.building import build_device, checked_device
from visavis.devices.contracts import Body, Device, EyeTracker, Headset
from visavis.devices.registry import driver_spec
from visavis.devices.screen.display import ScreenDisplay
from visavis.devices.screen.resting_body import before_screen
from visavis.lab.clock import Clock
from visavis.lab.config import DeviceConfig, LabConfig, is_own_role
from visavis.lab.errors import ConfigError, UsageError
from visavis.lab.geometry import Pose
from visavis.lab.yaml_lines import did_you_mean
from visavis.protocol.plan.experiment import Experiment, demands_of, spare_roles_of
from visavis.protocol.session.rig import Rig
from visavis.study.experiment import StudyExperiment
from visavis.study.responses import Keys

ESSENTIAL_ROLES = ("headset", "screen", "eye_tracker")
"""What a lab is expected to have, one of the first two; a study may do without the eye tracker."""


def roles_expected(config: LabConfig) -> tuple[str, ...]:
    """Return the roles of devices a lab is expected to name: before a screen no headset."""
    on_screen = config.display.on_screen is not None
    return ("eye_tracker",) if on_screen else ("headset", "eye_tracker")


def build_rig(
    config: LabConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    stack: ExitStack,
    without: Collection[str] = (),
) -> Rig:
    """Build every device the configuration names; what needs closing goes on `stack`.

    Raises:
        ConfigError: there is no headset, or a simulated device has no body to measure.
        DeviceNotFound: a driver's library is missing, or it exists in simulation only.
    """
    check_rig(config)
    display = screen_display(config, clock)
    if display is not None and body is not None:
        body = before_screen(body, display.place)
        display.seat(body)
    devices: dict[str, Device] = {}
    for role, device in config.devices.items():
        devices[role] = build_device(device, clock, body, seed, stack)
    tracker = devices.pop("eye_tracker", None)
    eyes = None if tracker is None else _as_eye_tracker(tracker)
    headset = _as_headset(devices.pop("headset")) if display is None else display
    return Rig(headset, eyes, devices, without=frozenset(without))


def screen_display(config: LabConfig, clock: Clock) -> ScreenDisplay | None:
    """Return the screen that stands in the place of a headset; None where there is a headset.

    Raises:
        ConfigError: the table of its luminances cannot be used.
    """
    screen = config.display.on_screen
    if screen is None:
        return None
    place = Pose(np.array([0.0, screen.eye_height_m, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    flat = replace(screen.flat, luminance=config.luminance)
    return ScreenDisplay(
        flat, place, clock, rate_hz=screen.rate_hz, is_tracked=screen.head == "tracked"
    )


def check_rig(config: LabConfig) -> None:
    """Find what is wrong with the devices as they are configured; nothing is built or opened.

    Raises:
        ConfigError: there is neither headset nor screen, a screen-based eye tracker has no screen
            that is described, a keyboard has no window that hears it, or an option or a simulated
            fault is wrong.
    """
    if "headset" not in config.devices and config.display.on_screen is None:
        raise ConfigError(
            f"{config.path}: devices has no headset; add the role with its driver, or describe the "
            "screen under display (see docs/configuration.md)"
        )
    for device in config.devices.values():
        checked_device(device)
    if unheard := unheard_keyboards(config):
        raise ConfigError(
            f"{config.path}: no window hears devices.{', devices.'.join(unheard)}: display.show is "
            f"{config.display.show}; {NO_WINDOW_REMEDY}"
        )


def unheard_keyboards(config: LabConfig) -> tuple[str, ...]:
    """Return the roles of real keyboards that no participant's window would hear."""
    if config.display.show in SHOWS_THAT_HEAR:
        return ()
    return tuple(
        role
        for role, device in config.devices.items()
        if not device.simulated and driver_spec(device.driver).wire.hears_window
    )


def devices_for(
    config: LabConfig, experiment: Experiment, without: Collection[str] = ()
) -> LabConfig:
    """Leave out devices that a study does not use, and those the operator goes on `without`.

    Raises:
        ConfigError: a device that the study cannot do without is not configured, or a key that it
            asks for is none of the responses' controls, as far as the configuration tells them.
        UsageError: the study cannot go on without one that was to be left out.
    """
    needed_roles, useful = experiment.needed_roles, experiment.useful_roles
    spare = [r for r in spare_roles_of(experiment) if r in config.devices]
    for role in without:
        if role not in spare:
            may = f"it can do without {', '.join(spare)}" if spare else "it needs all it has"
            raise UsageError(f"{experiment.name} cannot go on without {role!r}: {may}")
    missing = [r for r in needed_roles if r not in config.devices]
    if missing:
        line = ", for sounds `sound: {driver: sound_card}`" if "sound" in missing else ""
        raise ConfigError(
            f"{config.path}: {experiment.name} needs {', '.join(missing)} under devices; add the "
            f"role with its driver{line} (see docs/configuration.md)"
        )
    roles = {"responses", *needed_roles, *useful}
    if config.display.own_body != "none":
        roles.add("body_tracker")
    if config.display.on_screen is None:
        roles.add("headset")
    else:
        roles.discard("headset")
    roles -= set(without)
    devices = {r: d for r, d in config.devices.items() if r in roles or is_own_role(r)}
    for role in without:
        devices.pop(role, None)
    if "responses" in devices:
        _check_keys(config, devices["responses"], experiment)
    return config.model_copy(update={"devices": devices})


def _check_keys(config: LabConfig, device: DeviceConfig, experiment: Experiment) -> None:
    """Refuse keys that are none of the controls that a configuration tells, or that it calls
    otherwise.

    Raises:
        ConfigError: naming the first.
    """
    if not isinstance(experiment, StudyExperiment):
        return
    options = checked_device(device)[0]
    controls = tuple(getattr(options, "controls", None) or ())
    buttons: Collection[str] = getattr(options, "buttons", ())
    names: Mapping[str, str] = getattr(options, "keys", {})
    of_buttons = {names.get(button, button) for button in buttons} | set(names.values())
    keys = [r for r in experiment.responses.values() if isinstance(r, Keys)]
    for key in (str(option) for response in keys for option in response.options):
        asks = f"{config.path}: {experiment.name} asks for the key {key!r}, which"
        if controls and key not in controls:
            raise ConfigError(
                f"{asks} is not one of {', '.join(controls)} of devices.responses; name this "
                "control in the configuration (a driver that has it, such as "
                f"{'voice_key' if key == 'voice' else 'keyboard'}), or ask for one of these"
            )
        if names.get(key, key) != key and key not in names.values():
            raise ConfigError(
                f"{asks} keys of devices.responses calls {names[key]!r}, so that no press would be "
                f"{key!r}; ask for {names[key]!r}, or give devices.responses keys without {key!r}"
            )
        if buttons and key not in of_buttons:
            near = did_you_mean(key.strip().lower() or "space", of_buttons)
            if key == "voice":
                near = "; the drivers voice_key and voice_and_keyboard hear somebody speak"
            raise ConfigError(f"{asks} is no key of devices.responses{near}")


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


def simulated_as_before(config: LabConfig, at_begin: Mapping[str, Any]) -> LabConfig:
    """Return a configuration whose devices are simulated where they were when a session began;
    `at_begin` is what that session's manifest says of each role.
    """
    roles = {role for role, device in at_begin.items() if device.get("simulated")}
    devices = {
        role: device.model_copy(update={"simulated": True}) if role in roles else device
        for role, device in config.devices.items()
    }
    return config.model_copy(update={"devices": devices})


SHOWS_THAT_HEAR = ("screen", "window")
"""What `display.show` may be for the participant's keys to be heard."""
NO_WINDOW_REMEDY = (
    "set it to screen, where people sit before a monitor, or to window; a button box "
    "(xid_buttons, byte_buttons, hid_buttons) needs none"
)
NO_PICTURE_REMEDY = "set it to headset, screen or window, or rehearse with --devices sim"


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


def _as_headset(device: Device) -> Headset:
    if not hasattr(device, "wait_frame"):
        raise ConfigError(f"{device.info.driver} is not a headset; give the headset role another")
    return device  # type: ignore[return-value]  # has the verbs that make it one


def _as_eye_tracker(device: Device) -> EyeTracker:
    if not hasattr(device, "begin_calibration"):
        raise ConfigError(f"{device.info.driver} is not an eye tracker; give the role another")
    return device  # type: ignore[return-value]  # has the verbs that make it one
