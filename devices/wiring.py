"""How a device is put together: its driver, on its real wire or on a simulated one.

The module `wiring` of a driver's package holds a `Wiring` for each description (`DriverSpec`) of
the module `spec` next to it. It imports driver and simulator like any module. Only
`visavis.devices.registry.driver_wiring` imports it, when a device is built.
"""

import zlib
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any, Concatenate, Generic, TypeVar, cast

from visavis.devices.byte_links import ByteLink, BytePeer, MemoryLink
from visavis.devices.contracts import Body, Device, MovingBody
from visavis.devices.faults import FaultSchedule
from visavis.devices.options import Options
from visavis.devices.spec import DriverSpec
from visavis.devices.transports import MemoryTransport, MessageTransport, Peer
from visavis.lab.clock import Clock
from visavis.lab.errors import ConfigError

O = TypeVar("O", bound=Options)  # noqa: E741 - of options
P = TypeVar("P", bound=Peer)
W = TypeVar("W")
"""The wire of a driver: a `MessageTransport`, a `ByteLink`, or a type that it alone knows."""


@dataclass(frozen=True)
class Site(Generic[O]):
    """The surroundings of a device: its role, its options, and the session around it."""

    spec: DriverSpec[O]
    role: str
    clock: Clock
    options: O
    body: Body | None = None
    """The body that a simulated device measures."""
    faults: FaultSchedule | None = None
    """The faults of a simulated wire."""
    seed: int = 0
    """The session's."""
    shared: dict[str, Any] = field(default_factory=dict)
    """Objects shared by the devices of one rig, such as a runtime's connection, by name."""
    stack: ExitStack = field(default_factory=ExitStack)
    """Resources to close after the devices."""

    @property
    def own_seed(self) -> int:
        """The seed of this role alone: no two devices of a session share their noise."""
        return zlib.crc32(self.role.encode()) + self.seed

    @property
    def watched(self) -> Body:
        """The body that is measured; raises ConfigError when there is none."""
        if self.body is None:
            raise ConfigError(f"{self.role}: a simulated device needs a simulated participant")
        return self.body

    @property
    def moving(self) -> MovingBody:
        """The body as one with limbs and skin; raises ConfigError when it has none."""
        if not hasattr(self.watched, "feel"):
            raise ConfigError(
                f"{self.role}: this study's simulated participant has no limbs to track and feels "
                "nothing; leave the role out"
            )
        return cast("MovingBody", self.body)


@dataclass(frozen=True)
class Wiring(Generic[O, W]):
    """How the device of one description is built."""

    spec: DriverSpec[O]
    make: Callable[[Site[O], W], Device]
    """Puts the driver on a wire: what `real` or `simulated` returned, or a replay."""
    real: Callable[[Site[O]], W] | None = None
    """Returns the wire to the device; None: it exists in simulation only."""
    simulated: Callable[[Site[O]], W] | None = None
    """Returns a wire to its simulator; None: it has none."""
    set_up: Callable[[Site[O]], str] | None = None
    """Leads the operator through the device's own set-up and returns the result in words."""

    def on_wire(self, role: str, clock: Clock, wire: W | None = None, /, **options: Any) -> Device:
        """Return the device on a wire of the caller's, or on its real one: for scripts and tests.

        Raises:
            ConfigError: an option is wrong.
            DeviceNotFound: the options name no device.
        """
        site = Site(self.spec, role, clock, self.spec.checked_options(role, options))
        if wire is None and self.real is not None:
            wire = self.real(site)
        return self.make(site, cast("W", wire))


AnyWiring = Wiring[Any, Any]


def driven_by(
    driver: Callable[Concatenate[str, W, Clock, ...], Device],
) -> Callable[[Site[Any], W], Device]:
    """Return a `make`: a driver that takes role, wire, clock and its options."""

    def make(site: Site[Any], wire: W) -> Device:
        device: Any = driver(site.role, wire, site.clock, **site.options.for_driver())
        if site.spec.kind == "eye tracker":
            delay_ms = getattr(site.options, "gaze_delay_ms", None)
            device.info = replace(device.info, gaze_delay_ms=delay_ms)
        return cast("Device", device)

    return make


def wired_by(wire: Callable[..., W], *names: str, **more: Any) -> Callable[[Site[Any]], W]:
    """Return a `real`: a wire that takes the options of these names, then the clock."""

    def real(site: Site[Any]) -> W:
        return wire(*(getattr(site.options, name) for name in names), site.clock, **more)

    return real


def linked_by(link: Callable[..., W], *names: str, **more: Any) -> Callable[[Site[Any]], W]:
    """Return a `real`: a link that takes the clock, and the options of these names by name."""

    def real(site: Site[Any]) -> W:
        return link(site.clock, **{name: getattr(site.options, name) for name in names}, **more)

    return real


def streaming_peer(site: Site[Any], simulator: Callable[..., P]) -> P:
    """Return a simulator that streams what it measures of the body.

    It is made from body, clock, seed, faults and its options.
    """
    has_limbs = site.spec.kind in ("body tracker", "armband")
    return simulator(
        site.moving if has_limbs else site.watched,
        clock=site.clock,
        seed=site.seed,
        faults=site.faults,
        **site.options.for_simulator(),
    )


def streamed_by(simulator: Callable[..., Peer]) -> Callable[[Site[Any]], MessageTransport]:
    """Return a `simulated`: a memory wire to a `streaming_peer`."""
    return lambda site: MemoryTransport(streaming_peer(site, simulator), site.clock)


def spoken_by(simulator: Callable[..., BytePeer]) -> Callable[[Site[Any]], ByteLink]:
    """Return a `simulated`: a memory link to a device that speaks by itself.

    It is made from role, clock, seed, body, faults and its options.
    """

    def link(site: Site[Any]) -> ByteLink:
        peer = simulator(
            site.role,
            site.clock,
            seed=site.own_seed,
            body=site.body,
            faults=site.faults,
            **site.options.for_simulator(),
        )
        return MemoryLink(peer, site.clock)

    return link


def worn_as(simulator: Callable[..., BytePeer], **more: Any) -> Callable[[Site[Any]], ByteLink]:
    """Return a `simulated`: a memory link to a band which the body feels."""

    def link(site: Site[Any]) -> ByteLink:
        options = {"seed": 0, **more, **site.options.for_simulator()}
        options["seed"] += site.own_seed
        peer = simulator(site.role, site.clock, body=site.moving, faults=site.faults, **options)
        return MemoryLink(peer, site.clock)

    return link


def no_wire(site: Site[Any]) -> None:
    """Return None: the device has no wire that could be captured."""
