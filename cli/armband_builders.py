"""Build armbands from a lab's configuration, real or simulated."""

import zlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any, cast

from cli.wires import BARE, Wires
from devices import registry
from devices.byte_links import ByteLink, MemoryLink
from devices.contracts import Body, Device, MovingBody
from devices.drivers.links.by_driver import real_link
from devices.option_models import OPTION_MODELS
from devices.sim.armband.simulator import ArmbandSimulator, simulated_armband
from devices.sim.bands.by_driver import SIMULATED_OPTIONS, SIMULATORS, simulated_link
from devices.sim.faults import FaultSchedule
from lab.clock import Clock
from lab.config import DeviceConfig
from lab.errors import ConfigError, DeviceNotFound

Options = dict[str, Any]

ARMBANDS = ("serial_armband", *sorted(SIMULATORS))
"""Drivers of bands that exist, each of which can be simulated."""

TEXT_AND_REPORT = ("ascii_armband", "hid_armband", "usb_armband")


def build_armband(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    stack: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build a driver of `ARMBANDS`.

    A laboratory's own text or report band is simulated with the commands that the simulator
    understands; the link's limits and the faults are those configured.
    """
    name = device.driver
    options, faults = armband_options(role, device)
    if not device.simulated:
        return _create(name, role, clock, wires, lambda: real_link(name, clock, **options), options)
    moving = moving_body(role, body)
    if name in TEXT_AND_REPORT:
        options.update(SIMULATED_OPTIONS[name])
    own_seed = band_seed(role, seed)

    def simulated() -> ByteLink:
        if name == "serial_armband":
            peer = ArmbandSimulator(role, clock, seed=own_seed, body=moving, faults=faults)
            return MemoryLink(peer, clock)
        return simulated_link(
            name, role, clock, seed=own_seed, body=moving, faults=faults, options=options
        )

    return _create(name, role, clock, wires, simulated, options)


def _create(
    name: str,
    role: str,
    clock: Clock,
    wires: Wires,
    make: Callable[[], ByteLink],
    options: Options,
) -> Device:
    try:
        link = wires.link(role, make)
    except DeviceNotFound as problem:
        message = str(problem).removesuffix(f"; {problem.remedy}")
        raise DeviceNotFound(message, role=role, remedy=problem.remedy) from problem
    return registry.load(name)(role, clock, link=link, **options)


def build_simulated_armband(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    stack: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build the band that exists in simulation only."""
    if body is None or not device.simulated:
        raise DeviceNotFound(
            "simulated_armband has no real counterpart",
            role=role,
            remedy="set `simulated: true`, or name the driver of a real band",
        )
    options, faults = armband_options(role, device)
    own_seed = band_seed(role, seed) + int(options.pop("seed", 0))
    moving = moving_body(role, body)
    return simulated_armband(
        role,
        clock,
        seed=own_seed,
        body=moving,
        faults=faults,
        wrap=lambda link: wires.link(role, lambda: link),
        **options,
    )


def armband_options(role: str, device: DeviceConfig) -> tuple[Options, FaultSchedule]:
    """Return an armband's options with their defaults, and its faults.

    Raises:
        ConfigError: a fault is none that can be scheduled.
    """
    options = OPTION_MODELS[device.driver].model_validate(dict(device.options)).model_dump()
    try:
        return options, FaultSchedule.from_config(options.pop("faults"))
    except ConfigError as error:
        raise ConfigError(f"devices.{role}.faults in lab_config.yaml: {error}") from error


def band_seed(role: str, seed: int) -> int:
    """Return the seed of one band's simulation: no two bands of a session share their noise."""
    return zlib.crc32(role.encode()) + seed


def moving_body(role: str, body: Body | None) -> MovingBody:
    """Return the body as one with limbs and skin.

    Raises:
        ConfigError: there is none, or it feels nothing.
    """
    if body is None:
        raise ConfigError(f"{role}: a simulated device needs a simulated participant")
    if not hasattr(body, "feel"):
        raise ConfigError(
            f"{role}: the simulated participant of this study has no limbs and feels nothing; "
            "leave the role out"
        )
    return cast(MovingBody, body)


ARMBAND_BUILDERS: Mapping[str, Any] = {
    **dict.fromkeys(ARMBANDS, build_armband),
    "simulated_armband": build_simulated_armband,
}
"""Builders by driver name, as `cli.rigs` calls them."""
