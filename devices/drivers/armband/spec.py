"""Our armband on a cable, over Bluetooth, and in simulation alone."""

from dataclasses import replace
from typing import Any

from pydantic import Field, model_validator

from visavis.devices.drivers.links.options import (
    BandOptions,
    BleBandOptions,
    SerialBandOptions,
)
from visavis.devices.libraries import BLE, SERIAL
from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import AnySpec, Claims, Dialect, DriverSpec, Product, Wire

BAUD = 38_400


class SerialArmbandOptions(SerialBandOptions):
    """Options of `serial_armband`: a port by name, or by what is plugged in."""

    baud: int = Field(default=BAUD, ge=1200, le=3_000_000)
    max_rate_hz: float = Field(default=150.0, ge=1, le=1000)


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


SERIAL_ARMBAND: AnySpec = DriverSpec(
    name="serial_armband",
    kind="armband",
    options=SerialArmbandOptions,
    product=Product(
        vendor="Visavis", model="armband", capabilities=frozenset({"haptics", "rate", "patterns"})
    ),
    wire=Wire(medium="serial port", carries="bytes", library=SERIAL),
    claims=Claims(
        stands_for="our armband, cable",
        checked="our own firmware's image in simavr, on a pseudo-terminal",
        unproven="motors, skin, radio, battery under load",
    ),
)
BLE_ARMBAND: AnySpec = replace(
    SERIAL_ARMBAND,
    name="ble_armband",
    options=BleArmbandOptions,
    wire=replace(SERIAL_ARMBAND.wire, medium="Bluetooth LE", library=BLE),
    claims=Claims(
        stands_for="our armband, Bluetooth",
        checked="our own protocol; genuine bleak over our BlueZ; RFCOMM of a virtual radio",
        unproven="intervals, pairing, jitter",
    ),
)
SPP_ARMBAND = replace(
    BLE_ARMBAND,
    name="spp_armband",
    options=SppArmbandOptions,
    wire=replace(BLE_ARMBAND.wire, medium="Bluetooth serial", library=SERIAL),
)
SIMULATED_ARMBAND = replace(
    SERIAL_ARMBAND,
    name="simulated_armband",
    options=SimulatedArmbandOptions,
    wire=Wire(carries="bytes"),
    claims=Claims(),
    dialect=Dialect(driver="serial_armband"),
)
SPECS = (SERIAL_ARMBAND, BLE_ARMBAND, SPP_ARMBAND, SIMULATED_ARMBAND)
