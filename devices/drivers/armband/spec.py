"""Our armband on a cable, over Bluetooth, and in simulation alone."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pydantic import Field, model_validator

from visavis.devices.drivers.links.options import (
    BandOptions,
    BleBandOptions,
    SerialBandOptions,
    own_link,
)
from visavis.devices.libraries import BLE, SERIAL
from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import AnySpec, DriverSpec, Site, worn_as

if TYPE_CHECKING:
    from visavis.devices.byte_links import ByteLink
    from visavis.devices.drivers.armband.driver import ArmbandDriver
    from visavis.lab.clock import Clock

BAUD = 38_400


class SerialArmbandOptions(SerialBandOptions):
    """Options of `serial_armband`: a port by name, or by what is plugged in."""

    baud: int = Field(default=BAUD, ge=1200, le=3_000_000)
    max_rate_hz: float = Field(default=150.0, ge=1, le=1000)

    def link(self, clock: "Clock") -> "ByteLink":
        """Return its serial port."""
        return self.serial_link(clock, self.baud)


class BleArmbandOptions(BleBandOptions):
    """Options of `ble_armband`: our own protocol over Bluetooth LE."""


class SppArmbandOptions(BandOptions):
    """Options of `spp_armband`: our own protocol over Bluetooth classic's serial port."""

    port: str = ""
    address: str = Field(default="", pattern=r"^([0-9A-Fa-f]{2}(:[0-9A-Fa-f]{2}){5})?$")
    channel: int = Field(default=1, ge=1, le=30)

    @model_validator(mode="after")
    def _has_a_way(self) -> "SppArmbandOptions":
        if bool(self.port) == bool(self.address):
            raise ValueError("give either port (the paired serial port) or address")
        return self

    def link(self, clock: "Clock") -> "ByteLink":
        """Return the paired serial port, or the way by address."""
        from visavis.devices.drivers.links.rfcomm import RfcommLink
        from visavis.devices.drivers.links.serial_port import SerialLink

        if self.port:
            return SerialLink(clock, port=self.port, baud=BAUD)
        return RfcommLink(clock, address=self.address, channel=self.channel)


class SimulatedArmbandOptions(SimulatedOptions):
    """Options of `simulated_armband`; the link's delays, the band's clock and motors."""

    seed: int = Field(default=0, ge=0)
    latency_ms: float = Field(default=1.0, ge=0, le=1000)
    jitter_ms: float = Field(default=0.5, ge=0, le=1000)
    rise_ms: float = Field(default=30.0, ge=0, le=1000)
    max_rate_hz: float = Field(default=150.0, ge=1, le=1000)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )

    def for_simulator(self) -> dict[str, Any]:
        """Return the link's delays, the band's clock and motors."""
        return self.model_dump(exclude={"faults", "max_rate_hz"})


def _armband(site: Site[Any], link: "ByteLink") -> "ArmbandDriver":
    from visavis.devices.drivers.armband.dialect import FramedDialect
    from visavis.devices.drivers.armband.driver import ArmbandDriver

    rate_hz = site.options.max_rate_hz
    return ArmbandDriver(
        site.role, link, FramedDialect(), site.clock, spec=site.spec, max_rate_hz=rate_hz
    )


SERIAL_ARMBAND: AnySpec = DriverSpec(
    name="serial_armband",
    kind="armband",
    options=SerialArmbandOptions,
    make=_armband,
    real=own_link,
    simulated=worn_as("visavis.devices.sim.armband.simulator:ArmbandSimulator"),
    carries="bytes",
    vendor="Visavis",
    model="armband",
    wire="serial port",
    capabilities=frozenset({"haptics", "rate", "patterns"}),
    library=SERIAL,
    stands_for="our armband, cable",
    checked="our own firmware's image in simavr, on a pseudo-terminal",
    unproven="motors, skin, radio, battery under load",
)
BLE_ARMBAND: AnySpec = replace(
    SERIAL_ARMBAND,
    name="ble_armband",
    options=BleArmbandOptions,
    wire="Bluetooth LE",
    library=BLE,
    stands_for="our armband, Bluetooth",
    checked="our own protocol; genuine bleak over our BlueZ; RFCOMM of a virtual radio",
    unproven="intervals, pairing, jitter",
)
SPP_ARMBAND = replace(
    BLE_ARMBAND,
    name="spp_armband",
    options=SppArmbandOptions,
    wire="Bluetooth serial",
    library=SERIAL,
)
SIMULATED_ARMBAND = replace(
    SERIAL_ARMBAND,
    name="simulated_armband",
    options=SimulatedArmbandOptions,
    real=None,
    wire="none",
    library=None,
    speaks_as="serial_armband",
    stands_for="",
    checked="",
    unproven="",
)
SPECS = (SERIAL_ARMBAND, BLE_ARMBAND, SPP_ARMBAND, SIMULATED_ARMBAND)
