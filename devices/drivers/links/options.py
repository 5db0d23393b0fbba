"""Options of devices by the wire they hang on."""

from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from visavis.devices.options import SimulatedOptions


class SerialOptions(SimulatedOptions):
    """A port by name, or by what is plugged in.

    `dtr` is the line that resets boards with a converter and lets those with their own USB send.
    """

    of_wire = frozenset({"port", "vid", "pid", "serial_number", "dtr"})

    port: str = ""
    vid: int | None = Field(default=None, ge=0, le=0xFFFF)
    pid: int | None = Field(default=None, ge=0, le=0xFFFF)
    serial_number: str = ""
    dtr: Literal["auto", "on", "off"] = "auto"


class BandOptions(SimulatedOptions):
    """What every armband takes: how many commands a second its wire may carry."""

    max_rate_hz: float = Field(default=50.0, ge=1, le=1000)


class SerialBandOptions(SerialOptions, BandOptions):
    """An armband on a serial port."""


def long_uuid(uuid: str) -> str:
    """Return a UUID of 16 bits in the 128 bits that Bluetooth's base gives it, lower case."""
    return f"0000{uuid}-0000-1000-8000-00805f9b34fb".lower() if len(uuid) == 4 else uuid.lower()


UUID = r"^([0-9A-Fa-f]{4}|[0-9A-Fa-f]{8}(-[0-9A-Fa-f]{4}){3}-[0-9A-Fa-f]{12}|)$"


class BleOptions(SimulatedOptions):
    """A device by its address, or by the beginning of the name it advertises."""

    address: str = ""
    name: str = ""
    write_uuid: Annotated[str, Field(pattern=UUID), AfterValidator(long_uuid)] = ""
    notify_uuid: Annotated[str, Field(pattern=UUID), AfterValidator(long_uuid)] = ""

    @model_validator(mode="after")
    def _has_a_way(self) -> Self:
        if not self.address and not self.name:
            raise ValueError("give the device's address or the name it advertises")
        return self


class BleBandOptions(BleOptions, BandOptions):
    """A band on Bluetooth LE.

    The serial services of Nordic, HM-10 and Microchip are found by themselves; `write_uuid` and
    `notify_uuid` (16 or 128 bits) name the characteristics of another.
    """

    splits: ClassVar[bool] = True
    """Whether the band takes a message in pieces."""

    @model_validator(mode="after")
    def _both_ways(self) -> Self:
        if bool(self.write_uuid) != bool(self.notify_uuid):
            raise ValueError("give write_uuid and notify_uuid together; they may be the same")
        return self
