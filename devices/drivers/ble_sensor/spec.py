"""Sensors on Bluetooth LE: options and description."""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from visavis.devices.drivers.links.options import UUID, BleOptions, long_uuid
from visavis.devices.libraries import BLE
from visavis.devices.options import Options
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

HEX = r"^([0-9A-Fa-f]{2})*$"


class ColumnOptions(Options):
    """A number of a notification: its byte, its type, its unit (UCUM) and the factor to it."""

    name: str = Field(min_length=1)
    at: int = Field(ge=0, le=511)
    kind: Literal["u1", "u2", "u3", "u4", "i1", "i2", "i3", "i4", "f4", "f8"]
    unit: str = "1"
    factor: float = 1.0
    is_big_endian: bool = False


class BleSensorOptions(BleOptions):
    """Options of `ble_sensor`.

    `profile` is `heart_rate` (any chest strap), `polar_ecg` (a Polar H10), or `own`: then
    `notify_uuid`, `columns` and what else the sensor needs are given.
    """

    profile: Literal["heart_rate", "polar_ecg", "own"] = "heart_rate"
    name: str = "Polar"
    columns: list[ColumnOptions] = Field(default_factory=list)
    hello: str = Field(default="", pattern=HEX)
    """Bytes, in hexadecimal, that start the sensor; written to `write_uuid`."""
    rate_hz: float = Field(default=0.0, ge=0, le=10_000)
    write_uuid: Annotated[str, Field(pattern=UUID), AfterValidator(long_uuid)] = ""
    lost_after_s: float = Field(default=10.0, gt=0, le=600)

    @model_validator(mode="after")
    def _own_is_described(self) -> Self:
        is_own = self.profile == "own"
        if is_own and not (self.notify_uuid and self.columns):
            raise ValueError("profile own needs notify_uuid and columns")
        if not is_own and (self.notify_uuid or self.columns or self.hello):
            raise ValueError(f"profile {self.profile} has its own columns; write profile: own")
        if self.hello and not self.write_uuid:
            raise ValueError("hello needs the write_uuid that it is written to")
        return self

    def for_simulator(self) -> dict[str, Any]:
        """Return what the simulated sensor sends."""
        size = max((c.at + int(c.kind[1:]) for c in self.columns), default=1)
        return {"profile": self.profile, "packet_bytes": size, "packets_hz": self.rate_hz or 1.0}


BLE_SENSOR = DriverSpec(
    name="ble_sensor",
    kind="other",
    options=BleSensorOptions,
    product=Product(vendor="any", model="Bluetooth sensor"),
    wire=Wire(medium="Bluetooth LE", carries="bytes", library=BLE),
    remedy=(
        "put the strap on and wet its electrodes; disconnect it from watches and phones; switch "
        "Bluetooth on"
    ),
    claims=Claims(
        stands_for="chest straps (heart rate), the ECG of a Polar H10, any sensor that notifies",
        checked="our reading of the Bluetooth SIG's and Polar's documents; bleak over our BlueZ",
        unproven="any strap: packet sizes, delay, what it sends off the skin",
    ),
)
SPECS = (BLE_SENSOR,)
