"""Build the device of a role from its configuration, real, simulated or played back."""

from contextlib import ExitStack
from typing import Any
from weakref import WeakKeyDictionary

from visavis.devices.contracts import Body, Device
from visavis.devices.faults import FaultSchedule
from visavis.devices.registry import driver_spec, driver_wiring
from visavis.devices.spec import AnySpec
from visavis.devices.wires import BARE, Wires
from visavis.devices.wiring import AnyWiring, Site
from visavis.lab.clock import Clock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import ConfigError, DeviceNotFound

_SHARED_OBJECTS: WeakKeyDictionary[ExitStack, dict[str, Any]] = WeakKeyDictionary()
"""What the devices of one rig share: its runtimes and libraries, by name."""


def build_device(
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    stack: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build the device of one role; nothing is opened yet.

    Raises:
        ConfigError: a simulated device has no body to measure or no simulator, an option or a
            fault is wrong.
        DeviceNotFound: the driver needs a library that is not installed, its options name no
            device, or it exists in simulation only.
    """
    role, spec = device.role, driver_spec(device.driver)
    if device.simulated and body is None:
        raise ConfigError(f"{role}: a simulated device needs a simulated participant")
    options, faults = checked_device(device)
    shared_objects = _SHARED_OBJECTS.setdefault(stack, {})
    site = Site(spec, role, clock, options, body, faults, seed, shared_objects, stack)
    try:
        wiring = driver_wiring(device.driver)
        return wiring.make(site, _wire(wiring, site, wires, is_simulated=device.simulated))
    except DeviceNotFound as problem:
        message = str(problem).removesuffix(f"; {problem.remedy}")
        raise DeviceNotFound(message, role=role, remedy=problem.remedy) from problem
    except ImportError as cause:
        raise _missing(spec, cause) from cause


def checked_device(device: DeviceConfig) -> tuple[Any, FaultSchedule]:
    """Return a device's options as its driver reads them, and the faults it is simulated with.

    Raises:
        ConfigError: an option or a fault is wrong.
    """
    role, spec = device.role, driver_spec(device.driver)
    raw_options = dict(device.options)
    if device.simulated:
        raw_options |= spec.dialect.options
    options = spec.checked_options(role, raw_options)
    return options, FaultSchedule.from_config(getattr(options, "faults", ()))


def _wire(wiring: AnyWiring, site: Site[Any], wires: Wires, *, is_simulated: bool) -> Any:
    spec, maker = wiring.spec, wiring.simulated if is_simulated else wiring.real
    if maker is None and is_simulated:
        raise ConfigError(
            f"devices.{site.role}: driver {spec.name!r} has no simulator; set `simulated: false`"
        )
    if maker is None:
        raise DeviceNotFound(
            f"{spec.name} has no real counterpart",
            remedy="set `simulated: true`, name a real device's driver, or leave the role out",
        )
    if spec.wire.carries == "nothing":
        return maker(site)
    if spec.wire.carries == "bytes":
        return wires.link(site.role, lambda: maker(site))
    return wires.messages(site.role, lambda: maker(site))


def _missing(spec: AnySpec, cause: ImportError) -> Exception:
    library = (cause.name or "").partition(".")[0]
    if not library:
        return ConfigError(f"driver {spec.name!r} cannot be imported: {cause}")
    install = spec.wire.library.install if spec.wire.library else f"pip install {library}"
    return DeviceNotFound(
        f"driver {spec.name!r} needs the library {library!r}, which is not installed",
        remedy=f"run: {install}",
    )
