"""Options of devices by the wire they hang on."""

from typing import ClassVar

from pydantic import Field, model_validator

from visavis.devices.options import SimulatedOptions


class SerialOptions(SimulatedOptions):
    """A port by name, or by what is plugged in."""

    of_wire = frozenset({"port", "vid", "pid", "serial_number"})

    port: str = ""
    vid: int | None = Field(default=None, ge=0, le=0xFFFF)
    pid: int | None = Field(default=None, ge=0, le=0xFFFF)
    serial_number: str = ""


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
