"""The description of a driver: all that Visavis knows of it before it is used.

A driver is described once, by a `DriverSpec` beside it, whoever made it. The module that holds the
description imports no driver, simulator or vendor library; its functions do, once they are called.
"""

import importlib
import zlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar, cast

from pydantic import ValidationError

from visavis.devices.libraries import Library
from visavis.devices.options import Options
from visavis.lab.errors import ConfigError

if TYPE_CHECKING:
    from visavis.devices.byte_links import ByteLink
    from visavis.devices.contracts import Body, Device, DeviceInfo, MovingBody
    from visavis.devices.faults import FaultSchedule
    from visavis.devices.transports import MessageTransport
    from visavis.lab.clock import Clock

Kind = Literal[
    "eye tracker",
    "headset",
    "responses",
    "body tracker",
    "armband",
    "sound output",
    "triggers",
    "other",
]
O = TypeVar("O", bound=Options)  # noqa: E741 - of options


@dataclass(frozen=True)
class Site(Generic[O]):
    """Where a device is to work: its role, its options, and what is around it.

    `body` is whom a simulated device measures and `faults` what goes wrong on its wire; `seed` is
    the session's. What the devices of one rig share stands in `shared`; what has to be closed
    after them goes on `stack`.
    """

    spec: "DriverSpec[O]"
    role: str
    clock: "Clock"
    options: O
    body: "Body | None" = None
    faults: "FaultSchedule | None" = None
    seed: int = 0
    shared: dict[str, Any] = field(default_factory=dict)
    stack: ExitStack = field(default_factory=ExitStack)

    @property
    def own_seed(self) -> int:
        """The seed of this role alone: no two devices of a session share their noise."""
        return zlib.crc32(self.role.encode()) + self.seed

    @property
    def watched(self) -> "Body":
        """The body that is measured; raises ConfigError when there is none."""
        if self.body is None:
            raise ConfigError(f"{self.role}: a simulated device needs a simulated participant")
        return self.body

    @property
    def moving(self) -> "MovingBody":
        """The body as one with limbs and skin; raises ConfigError when it has none."""
        if not hasattr(self.watched, "feel"):
            raise ConfigError(
                f"{self.role}: this study's simulated participant has no limbs to track and feels "
                "nothing; leave the role out"
            )
        return cast("MovingBody", self.body)

    def peer(self, simulator: str) -> Any:
        """Return a simulator ("module:Class") that streams what it measures of the body.

        It is given body, clock, seed, faults and what the options say for it.
        """
        has_limbs = self.spec.kind in ("body tracker", "armband")
        return imported(simulator)(
            self.moving if has_limbs else self.watched,
            clock=self.clock,
            seed=self.seed,
            faults=self.faults,
            **self.options.for_simulator(),
        )


def imported(target: str) -> Any:
    """Return what "module:name" names; the module is imported only now."""
    module, _, name = target.partition(":")
    return getattr(importlib.import_module(module), name)


def driven_by(driver: str) -> Callable[[Site[Any], Any], "Device"]:
    """Return a `make`: a driver ("module:Class") that takes role, wire, clock and its options."""

    def make(site: Site[Any], wire: Any) -> "Device":
        device: Any = imported(driver)(site.role, wire, site.clock, **site.options.for_driver())
        if site.spec.kind == "eye tracker":
            delay_ms = getattr(site.options, "gaze_delay_ms", None)
            device.info = replace(device.info, gaze_delay_ms=delay_ms)
        return cast("Device", device)

    return make


def wired_by(wire: str, *names: str, **more: Any) -> Callable[[Site[Any]], "MessageTransport"]:
    """Return a `real`: a wire ("module:Class") that takes the options named, then the clock."""

    def make(site: Site[Any]) -> "MessageTransport":
        given = [getattr(site.options, name) for name in names]
        transport: MessageTransport = imported(wire)(*given, site.clock, **more)
        return transport

    return make


def streamed_by(simulator: str) -> Callable[[Site[Any]], "MessageTransport"]:
    """Return a `simulated`: a memory wire to `Site.peer`."""

    def wire(site: Site[Any]) -> "MessageTransport":
        from visavis.devices.transports import MemoryTransport

        return MemoryTransport(site.peer(simulator), site.clock)

    return wire


def spoken_by(simulator: str) -> Callable[[Site[Any]], "ByteLink"]:
    """Return a `simulated`: a memory link to a device ("module:Class") that speaks by itself.

    It is given role, clock, seed, body and faults, and what the options say for it.
    """

    def link(site: Site[Any]) -> "ByteLink":
        from visavis.devices.byte_links import MemoryLink

        peer = imported(simulator)(
            site.role,
            site.clock,
            seed=site.own_seed,
            body=site.body,
            faults=site.faults,
            **site.options.for_simulator(),
        )
        return MemoryLink(peer, site.clock)

    return link


def worn_as(simulator: str, **more: Any) -> Callable[[Site[Any]], "ByteLink"]:
    """Return a `simulated`: a memory link to a band ("module:Class") which the body feels."""

    def link(site: Site[Any]) -> "ByteLink":
        from visavis.devices.byte_links import MemoryLink

        options = {"seed": 0, **more, **site.options.for_simulator()}
        options["seed"] += site.own_seed
        peer = imported(simulator)(
            site.role, site.clock, body=site.moving, faults=site.faults, **options
        )
        return MemoryLink(peer, site.clock)

    return link


def no_wire(site: Site[Any]) -> None:
    """Stand where a device has no wire that could be captured."""


@dataclass(frozen=True)
class DriverSpec(Generic[O]):
    """One driver: its name in `lab_config.yaml`, what it is for, and how to come by a device.

    `make` puts the driver on a wire: what `real` or `simulated` returned, or a replay. `carries`
    says what crosses it: messages (`MessageTransport`), bytes (`ByteLink`) or nothing that could be
    captured. Without `real` it exists in simulation only, without `simulated` it has no simulator.
    `understood` are the options that its simulator takes, where it knows one dialect only.
    """

    name: str
    kind: Kind
    options: type[O]
    make: Callable[[Site[O], Any], "Device"]
    real: Callable[[Site[O]], Any] | None = None
    simulated: Callable[[Site[O]], Any] | None = None
    set_up: Callable[[Site[O]], str] | None = None
    """Leads the operator through the device's own set-up and says what came of it."""
    carries: Literal["messages", "bytes", "nothing"] = "messages"
    understood: Mapping[str, Any] = field(default_factory=dict)
    speaks_as: str = ""
    """The driver of the real device whose protocol it speaks, of one that is simulated only."""

    vendor: str = ""
    model: str = ""
    wire: str = "none"
    """What it speaks over, in words."""
    remedy: str = ""
    """What to do when it is not there."""
    capabilities: frozenset[str] = frozenset()
    library: Library | None = None
    runtime: Literal["", "openvr", "openxr", "fove"] = ""
    """A program or vendor library that runs beside ours."""
    hears_window: bool = False
    """Its wire is the participant's window: without one it hears nothing."""
    dials: bool = False
    """`address` and `port` of the options are dialled."""
    listens: tuple[str, ...] = ()
    """What the firewall must let in, such as "UDP {port}"; names in braces are options."""
    binds: str = ""
    """The option whose UDP port nobody else may hold."""
    stands_for: str = ""
    """The devices it drives, for docs/devices.md; `vendor` and `model` when left out."""
    checked: str = ""
    """Against what its bytes were held, "our reading" of a document too, and on which boundary."""
    unproven: str = ""
    """What only the real unit can show."""

    def info(self, role: str, wire: Any) -> "DeviceInfo":
        """Return who the device is before it is open; without a wire (None) it is simulated."""
        from visavis.devices.contracts import DeviceInfo

        return DeviceInfo(
            role=role,
            driver=self.name,
            driver_version="1",
            vendor=self.vendor,
            model=self.model,
            serial="" if wire is not None else "simulated",
            transport="none" if wire is None else wire.kind,
            is_simulated=wire is None or wire.is_simulated,
            capabilities=self.capabilities,
        )

    def checked_options(self, role: str, given: Mapping[str, Any]) -> O:
        """Return options with their defaults; raises ConfigError naming what is wrong."""
        try:
            return self.options.model_validate(dict(given))
        except ValidationError as wrong:
            told = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in wrong.errors())
            raise ConfigError(f"devices.{role} ({self.name}): {told}; correct it") from wrong

    def on_wire(self, role: str, clock: "Clock", wire: Any = None, /, **options: Any) -> "Device":
        """Return the device on a wire that is given, or on its real one: for scripts and tests."""
        site = Site(self, role, clock, self.checked_options(role, options))
        if wire is None and self.real is not None:
            wire = self.real(site)
        return self.make(site, wire)


AnySpec = DriverSpec[Any]
