"""Build Pupil Core, and what exists in simulation only, from a lab's configuration."""

from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

from cli.armband_builders import moving_body
from cli.wires import BARE, Wires
from devices.contracts import Body, Device
from devices.drivers.pupil.driver import PupilCore
from devices.sim.body.tracker import SimulatedBodyTracker
from devices.sim.faults import FaultSchedule
from devices.sim.headset import SimulatedHeadset
from devices.sim.pupil.capture import PupilCoreSimulator
from devices.sim.responses import SimulatedResponses
from devices.sim.zmq_host import ZmqHost
from devices.transports import MemoryTransport, MessageTransport, ZmqTransport
from lab.clock import Clock
from lab.config import DeviceConfig
from lab.errors import ConfigError, DeviceNotFound


def build_headset(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    _: int,
    __: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build the headset without optics."""
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


def build_responses(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    _: int,
    __: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build the buttons a simulated participant presses."""
    if body is None or not device.simulated:
        raise DeviceNotFound(
            "simulated_responses has no real counterpart",
            role=role,
            remedy="set `simulated: true`, or leave the role out",
        )
    return SimulatedResponses(role, body, clock)


def build_pupil_core(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    stack: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build Pupil Core; a simulated one answers on real sockets when the clock is real."""
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
    wire = wires.messages(role, lambda: transport)
    return PupilCore(role, wire, clock, rate_hz=rate_hz, **options)


def build_body(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    _: int,
    __: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build the body tracker that exists in simulation only."""
    if body is None or not device.simulated:
        raise DeviceNotFound(
            "simulated_body has no real counterpart",
            role=role,
            remedy="set `simulated: true`, or name a real body tracker's driver",
        )
    rate_hz = float(device.options.get("rate_hz", 100))
    return SimulatedBodyTracker(
        role, moving_body(role, body), clock, rate_hz=rate_hz, faults=_faults(device)
    )


def _faults(device: DeviceConfig) -> FaultSchedule:
    try:
        return FaultSchedule.from_config(device.options.get("faults", ()))
    except ConfigError as error:
        raise ConfigError(f"devices.{device.role}.faults in lab_config.yaml: {error}") from error


BASIC_BUILDERS: Mapping[str, Any] = {
    "simulated_headset": build_headset,
    "simulated_responses": build_responses,
    "pupil_core": build_pupil_core,
    "simulated_body": build_body,
}
"""Builders by driver name, as `cli.rigs` calls them."""
