"""Options of devices by the wire they hang on."""

from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field, model_validator

from visavis.devices.options import SimulatedOptions

if TYPE_CHECKING:
    from collections.abc import Callable

    from visavis.devices.byte_links import ByteLink
    from visavis.devices.spec import Site
    from visavis.lab.clock import Clock


class SerialOptions(SimulatedOptions):
    """A port by name, or by what is plugged in."""

    of_wire = frozenset({"port", "vid", "pid", "serial_number"})

    port: str = ""
    vid: int | None = Field(default=None, ge=0, le=0xFFFF)
    pid: int | None = Field(default=None, ge=0, le=0xFFFF)
    serial_number: str = ""

    def serial_link(self, clock: "Clock", baud: int) -> "ByteLink":
        """Return the port; raises DeviceNotFound when the options name none."""
        from visavis.devices.drivers.links.serial_port import SerialLink

        return SerialLink(
            clock,
            port=self.port,
            vid=self.vid,
            pid=self.pid,
            serial_number=self.serial_number,
            baud=baud,
        )


def serial_port(baud: int) -> "Callable[[Site[Any]], ByteLink]":
    """Return a `real`: the serial port that a device's options (`SerialOptions`) name."""

    def link(site: "Site[Any]") -> "ByteLink":
        found: ByteLink = site.options.serial_link(site.clock, baud)
        return found

    return link


class BandOptions(SimulatedOptions):
    """What every armband takes: how many commands a second its wire may carry."""

    max_rate_hz: float = Field(default=50.0, ge=1, le=1000)


class SerialBandOptions(SerialOptions, BandOptions):
    """An armband on a serial port."""


class BleBandOptions(BandOptions):
    """A band by its address, or by the beginning of the name it advertises."""

    splits: ClassVar[bool] = True
    """Whether the band takes a message in pieces."""

    address: str = ""
    name: str = ""

    @model_validator(mode="after")
    def _has_a_way(self) -> "BleBandOptions":
        if not self.address and not self.name:
            raise ValueError("give the band's address or the name it advertises")
        return self

    def link(self, clock: "Clock") -> "ByteLink":
        """Return the link to the first band that fits."""
        from visavis.devices.drivers.links.ble import BleLink

        return BleLink(clock, address=self.address, name=self.name, splits=self.splits)


def own_link(site: "Site[Any]") -> "ByteLink":
    """Return the link that a band's options describe."""
    link: ByteLink = site.options.link(site.clock)
    return link
