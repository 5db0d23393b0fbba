"""Bands of other makers, and of a laboratory's own making: options, wires, simulators."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal
from urllib.parse import urlencode

from pydantic import Field, field_validator, model_validator

from devices.drivers.links.options import BandOptions, BleBandOptions, SerialBandOptions
from devices.libraries import BLE, HID, SERIAL, USB, WEBSOCKETS
from devices.options import Options
from devices.spec import AnySpec, DriverSpec, Site
from lab.errors import ConfigError

if TYPE_CHECKING:
    from devices.byte_links import ByteLink
    from devices.drivers.bands.driver import HostTimedBand
    from devices.drivers.bands.language import BandLanguage

VHP_BAUD = 1_000_000
PLAYER_REMEDY = "start the bHaptics Player on this computer, switch the unit on and pair it there"


def _within(numbers: list[int], count: int, what: str) -> list[int]:
    if any(not 0 <= number < count for number in numbers) or len(set(numbers)) < len(numbers):
        raise ValueError(f"{what} are different numbers from 0 to {count - 1}")
    return numbers


def _band(
    site: Site[Any], link: "ByteLink", language: "BandLanguage", model: str = ""
) -> "HostTimedBand":
    from devices.drivers.bands.driver import HostTimedBand

    spec = replace(site.spec, model=model) if model else site.spec
    rate_hz = site.options.max_rate_hz
    return HostTimedBand(site.role, link, language, site.clock, spec=spec, max_rate_hz=rate_hz)


# ---- Neosensory Buzz -------------------------------------------------------------------------


class BuzzOptions(BleBandOptions):
    """Options of `neosensory_buzz`."""

    name: str = "Buzz"


def _ble(site: Site[Any]) -> "ByteLink":
    link: ByteLink = site.options.ble_link(site.clock)
    return link


def _simulated_buzz(site: Site[BuzzOptions]) -> "ByteLink":
    from devices.sim.bands.buzz import BuzzSimulator

    return site.worn(BuzzSimulator)


def _buzz(site: Site[BuzzOptions], link: "ByteLink") -> "HostTimedBand":
    from devices.drivers.bands.buzz_codec import BuzzLanguage

    return _band(site, link, BuzzLanguage())


NEOSENSORY_BUZZ: AnySpec = DriverSpec(
    name="neosensory_buzz",
    kind="armband",
    options=BuzzOptions,
    make=_buzz,
    real=_ble,
    simulated=_simulated_buzz,
    carries="bytes",
    vendor="Neosensory",
    model="Buzz",
    wire="Bluetooth LE",
    library=BLE,
    stands_for="Neosensory Buzz, Google's slim board",
    checked="genuine bleak over our BlueZ",
    unproven="current firmware; packet sizes",
)


# ---- Google's vibrotactile boards ------------------------------------------------------------


class VhpSlimOptions(BleBandOptions):
    """Options of `vhp_slim`; `channels` are the board's logical channels."""

    name: str = "Slim"
    channels: list[int] = Field(default=[0, 2, 4, 8], min_length=1, max_length=4)

    @field_validator("channels")
    @classmethod
    def _exist(cls, channels: list[int]) -> list[int]:
        return _within(channels, 12, "channels")


class VhpSleeveOptions(SerialBandOptions):
    """Options of `vhp_sleeve`; `channels` are PWM channels from 0."""

    channels: list[int] = Field(default=[5, 7, 8, 6], min_length=1, max_length=4)
    board: Literal["sleeve", "slim"] = "sleeve"

    @field_validator("channels")
    @classmethod
    def _exist(cls, channels: list[int]) -> list[int]:
        return _within(channels, 12, "channels")


def _slim_link(site: Site[VhpSlimOptions]) -> "ByteLink":
    return site.options.ble_link(site.clock, splits=False)


def _simulated_slim(site: Site[VhpSlimOptions]) -> "ByteLink":
    from devices.sim.bands.vhp import SlimBoardSimulator

    return site.worn(SlimBoardSimulator, places=site.options.channels)


def _slim(site: Site[VhpSlimOptions], link: "ByteLink") -> "HostTimedBand":
    from devices.drivers.bands.vhp_codec import VhpSlimLanguage

    return _band(site, link, VhpSlimLanguage(site.options.channels))


def _sleeve_link(site: Site[VhpSleeveOptions]) -> "ByteLink":
    return site.options.serial_link(site.clock, VHP_BAUD)


def _simulated_sleeve(site: Site[VhpSleeveOptions]) -> "ByteLink":
    from devices.sim.bands.vhp import SleeveSimulator

    return site.worn(SleeveSimulator, places=site.options.channels)


def _sleeve(site: Site[VhpSleeveOptions], link: "ByteLink") -> "HostTimedBand":
    from devices.drivers.bands.vhp_codec import SLEEVE, SLIM_BOARD, VhpSleeveLanguage

    board = site.options.board
    language = VhpSleeveLanguage(site.options.channels, SLEEVE if board == "sleeve" else SLIM_BOARD)
    return _band(site, link, language, f"VHP {board}")


VHP_SLIM = replace(
    NEOSENSORY_BUZZ,
    name="vhp_slim",
    options=VhpSlimOptions,
    make=_slim,
    real=_slim_link,
    simulated=_simulated_slim,
    vendor="Google (open hardware)",
    model="VHP slim board",
)
VHP_SLEEVE: AnySpec = DriverSpec(
    name="vhp_sleeve",
    kind="armband",
    options=VhpSleeveOptions,
    make=_sleeve,
    real=_sleeve_link,
    simulated=_simulated_sleeve,
    carries="bytes",
    vendor="Google (open hardware)",
    model="VHP sleeve",
    wire="serial port",
    library=SERIAL,
    stands_for="Google's sleeve, a laboratory's own firmware",
    checked="virtual clock",
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


def _player(site: Site[BhapticsOptions]) -> "ByteLink":
    from devices.drivers.bands.bhaptics_codec import PATH
    from devices.drivers.links.websocket import WebSocketLink

    options = site.options
    query = urlencode({"app_id": options.app_id, "app_name": "Visavis"})
    url = f"ws://{options.address}:{options.port}{PATH}?{query}"
    return WebSocketLink(url, site.clock, remedy=PLAYER_REMEDY)


def _simulated_player(site: Site[BhapticsOptions]) -> "ByteLink":
    from devices.sim.bands.bhaptics import BhapticsPlayerSimulator

    options = site.options
    return site.worn(BhapticsPlayerSimulator, position=options.position, places=options.points)


def _bhaptics(site: Site[BhapticsOptions], link: "ByteLink") -> "HostTimedBand":
    from devices.drivers.bands.bhaptics_codec import BhapticsLanguage

    position = site.options.position
    language = BhapticsLanguage(position, site.options.points)
    return _band(site, link, language, f"Tactosy {position}")


BHAPTICS = DriverSpec(
    name="bhaptics",
    kind="armband",
    options=BhapticsOptions,
    make=_bhaptics,
    real=_player,
    simulated=_simulated_player,
    carries="bytes",
    vendor="bHaptics",
    model="Tactosy ForearmL",
    wire="WebSocket",
    remedy=PLAYER_REMEDY,
    library=WEBSOCKETS,
    dials=True,
    stands_for="bHaptics forearm unit",
    checked="a real WebSocket",
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


def _text_link(site: Site[AsciiArmbandOptions]) -> "ByteLink":
    return site.options.serial_link(site.clock, site.options.baud)


def _simulated_text(site: Site[AsciiArmbandOptions]) -> "ByteLink":
    from devices.sim.bands.plain import TextBandSimulator

    return site.worn(TextBandSimulator)


def _text_band(site: Site[AsciiArmbandOptions], link: "ByteLink") -> "HostTimedBand":
    from devices.drivers.bands.ascii_codec import AsciiLanguage, AsciiTemplates

    commands = site.options.commands.model_dump()
    listed: dict[str, Any] = {
        k: tuple(v) if isinstance(v, list) else v for k, v in commands.items()
    }
    try:
        language = AsciiLanguage(AsciiTemplates(**listed))
    except ValueError as cause:
        raise ConfigError(f"{site.role}: {cause}; correct `commands` in lab_config.yaml") from cause
    return _band(site, link, language)


ASCII_ARMBAND = replace(
    VHP_SLEEVE,
    name="ascii_armband",
    options=AsciiArmbandOptions,
    make=_text_band,
    real=_text_link,
    simulated=_simulated_text,
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


class ReportArmbandOptions(BandOptions):
    """Options of `hid_armband` and `usb_armband`."""

    vid: int = Field(ge=0, le=0xFFFF)
    pid: int = Field(ge=0, le=0xFFFF)
    serial_number: str = ""
    layout: ReportLayoutOptions = ReportLayoutOptions()


REPORTS_UNDERSTOOD: Mapping[str, Any] = {
    "vid": 0x1209,
    "pid": 0x0001,
    "layout": {"prefix": "a501", "first_motor_byte": 2, "battery_byte": 1},
}
"""The one layout that the simulated report bands understand."""


def _hid_link(site: Site[ReportArmbandOptions]) -> "ByteLink":
    from devices.drivers.links.usb import HidLink

    return HidLink(site.clock, **site.options.without("layout", "max_rate_hz"))


def _usb_link(site: Site[ReportArmbandOptions]) -> "ByteLink":
    from devices.drivers.links.usb import UsbLink

    return UsbLink(site.clock, **site.options.without("layout", "max_rate_hz"))


def _simulated_hid(site: Site[ReportArmbandOptions]) -> "ByteLink":
    from devices.sim.bands.plain import ReportBandSimulator

    return site.worn(ReportBandSimulator)


def _simulated_usb(site: Site[ReportArmbandOptions]) -> "ByteLink":
    from devices.sim.bands.plain import ReportBandSimulator

    return site.worn(ReportBandSimulator, number=None)


def _report_band(
    site: Site[ReportArmbandOptions], link: "ByteLink", number: int | None
) -> "HostTimedBand":
    from devices.drivers.bands.report_codec import ReportLanguage, ReportLayout

    layout = site.options.layout
    fields = layout.model_dump() | {"prefix": bytes.fromhex(layout.prefix)}
    if layout.report_id is None:
        fields["report_id"] = number
    try:
        language = ReportLanguage(ReportLayout(**fields))
    except ValueError as cause:
        raise ConfigError(f"{site.role}: {cause}; correct `layout` in lab_config.yaml") from cause
    return _band(site, link, language)


def _hid_band(site: Site[ReportArmbandOptions], link: "ByteLink") -> "HostTimedBand":
    return _report_band(site, link, 0)


def _usb_band(site: Site[ReportArmbandOptions], link: "ByteLink") -> "HostTimedBand":
    return _report_band(site, link, None)


HID_ARMBAND = DriverSpec(
    name="hid_armband",
    kind="armband",
    options=ReportArmbandOptions,
    make=_hid_band,
    real=_hid_link,
    simulated=_simulated_hid,
    carries="bytes",
    understood=REPORTS_UNDERSTOOD,
    vendor="own firmware",
    model="report band",
    wire="USB HID",
    library=HID,
    stands_for="USB bands",
    checked="stand-in for hidapi; genuine pyusb",
    unproven="access rights, libusb",
)
USB_ARMBAND = replace(
    HID_ARMBAND,
    name="usb_armband",
    make=_usb_band,
    real=_usb_link,
    simulated=_simulated_usb,
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
