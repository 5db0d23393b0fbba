"""Build headset runtimes' devices and body trackers from their configuration.

Devices of one runtime share its connection, per rig; a simulated one lives in this process and
measures the simulated participant.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any
from weakref import WeakKeyDictionary

from cli.wires import BARE, Wires
from devices.body_options import BODY_OPTION_MODELS
from devices.contracts import Body, Device, MovingBody
from devices.datagrams import UdpTransport
from devices.drivers.lsl.body import LslBody
from devices.drivers.lsl.inlet import LslInlet
from devices.drivers.natnet.driver import MOTIVE_BONES, NatNet
from devices.drivers.openvr.controllers import OpenVrControllers
from devices.drivers.openvr.headset import OpenVrHeadset
from devices.drivers.openvr.library import OpenVrLibrary
from devices.drivers.openvr.trackers import OpenVrTrackers
from devices.drivers.openxr.controllers import OpenXrControllers
from devices.drivers.openxr.gaze import OpenXrGaze
from devices.drivers.openxr.headset import OpenXrHeadset
from devices.drivers.openxr.library import OpenXrLibrary
from devices.drivers.xsens.driver import XsensMvn
from devices.sim.faults import FaultSchedule
from devices.sim.lsl.body import LslBodySimulator
from devices.sim.natnet import NatNetSimulator
from devices.sim.openvr.runtime import SimulatedVrRuntime
from devices.sim.openxr.runtime import SimulatedXrRuntime
from devices.sim.xsens import XsensSimulator
from devices.transports import MemoryTransport, MessageTransport
from lab.clock import Clock
from lab.config import DeviceConfig
from lab.errors import ConfigError

Options = dict[str, Any]
Builder = Callable[..., Device]

_SHARED: WeakKeyDictionary[ExitStack, dict[str, Any]] = WeakKeyDictionary()
"""What the devices of one rig share: its runtimes and libraries, by name."""


def build_openvr(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    stack: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build a device of the OpenVR runtime."""
    options, faults = _options(device)
    shared = _SHARED.setdefault(stack, {})
    rate = {"display_rate_hz": options.pop("display_rate_hz", 90.0)}
    options.pop("drift_ppm", None)
    if device.simulated and "openvr runtime" not in shared:
        runtime = SimulatedVrRuntime(_body(role, body), clock, seed=seed, faults=faults, **rate)
        shared["openvr runtime"] = stack.enter_context(runtime)
    if "openvr" not in shared:
        shared["openvr"] = OpenVrLibrary(clock, application="other")
    library: OpenVrLibrary = shared["openvr"]
    if device.driver == "openvr_headset":
        library.show_images()
        return OpenVrHeadset(role, wires.messages(role, library.transport), clock)
    if device.driver == "openvr_controllers":
        wire = wires.messages(role, library.transport)
        return OpenVrControllers(role, wire, clock, **options)
    if device.simulated:
        _moving(role, body)
        shared["openvr runtime"].wear(options["worn"])
    return OpenVrTrackers(role, wires.messages(role, library.transport), clock, **options)


def build_openxr(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    _: int,
    stack: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build a device of the OpenXR runtime."""
    options, faults = _options(device)
    shared = _SHARED.setdefault(stack, {})
    rate_hz = options.pop("display_rate_hz", 90.0)
    if device.simulated and "openxr runtime" not in shared:
        runtime = SimulatedXrRuntime(
            _body(role, body), clock, faults=faults, display_rate_hz=rate_hz
        )
        shared["openxr runtime"] = stack.enter_context(runtime)
    if "openxr" not in shared:
        shared["openxr"] = OpenXrLibrary(clock)
    wire = wires.messages(role, shared["openxr"].transport)
    if device.driver == "openxr_headset":
        return OpenXrHeadset(role, wire, clock)
    if device.driver == "openxr_controllers":
        return OpenXrControllers(role, wire, clock, **options)
    return OpenXrGaze(role, wire, clock, **options)


def build_body_tracker(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    _: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build a body tracker on a stream of its own."""
    options, faults = _options(device)
    drift_ppm = options.pop("drift_ppm")
    wire: Options = {
        key: options.pop(key)
        for key in ("address", "port", "multicast_group", "data_port", "name", "source_id")
        if key in options
    }
    transport: MessageTransport
    if device.simulated:
        known: Options = {
            "seed": seed,
            "faults": faults,
            "drift_ppm": drift_ppm,
            "rate_hz": options["rate_hz"],
        }
        if device.driver == "natnet":
            known["bodies"] = options["bodies"] or MOTIVE_BONES
            known["skeleton"] = "" if options["bodies"] else options["skeleton"] or "Participant"
        elif device.driver == "lsl_body":
            known["objects"] = options["objects"]
        simulator = _SIMULATORS[device.driver](_moving(role, body), clock, **known)
        transport = MemoryTransport(simulator, clock)
    elif device.driver == "xsens":
        transport = UdpTransport(clock, local_port=wire["port"])
    elif device.driver == "natnet":
        group = wire["multicast_group"]
        transport = UdpTransport(
            clock,
            peer=(wire["address"], wire["port"]),
            group=(group, wire["data_port"]) if group else None,
        )
    else:
        transport = LslInlet(
            clock, name=wire["name"], content_type="MoCap", source_id=wire["source_id"]
        )
    return _DRIVERS[device.driver](role, wires.messages(role, lambda: transport), clock, **options)


def _options(device: DeviceConfig) -> tuple[Options, FaultSchedule]:
    options = BODY_OPTION_MODELS[device.driver].model_validate(dict(device.options)).model_dump()
    try:
        return options, FaultSchedule.from_config(options.pop("faults"))
    except ConfigError as error:
        raise ConfigError(f"devices.{device.role}.faults in lab_config.yaml: {error}") from error


def _body(role: str, body: Body | None) -> Body:
    if body is None:
        raise ConfigError(f"{role}: a simulated device needs a simulated participant")
    return body


def _moving(role: str, body: Body | None) -> MovingBody:
    if not isinstance(body, MovingBody):
        raise ConfigError(
            f"{role}: this study's simulated participant has no limbs to track; leave the role out"
        )
    return body


_SIMULATORS: Mapping[str, Callable[..., Any]] = {
    "lsl_body": LslBodySimulator,
    "natnet": NatNetSimulator,
    "xsens": XsensSimulator,
}
_DRIVERS: Mapping[str, Callable[..., Device]] = {
    "lsl_body": LslBody,
    "natnet": NatNet,
    "xsens": XsensMvn,
}
BODY_BUILDERS: Mapping[str, Builder] = {
    "lsl_body": build_body_tracker,
    "natnet": build_body_tracker,
    "openvr_controllers": build_openvr,
    "openvr_headset": build_openvr,
    "openvr_trackers": build_openvr,
    "openxr_controllers": build_openxr,
    "openxr_gaze": build_openxr,
    "openxr_headset": build_openxr,
    "xsens": build_body_tracker,
}
"""Builders by driver name, as `cli.rigs` calls them."""
