"""Bands of other makers, and of a laboratory's own making: their options and descriptions."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Literal

from pydantic import Field, field_validator, model_validator

from visavis.devices.drivers.links.options import (
    BandOptions,
    BleBandOptions,
    SerialBandOptions,
)
from visavis.devices.libraries import BHAPTICS_SDK as SDK
from visavis.devices.libraries import BLE, HID, SERIAL, USB, WEBSOCKETS
from visavis.devices.options import Options
from visavis.devices.spec import AnySpec, Claims, Dialect, DriverSpec, Product, Wire

VHP_BAUD = 1_000_000
PLAYER_REMEDY = "start the bHaptics Player on this computer, switch the unit on and pair it there"


def _within(numbers: list[int], count: int, what: str) -> list[int]:
    if any(not 0 <= number < count for number in numbers) or len(set(numbers)) < len(numbers):
        raise ValueError(f"{what} are different numbers from 0 to {count - 1}")
    return numbers


# ---- Neosensory Buzz -------------------------------------------------------------------------


class BuzzOptions(BleBandOptions):
    """Options of `neosensory_buzz`."""

    name: str = "Buzz"


NEOSENSORY_BUZZ: AnySpec = DriverSpec(
    name="neosensory_buzz",
    kind="armband",
    options=BuzzOptions,
    product=Product(vendor="Neosensory", model="Buzz"),
    wire=Wire(medium="Bluetooth LE", carries="bytes", library=BLE),
    claims=Claims(
        stands_for="Neosensory Buzz, Google's slim board",
        checked="our reading of the vendors' code; genuine bleak over our BlueZ",
        unproven="current firmware; packet sizes",
    ),
)


# ---- Google's vibrotactile boards ------------------------------------------------------------


class VhpSlimOptions(BleBandOptions):
    """Options of `vhp_slim`; `channels` are the board's logical channels."""

    name: str = "Slim"
    channels: list[int] = Field(default=[0, 2, 4, 8], min_length=1, max_length=4)

    splits: ClassVar[bool] = False

    @field_validator("channels")
    @classmethod
    def _exist(cls, channels: list[int]) -> list[int]:
        return _within(channels, 12, "channels")

    def for_simulator(self) -> dict[str, Any]:
        """Return where our motors are among its own."""
        return {"places": self.channels}


class VhpSleeveOptions(SerialBandOptions):
    """Options of `vhp_sleeve`; `channels` are PWM channels from 0."""

    channels: list[int] = Field(default=[5, 7, 8, 6], min_length=1, max_length=4)
    board: Literal["sleeve", "slim"] = "sleeve"

    @field_validator("channels")
    @classmethod
    def _exist(cls, channels: list[int]) -> list[int]:
        return _within(channels, 12, "channels")

    def model(self) -> str:
        """Return which of the two boards it is."""
        return f"VHP {self.board}"

    def for_simulator(self) -> dict[str, Any]:
        """Return where our motors are among its own."""
        return {"places": self.channels}


VHP_SLIM = replace(
    NEOSENSORY_BUZZ,
    name="vhp_slim",
    options=VhpSlimOptions,
    product=Product(vendor="Google (open hardware)", model="VHP slim board"),
)
VHP_SLEEVE: AnySpec = DriverSpec(
    name="vhp_sleeve",
    kind="armband",
    options=VhpSleeveOptions,
    product=Product(vendor="Google (open hardware)", model="VHP sleeve"),
    wire=Wire(medium="serial port", carries="bytes", library=SERIAL),
    claims=Claims(
        stands_for="Google's sleeve, a laboratory's own firmware",
        checked="our reading of VHP's code, text by the lab's own firmware; virtual clock",
        unproven="the adapter; your firmware",
    ),
)


# ---- bHaptics --------------------------------------------------------------------------------


class BhapticsOptions(BandOptions):
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

    def model(self) -> str:
        """Return which arm it is made for."""
        return f"Tactosy {self.position}"

    def for_simulator(self) -> dict[str, Any]:
        """Return which unit it is, and where our motors are on it."""
        return {"position": self.position, "places": self.points}


BHAPTICS = DriverSpec(
    name="bhaptics",
    kind="armband",
    options=BhapticsOptions,
    product=Product(vendor="bHaptics", model="Tactosy ForearmL"),
    wire=Wire(medium="WebSocket", carries="bytes", library=WEBSOCKETS, dials=True),
    remedy=PLAYER_REMEDY,
    claims=Claims(
        stands_for="bHaptics forearm unit",
        checked="our reading of the vendor's first client; a real WebSocket",
        unproven="a current Player",
    ),
)


class BhapticsSdkOptions(BandOptions):
    """Options of `bhaptics_sdk`; `points` are the unit's motors from 0.

    `app_id` and the key are those of an application in bHaptics' developer portal. The key stands
    in a text file of its own, so that no recording contains it.
    """

    of_wire = frozenset({"app_id", "api_key_file"})

    app_id: str = Field(default="", max_length=200)
    api_key_file: str = ""
    position: Literal["ForearmL", "ForearmR", "HandL", "HandR", "FootL", "FootR"] = "ForearmL"
    points: list[int] = Field(default=[0, 2, 3, 5], min_length=1, max_length=4)

    @field_validator("points")
    @classmethod
    def _exist(cls, points: list[int]) -> list[int]:
        return _within(points, 6, "points")

    def model(self) -> str:
        """Return where it is made for."""
        return f"bHaptics {self.position}"

    def for_simulator(self) -> dict[str, Any]:
        """Return which unit it is, and where our motors are on it."""
        return {"position": self.position, "places": self.points}


BHAPTICS_SDK: AnySpec = DriverSpec(
    name="bhaptics_sdk",
    kind="armband",
    options=BhapticsSdkOptions,
    product=Product(vendor="bHaptics", model="TactSleeve"),
    wire=Wire(medium="vendor library", carries="bytes", library=SDK),
    remedy=PLAYER_REMEDY,
    claims=Claims(
        stands_for="bHaptics units on arms, hands and feet, by SDK2",
        checked=(
            "the vendor's package 0.2.0: its calls and what it sends to the port of a Player of "
            "our own"
        ),
        unproven="a Player; points of a sleeve with three motors; that a stop cuts a frame short",
    ),
)


# ---- a laboratory's own text commands --------------------------------------------------------


class AsciiCommands(Options):
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


class AsciiArmbandOptions(SerialBandOptions):
    """Options of `ascii_armband`."""

    baud: int = Field(default=115_200, ge=300, le=3_000_000)
    commands: AsciiCommands


TEXT_UNDERSTOOD: Mapping[str, Any] = {
    "commands": {
        "set_one": "M{motor} {amplitude}\n",
        "stop": "S\n",
        "battery": "B?\n",
        "battery_answer": r"^B (\d+)",
        "refusal_answer": r"^\?",
    }
}
"""What the simulated text band understands; a laboratory's own commands cannot be simulated."""


ASCII_ARMBAND = replace(
    VHP_SLEEVE,
    name="ascii_armband",
    options=AsciiArmbandOptions,
    product=Product(vendor="own firmware", model="text commands"),
    dialect=Dialect(options=TEXT_UNDERSTOOD),
)


# ---- a laboratory's own USB reports ----------------------------------------------------------


class ReportLayoutOptions(Options):
    """Where things stand in a USB band's report; docs/other-armbands.md explains them."""

    report_bytes: int = Field(default=8, ge=1, le=64)
    report_id: int | None = Field(default=None, ge=0, le=255)
    prefix: str = Field(default="", pattern=r"^([0-9a-fA-F]{2})*$")
    first_motor_byte: int = Field(default=0, ge=0, le=63)
    motor_count: int = Field(default=4, ge=1, le=4)
    full_scale: int = Field(default=255, ge=1, le=255)
    ttl_byte: int | None = Field(default=None, ge=0, le=63)
    battery_byte: int | None = Field(default=None, ge=0, le=63)


class HidArmbandOptions(BandOptions):
    """Options of `hid_armband`."""

    no_number: ClassVar[int | None] = 0

    vid: int = Field(ge=0, le=0xFFFF)
    pid: int = Field(ge=0, le=0xFFFF)
    serial_number: str = ""
    layout: ReportLayoutOptions = ReportLayoutOptions()


class UsbArmbandOptions(HidArmbandOptions):
    """Options of `usb_armband`."""

    no_number: ClassVar[int | None] = None


REPORTS_UNDERSTOOD: Mapping[str, Any] = {
    "vid": 0x1209,
    "pid": 0x0001,
    "layout": {"prefix": "a501", "first_motor_byte": 2, "battery_byte": 1},
}
"""The one layout that the simulated report bands understand."""


HID_ARMBAND = DriverSpec(
    name="hid_armband",
    kind="armband",
    options=HidArmbandOptions,
    product=Product(vendor="own firmware", model="report band"),
    wire=Wire(medium="USB HID", carries="bytes", library=HID),
    claims=Claims(
        stands_for="USB bands",
        checked="our own reports; stand-in for hidapi; genuine pyusb",
        unproven="access rights, libusb",
    ),
    dialect=Dialect(options=REPORTS_UNDERSTOOD),
)
USB_ARMBAND = replace(
    HID_ARMBAND,
    name="usb_armband",
    options=UsbArmbandOptions,
    wire=replace(HID_ARMBAND.wire, medium="USB", library=USB),
)
SPECS = (
    NEOSENSORY_BUZZ,
    VHP_SLIM,
    VHP_SLEEVE,
    BHAPTICS,
    BHAPTICS_SDK,
    ASCII_ARMBAND,
    HID_ARMBAND,
    USB_ARMBAND,
)
