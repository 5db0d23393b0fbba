"""Bands of other makers, and of a laboratory's own making: options, wires, simulators."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal
from urllib.parse import urlencode

from pydantic import Field, field_validator, model_validator

from visavis.devices.drivers.links.options import (
    BandOptions,
    BleBandOptions,
    SerialBandOptions,
    own_link,
)
from visavis.devices.libraries import BLE, HID, SERIAL, USB, WEBSOCKETS
from visavis.devices.options import Options
from visavis.devices.spec import AnySpec, DriverSpec, Site, worn_as
from visavis.lab.errors import ConfigError

if TYPE_CHECKING:
    from visavis.devices.byte_links import ByteLink
    from visavis.devices.drivers.bands.driver import HostTimedBand
    from visavis.devices.drivers.bands.language import BandLanguage
    from visavis.lab.clock import Clock

VHP_BAUD = 1_000_000
PLAYER_REMEDY = "start the bHaptics Player on this computer, switch the unit on and pair it there"


def _within(numbers: list[int], count: int, what: str) -> list[int]:
    if any(not 0 <= number < count for number in numbers) or len(set(numbers)) < len(numbers):
        raise ValueError(f"{what} are different numbers from 0 to {count - 1}")
    return numbers


def _band(site: Site[Any], link: "ByteLink") -> "HostTimedBand":
    """Return the driver of a band; its options know the language, and perhaps the model."""
    from visavis.devices.drivers.bands.driver import HostTimedBand

    options = site.options
    spec = replace(site.spec, model=options.model()) if hasattr(options, "model") else site.spec
    try:
        language = options.language()
    except ValueError as cause:
        raise ConfigError(f"devices.{site.role}: {cause}; correct its options") from cause
    rate_hz = options.max_rate_hz
    return HostTimedBand(site.role, link, language, site.clock, spec=spec, max_rate_hz=rate_hz)


# ---- Neosensory Buzz -------------------------------------------------------------------------


class BuzzOptions(BleBandOptions):
    """Options of `neosensory_buzz`."""

    name: str = "Buzz"

    def language(self) -> "BandLanguage":
        """Return what it speaks."""
        from visavis.devices.drivers.bands.buzz_codec import BuzzLanguage

        return BuzzLanguage()


NEOSENSORY_BUZZ: AnySpec = DriverSpec(
    name="neosensory_buzz",
    kind="armband",
    options=BuzzOptions,
    make=_band,
    real=own_link,
    simulated=worn_as("visavis.devices.sim.bands.buzz:BuzzSimulator"),
    carries="bytes",
    vendor="Neosensory",
    model="Buzz",
    wire="Bluetooth LE",
    library=BLE,
    stands_for="Neosensory Buzz, Google's slim board",
    checked="our reading of the vendors' code; genuine bleak over our BlueZ",
    unproven="current firmware; packet sizes",
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

    def language(self) -> "BandLanguage":
        """Return what it speaks."""
        from visavis.devices.drivers.bands.vhp_codec import VhpSlimLanguage

        return VhpSlimLanguage(self.channels)

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

    def link(self, clock: "Clock") -> "ByteLink":
        """Return its serial port."""
        return self.serial_link(clock, VHP_BAUD)

    def model(self) -> str:
        """Return which of the two boards it is."""
        return f"VHP {self.board}"

    def language(self) -> "BandLanguage":
        """Return what it speaks."""
        from visavis.devices.drivers.bands.vhp_codec import SLEEVE, SLIM_BOARD, VhpSleeveLanguage

        return VhpSleeveLanguage(self.channels, SLEEVE if self.board == "sleeve" else SLIM_BOARD)

    def for_simulator(self) -> dict[str, Any]:
        """Return where our motors are among its own."""
        return {"places": self.channels}


VHP_SLIM = replace(
    NEOSENSORY_BUZZ,
    name="vhp_slim",
    options=VhpSlimOptions,
    simulated=worn_as("visavis.devices.sim.bands.vhp:SlimBoardSimulator"),
    vendor="Google (open hardware)",
    model="VHP slim board",
)
VHP_SLEEVE: AnySpec = DriverSpec(
    name="vhp_sleeve",
    kind="armband",
    options=VhpSleeveOptions,
    make=_band,
    real=own_link,
    simulated=worn_as("visavis.devices.sim.bands.vhp:SleeveSimulator"),
    carries="bytes",
    vendor="Google (open hardware)",
    model="VHP sleeve",
    wire="serial port",
    library=SERIAL,
    stands_for="Google's sleeve, a laboratory's own firmware",
    checked="our reading of VHP's code, text by the lab's own firmware; virtual clock",
    unproven="the adapter; your firmware",
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

    def link(self, clock: "Clock") -> "ByteLink":
        """Return the way to the Player."""
        from visavis.devices.drivers.bands.bhaptics_codec import PATH
        from visavis.devices.drivers.links.websocket import WebSocketLink

        query = urlencode({"app_id": self.app_id, "app_name": "Visavis"})
        url = f"ws://{self.address}:{self.port}{PATH}?{query}"
        return WebSocketLink(url, clock, remedy=PLAYER_REMEDY)

    def model(self) -> str:
        """Return which arm it is made for."""
        return f"Tactosy {self.position}"

    def language(self) -> "BandLanguage":
        """Return what it speaks."""
        from visavis.devices.drivers.bands.bhaptics_codec import BhapticsLanguage

        return BhapticsLanguage(self.position, self.points)

    def for_simulator(self) -> dict[str, Any]:
        """Return which unit it is, and where our motors are on it."""
        return {"position": self.position, "places": self.points}


BHAPTICS = DriverSpec(
    name="bhaptics",
    kind="armband",
    options=BhapticsOptions,
    make=_band,
    real=own_link,
    simulated=worn_as("visavis.devices.sim.bands.bhaptics:BhapticsPlayerSimulator"),
    carries="bytes",
    vendor="bHaptics",
    model="Tactosy ForearmL",
    wire="WebSocket",
    remedy=PLAYER_REMEDY,
    library=WEBSOCKETS,
    dials=True,
    stands_for="bHaptics forearm unit",
    checked="our reading of the vendor's first client; a real WebSocket",
    unproven="a current Player",
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

    def link(self, clock: "Clock") -> "ByteLink":
        """Return its serial port."""
        return self.serial_link(clock, self.baud)

    def language(self) -> "BandLanguage":
        """Return the commands as a language; raises ValueError where a template is wrong."""
        from visavis.devices.drivers.bands.ascii_codec import AsciiLanguage, AsciiTemplates

        given: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in self.commands.model_dump().items()
        }
        return AsciiLanguage(AsciiTemplates(**given))


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
    simulated=worn_as("visavis.devices.sim.bands.plain:TextBandSimulator"),
    understood=TEXT_UNDERSTOOD,
    vendor="own firmware",
    model="text commands",
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

    def link(self, clock: "Clock") -> "ByteLink":
        """Return the way by hidapi."""
        from visavis.devices.drivers.links.usb import HidLink

        return HidLink(clock, vid=self.vid, pid=self.pid, serial_number=self.serial_number)

    def language(self) -> "BandLanguage":
        """Return the layout as a language; raises ValueError where it does not fit."""
        from visavis.devices.drivers.bands.report_codec import ReportLanguage, ReportLayout

        given = self.layout.model_dump() | {"prefix": bytes.fromhex(self.layout.prefix)}
        if self.layout.report_id is None:
            given["report_id"] = self.no_number
        return ReportLanguage(ReportLayout(**given))


class UsbArmbandOptions(HidArmbandOptions):
    """Options of `usb_armband`."""

    no_number: ClassVar[int | None] = None

    def link(self, clock: "Clock") -> "ByteLink":
        """Return the way by libusb."""
        from visavis.devices.drivers.links.usb import UsbLink

        return UsbLink(clock, vid=self.vid, pid=self.pid, serial_number=self.serial_number)


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
    make=_band,
    real=own_link,
    simulated=worn_as("visavis.devices.sim.bands.plain:ReportBandSimulator"),
    carries="bytes",
    understood=REPORTS_UNDERSTOOD,
    vendor="own firmware",
    model="report band",
    wire="USB HID",
    library=HID,
    stands_for="USB bands",
    checked="our own reports; stand-in for hidapi; genuine pyusb",
    unproven="access rights, libusb",
)
USB_ARMBAND = replace(
    HID_ARMBAND,
    name="usb_armband",
    options=UsbArmbandOptions,
    simulated=worn_as("visavis.devices.sim.bands.plain:ReportBandSimulator", number=None),
    wire="USB",
    library=USB,
)
SPECS = (
    NEOSENSORY_BUZZ,
    VHP_SLIM,
    VHP_SLEEVE,
    BHAPTICS,
    ASCII_ARMBAND,
    HID_ARMBAND,
    USB_ARMBAND,
)
