"""The options of armbands that are not our own, as `devices.option_models` lists them."""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator


class _Options(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class _BandOptions(_Options):
    faults: list[dict[str, Any]] = Field(default_factory=list)
    """What goes wrong on the simulated wire; docs/devices.md lists the kinds."""
    max_rate_hz: float = Field(default=50.0, ge=1, le=1000)


class _SerialBandOptions(_BandOptions):
    port: str = ""
    vid: int | None = Field(default=None, ge=0, le=0xFFFF)
    pid: int | None = Field(default=None, ge=0, le=0xFFFF)
    serial_number: str = ""


class _BleBandOptions(_BandOptions):
    address: str = ""
    name: str = ""

    @model_validator(mode="after")
    def _has_a_way(self) -> "_BleBandOptions":
        if not self.address and not self.name:
            raise ValueError("give the band's address or the name it advertises")
        return self


class BuzzOptions(_BleBandOptions):
    """Options of `neosensory_buzz`."""

    name: str = "Buzz"


class VhpSlimOptions(_BleBandOptions):
    """Options of `vhp_slim`; `channels` are the board's logical channels."""

    name: str = "Slim"
    channels: list[int] = Field(default=[0, 2, 4, 8], min_length=1, max_length=4)

    @field_validator("channels")
    @classmethod
    def _exist(cls, channels: list[int]) -> list[int]:
        return _within(channels, 12, "channels")


class VhpSleeveOptions(_SerialBandOptions):
    """Options of `vhp_sleeve`; `channels` are PWM channels from 0."""

    channels: list[int] = Field(default=[5, 7, 8, 6], min_length=1, max_length=4)
    board: Literal["sleeve", "slim"] = "sleeve"

    @field_validator("channels")
    @classmethod
    def _exist(cls, channels: list[int]) -> list[int]:
        return _within(channels, 12, "channels")


class BhapticsOptions(_BandOptions):
    """Options of `bhaptics`; `points` are the unit's motors from 0."""

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=15881, ge=1, le=65535)
    position: Literal["ForearmL", "ForearmR"] = "ForearmL"
    points: list[int] = Field(default=[0, 2, 3, 5], min_length=1, max_length=4)
    app_id: str = "visavis"

    @field_validator("points")
    @classmethod
    def _exist(cls, points: list[int]) -> list[int]:
        return _within(points, 6, "points")


class AsciiCommands(_Options):
    """The templates of `ascii_armband`; docs/other-armbands.md explains them."""

    set_one: str = ""
    set_all: str = ""
    stop: str = ""
    opening: list[str] = Field(default_factory=list)
    closing: list[str] = Field(default_factory=list)
    battery: str = ""
    battery_answer: str = ""
    refusal_answer: str = ""
    motor_count: int = Field(default=4, ge=1, le=4)
    first_motor: int = Field(default=0, ge=0, le=1000)
    full_scale: int = Field(default=255, ge=1, le=65535)

    @model_validator(mode="after")
    def _sets_motors(self) -> "AsciiCommands":
        if bool(self.set_one) == bool(self.set_all):
            raise ValueError("give either set_one or set_all")
        return self


class AsciiArmbandOptions(_SerialBandOptions):
    """Options of `ascii_armband`."""

    baud: int = Field(default=115_200, ge=300, le=3_000_000)
    commands: AsciiCommands


class ReportLayoutOptions(_Options):
    """Where things stand in a USB band's report; docs/other-armbands.md explains them."""

    report_bytes: int = Field(default=8, ge=1, le=64)
    report_id: int | None = Field(default=None, ge=0, le=255)
    prefix: str = Field(default="", pattern=r"^([0-9a-fA-F]{2})*$")
    first_motor_byte: int = Field(default=0, ge=0, le=63)
    motor_count: int = Field(default=4, ge=1, le=4)
    full_scale: int = Field(default=255, ge=1, le=255)
    ttl_byte: int | None = Field(default=None, ge=0, le=63)
    battery_byte: int | None = Field(default=None, ge=0, le=63)


class ReportArmbandOptions(_BandOptions):
    """Options of `hid_armband` and `usb_armband`."""

    vid: int = Field(ge=0, le=0xFFFF)
    pid: int = Field(ge=0, le=0xFFFF)
    serial_number: str = ""
    layout: ReportLayoutOptions = ReportLayoutOptions()


class BleArmbandOptions(_BleBandOptions):
    """Options of `ble_armband`: our own protocol over Bluetooth LE."""


class SppArmbandOptions(_BandOptions):
    """Options of `spp_armband`: our own protocol over Bluetooth classic's serial port."""

    port: str = ""
    address: str = Field(default="", pattern=r"^([0-9A-Fa-f]{2}(:[0-9A-Fa-f]{2}){5})?$")
    channel: int = Field(default=1, ge=1, le=30)

    @model_validator(mode="after")
    def _has_a_way(self) -> "SppArmbandOptions":
        if bool(self.port) == bool(self.address):
            raise ValueError("give either port (the paired serial port) or address")
        return self


BAND_OPTION_MODELS: Mapping[str, type[BaseModel]] = {
    "ascii_armband": AsciiArmbandOptions,
    "bhaptics": BhapticsOptions,
    "ble_armband": BleArmbandOptions,
    "hid_armband": ReportArmbandOptions,
    "neosensory_buzz": BuzzOptions,
    "spp_armband": SppArmbandOptions,
    "usb_armband": ReportArmbandOptions,
    "vhp_sleeve": VhpSleeveOptions,
    "vhp_slim": VhpSlimOptions,
}
"""Options by driver name."""


def _within(numbers: list[int], count: int, what: str) -> list[int]:
    if any(not 0 <= number < count for number in numbers) or len(set(numbers)) < len(numbers):
        raise ValueError(f"{what} are different numbers from 0 to {count - 1}")
    return numbers
