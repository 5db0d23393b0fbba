"""Put a session's devices together from the lab's configuration."""

import zlib
from collections.abc import Callable
from contextlib import ExitStack
from typing import cast

from cli.body_builders import BODY_BUILDERS
from cli.gaze_builders import GAZE_BUILDERS
from devices.contracts import Body, Device, EyeTracker, Headset, MovingBody
from devices.drivers.pupil_core import PupilCore
from devices.sim.armband import simulated_armband
from devices.sim.body import SimulatedBodyTracker
from devices.sim.faults import FaultSchedule
from devices.sim.headset import SimulatedHeadset
from devices.sim.pupil_core import PupilCoreSimulator
from devices.sim.responses import SimulatedResponses
from devices.sim.zmq_host import ZmqHost
from devices.transports import MemoryTransport, MessageTransport, ZmqTransport
from lab.clock import Clock
from lab.config import DeviceConfig, LabConfig
from lab.errors import ConfigError, DeviceNotFound
from protocol.experiment import Experiment
from protocol.rig import Rig

ESSENTIAL_ROLES = ("headset", "eye_tracker")


def build_rig(
    config: LabConfig, clock: Clock, body: Body | None, seed: int, stack: ExitStack
) -> Rig:
    """Build every device the configuration names; what needs closing goes on `stack`.

    Raises:
        ConfigError: an essential role is missing, or a simulated device has no body to measure.
        DeviceNotFound: the configuration wants a real device that has no driver yet.
    """
    missing = [r for r in ESSENTIAL_ROLES if r not in config.devices]
    if missing:
        raise ConfigError(
            f"{config.path}: devices has no {' and no '.join(missing)}; "
            "add the role with its driver (see docs/configuration.md)"
        )
    made: dict[str, Device] = {}
    for role, device in config.devices.items():
        made[role] = _build(role, device, clock, body, seed, stack)
    headset, eye_tracker = made.pop("headset"), made.pop("eye_tracker")
    return Rig(_as_headset(headset), _as_eye_tracker(eye_tracker), made)


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
    kept = {*ESSENTIAL_ROLES, "responses", *needed, *useful}
    devices = {role: d for role, d in config.devices.items() if role in kept}
    return config.model_copy(update={"devices": devices})


def is_simulated(config: LabConfig) -> bool:
    """Tell whether any device of the configuration is simulated; then the session is."""
    return any(d.simulated for d in config.devices.values())


def _build(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    stack: ExitStack,
) -> Device:
    builder = _BUILDERS.get(device.driver)
    if builder is None:
        raise DeviceNotFound(
            f"driver {device.driver!r} cannot be used in a session yet",
            role=role,
            remedy=f"use one of {', '.join(sorted(_BUILDERS))}",
        )
    if device.simulated and body is None:
        raise ConfigError(f"{role}: a simulated device needs a simulated participant")
    return builder(role, device, clock, body, seed, stack)


def _faults(device: DeviceConfig) -> FaultSchedule:
    try:
        return FaultSchedule.from_config(device.options.get("faults", ()))
    except ConfigError as error:
        raise ConfigError(f"devices.{device.role}.faults in lab_config.yaml: {error}") from error


def _headset(
    role: str, device: DeviceConfig, clock: Clock, body: Body | None, _: int, __: ExitStack
) -> Device:
    if body is None or not device.simulated:
        raise DeviceNotFound(
            "simulated_headset has no real counterpart",
            role=role,
            remedy="set `simulated: true`, or name a real headset's driver",
        )
    return SimulatedHeadset(
        role,
        body,
        clock,
        display_rate_hz=float(device.options.get("display_rate_hz", 90)),
        faults=_faults(device),
    )


def _responses(
    role: str, device: DeviceConfig, clock: Clock, body: Body | None, _: int, __: ExitStack
) -> Device:
    if body is None or not device.simulated:
        raise DeviceNotFound(
            "simulated_responses has no real counterpart",
            role=role,
            remedy="set `simulated: true`, or leave the role out",
        )
    return SimulatedResponses(role, body, clock)


def _pupil_core(
    role: str, device: DeviceConfig, clock: Clock, body: Body | None, seed: int, stack: ExitStack
) -> Device:
    options = dict(device.options)
    address = str(options.pop("address", "127.0.0.1"))
    port = int(options.pop("port", 50020))
    rate_hz = float(options.pop("rate_hz", 120))
    options.pop("faults", None)
    drift_ppm = float(options.pop("drift_ppm", 0.0))
    transport: MessageTransport
    if not device.simulated:
        transport = ZmqTransport(address, port, clock)
    else:
        assert body is not None  # noqa: S101 - checked by the caller
        simulator = PupilCoreSimulator(
            body,
            clock=clock,
            seed=seed,
            rate_hz=rate_hz,
            faults=_faults(device),
            drift_ppm=drift_ppm,
        )
        if clock.is_virtual:
            transport = MemoryTransport(simulator, clock)
        else:
            host = stack.enter_context(ZmqHost(simulator, clock))
            transport = ZmqTransport("127.0.0.1", host.port, clock, is_simulated=True)
    return PupilCore(role, transport, clock, rate_hz=rate_hz, **options)


def _body(
    role: str, device: DeviceConfig, clock: Clock, body: Body | None, _: int, __: ExitStack
) -> Device:
    if body is None or not device.simulated:
        raise DeviceNotFound(
            "simulated_body has no real counterpart",
            role=role,
            remedy="set `simulated: true`, or name a real body tracker's driver",
        )
    rate_hz = float(device.options.get("rate_hz", 100))
    return SimulatedBodyTracker(
        role, _as_moving(role, body), clock, rate_hz=rate_hz, faults=_faults(device)
    )


def _simulated_armband(
    role: str, device: DeviceConfig, clock: Clock, body: Body | None, seed: int, _: ExitStack
) -> Device:
    if body is None or not device.simulated:
        raise DeviceNotFound(
            "simulated_armband has no real counterpart",
            role=role,
            remedy="set `simulated: true`, or name the driver of a real band",
        )
    options = {k: v for k, v in device.options.items() if k not in ("faults", "seed")}
    own_seed = int(device.options.get("seed", 0)) + zlib.crc32(role.encode()) + seed
    moving = _as_moving(role, body)
    return simulated_armband(
        role, clock, seed=own_seed, body=moving, faults=_faults(device), **options
    )


def _as_moving(role: str, body: Body) -> MovingBody:
    if not hasattr(body, "feel"):
        raise ConfigError(
            f"{role}: the simulated participant of this study has no limbs and feels nothing; "
            "leave the role out"
        )
    return cast(MovingBody, body)


def _as_headset(device: Device) -> Headset:
    if not hasattr(device, "wait_frame"):
        raise ConfigError(f"{device.info.driver} is no headset; give the headset role another")
    return device  # type: ignore[return-value]  # has the verbs that make it one


def _as_eye_tracker(device: Device) -> EyeTracker:
    if not hasattr(device, "begin_calibration"):
        raise ConfigError(f"{device.info.driver} is no eye tracker; give the role another")
    return device  # type: ignore[return-value]  # has the verbs that make it one


Builder = Callable[[str, DeviceConfig, Clock, Body | None, int, ExitStack], Device]

_BUILDERS: dict[str, Builder] = {
    **BODY_BUILDERS,
    **GAZE_BUILDERS,
    "simulated_headset": _headset,
    "simulated_responses": _responses,
    "pupil_core": _pupil_core,
    "simulated_armband": _simulated_armband,
    "simulated_body": _body,
}
