"""The description of a driver: all that Visavis knows of it before it is used.

A driver is described once, by a `DriverSpec` in the module `spec` of its package, whoever made it.
That module imports no driver, simulator or vendor library, so that a lab's configuration is checked
without loading any. The module `wiring` next to it constructs drivers (`visavis.devices.wiring`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from pydantic import ValidationError

from visavis.devices.libraries import Library
from visavis.devices.options import Options
from visavis.lab.errors import ConfigError

if TYPE_CHECKING:
    from visavis.devices.contracts import DeviceInfo

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
class Product:
    """What is driven, as the manifest of a session names it."""

    vendor: str = ""
    """Who makes it; "any" where many do."""
    model: str = ""
    """What it is called; a device that tells its own model is asked once it is open."""
    capabilities: frozenset[str] = frozenset()
    """What it can do beyond its kind's contract, such as "calibration" or "rate"."""


@dataclass(frozen=True)
class Wire:
    """What a device speaks over, and what this computer needs for it."""

    medium: str = "none"
    """The wire in words, such as "serial port"."""
    carries: Literal["messages", "bytes", "nothing"] = "messages"
    """What crosses it: messages (`MessageTransport`), bytes (`ByteLink`), or nothing that could be
    captured and replayed."""
    library: Library | None = None
    """The package that has to be installed for it."""
    runtime: Literal["", "openvr", "openxr", "fove"] = ""
    """A program or vendor library that runs next to ours."""
    hears_window: bool = False
    """It is the participant's window: without one the device hears nothing."""
    dials: bool = False
    """`address` and `port` of the options are dialled."""
    listens: tuple[str, ...] = ()
    """What the firewall must let in, such as "UDP {port}"; names in braces are options."""
    binds: str = ""
    """The option with the UDP port that no other program may use."""


@dataclass(frozen=True)
class Claims:
    """What docs/devices.md says of a driver; empty for one that only exists simulated."""

    stands_for: str = ""
    """The devices it drives; vendor and model when left out."""
    checked: str = ""
    """What its bytes were compared with, "our reading" of a document too; on which boundary."""
    unproven: str = ""
    """What only the real unit can show."""


@dataclass(frozen=True)
class Dialect:
    """What a simulated device speaks, where that is not simply what its options say."""

    options: Mapping[str, Any] = field(default_factory=dict)
    """The options that its simulator understands, where it knows one dialect only."""
    driver: str = ""
    """For a device that only exists simulated: the real driver whose protocol it speaks."""


@dataclass(frozen=True)
class DriverSpec(Generic[O]):
    """One driver: its name in `lab_config.yaml`, what it is for, and what it needs."""

    name: str
    """What `driver:` says in `lab_config.yaml`; the same everywhere, so never changed."""
    kind: Kind
    """Which contract of `visavis.devices.contracts` it follows."""
    options: type[O]
    """The options allowed next to `driver`, with their limits and defaults."""
    product: Product = Product()
    """What is driven."""
    wire: Wire = Wire()
    """What it speaks over."""
    remedy: str = ""
    """What the operator is to do when it is not there."""
    claims: Claims = Claims()
    """What is known of it to be true, for the docs."""
    dialect: Dialect = Dialect()
    """What its simulator speaks."""

    def info(self, role: str, wire: Any) -> "DeviceInfo":
        """Return who the device is before it is open; without a wire (None) it is simulated."""
        from visavis.devices.contracts import DeviceInfo  # late: numpy, which no listing needs

        return DeviceInfo(
            role=role,
            driver=self.name,
            driver_version="1",
            vendor=self.product.vendor,
            model=self.product.model,
            serial="" if wire is not None else "simulated",
            transport="none" if wire is None else wire.kind,
            is_simulated=wire is None or wire.is_simulated,
            capabilities=self.product.capabilities,
        )

    def checked_options(self, role: str, values: Mapping[str, Any]) -> O:
        """Return options with their defaults; raises ConfigError naming what is wrong."""
        try:
            return self.options.model_validate(dict(values))
        except ValidationError as wrong:
            faults = (f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in wrong.errors())
            raise ConfigError(
                f"devices.{role} ({self.name}): {'; '.join(faults)}; correct it"
            ) from wrong


AnySpec = DriverSpec[Any]
