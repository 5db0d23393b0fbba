"""Bands of other makers and of a laboratory's own making: driver, languages, links, simulators."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any
from urllib.parse import urlencode

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import Device
from visavis.devices.drivers.bands.ascii_codec import AsciiLanguage, AsciiTemplates
from visavis.devices.drivers.bands.bhaptics_codec import PATH, BhapticsLanguage
from visavis.devices.drivers.bands.bhaptics_sdk import BhapticsSdkLink
from visavis.devices.drivers.bands.bhaptics_sdk_codec import BhapticsSdkLanguage
from visavis.devices.drivers.bands.buzz_codec import BuzzLanguage
from visavis.devices.drivers.bands.driver import HostTimedBand
from visavis.devices.drivers.bands.language import BandLanguage
from visavis.devices.drivers.bands.report_codec import ReportLanguage, ReportLayout
from visavis.devices.drivers.bands.spec import (
    ASCII_ARMBAND,
    BHAPTICS,
    BHAPTICS_SDK,
    HID_ARMBAND,
    NEOSENSORY_BUZZ,
    PLAYER_REMEDY,
    USB_ARMBAND,
    VHP_BAUD,
    VHP_SLEEVE,
    VHP_SLIM,
    AsciiArmbandOptions,
    BhapticsOptions,
    BhapticsSdkOptions,
    BuzzOptions,
    HidArmbandOptions,
    VhpSleeveOptions,
    VhpSlimOptions,
)
from visavis.devices.drivers.bands.vhp_codec import (
    SLEEVE,
    SLIM_BOARD,
    VhpSleeveLanguage,
    VhpSlimLanguage,
)
from visavis.devices.drivers.links.ble import ble_band
from visavis.devices.drivers.links.serial_port import serial_port
from visavis.devices.drivers.links.usb import HidLink, UsbLink
from visavis.devices.drivers.links.websocket import WebSocketLink
from visavis.devices.sim.bands.bhaptics import BhapticsPlayerSimulator
from visavis.devices.sim.bands.bhaptics_sdk import BhapticsSdkSimulator
from visavis.devices.sim.bands.buzz import BuzzSimulator
from visavis.devices.sim.bands.plain import ReportBandSimulator, TextBandSimulator
from visavis.devices.sim.bands.vhp import SleeveSimulator, SlimBoardSimulator
from visavis.devices.wiring import Site, Wiring, linked_by, worn_as
from visavis.lab.errors import ConfigError

PLUGGED_IN = ("vid", "pid", "serial_number")


def band_that_speaks(
    language: Callable[[Any], BandLanguage],
) -> Callable[[Site[Any], ByteLink], Device]:
    """Return a `make`: the driver of a band; its options say what it speaks, perhaps its model."""

    def make(site: Site[Any], link: ByteLink) -> Device:
        options, spec = site.options, site.spec
        if hasattr(options, "model"):
            spec = replace(spec, product=replace(spec.product, model=options.model()))
        try:
            band_language = language(options)
        except ValueError as cause:
            raise ConfigError(f"devices.{site.role}: {cause}; correct its options") from cause
        rate_hz = options.max_rate_hz
        return HostTimedBand(
            site.role, link, band_language, site.clock, spec=spec, max_rate_hz=rate_hz
        )

    return make


def _buzz(options: BuzzOptions) -> BandLanguage:
    return BuzzLanguage()


def _slim(options: VhpSlimOptions) -> BandLanguage:
    return VhpSlimLanguage(options.channels)


def _sleeve(options: VhpSleeveOptions) -> BandLanguage:
    return VhpSleeveLanguage(options.channels, SLEEVE if options.board == "sleeve" else SLIM_BOARD)


def _bhaptics(options: BhapticsOptions) -> BandLanguage:
    return BhapticsLanguage(options.position, options.points)


def _bhaptics_sdk(options: BhapticsSdkOptions) -> BandLanguage:
    return BhapticsSdkLanguage(options.position, options.points)


def _ascii(options: AsciiArmbandOptions) -> BandLanguage:
    templates: dict[str, Any] = {
        k: tuple(v) if isinstance(v, list) else v for k, v in options.commands.model_dump().items()
    }
    return AsciiLanguage(AsciiTemplates(**templates))


def _reports(options: HidArmbandOptions) -> BandLanguage:
    layout = options.layout.model_dump() | {"prefix": bytes.fromhex(options.layout.prefix)}
    if options.layout.report_id is None:
        layout["report_id"] = options.no_number
    return ReportLanguage(ReportLayout(**layout))


def _player(site: Site[BhapticsOptions]) -> ByteLink:
    options = site.options
    query = urlencode({"app_id": options.app_id, "app_name": "Visavis"})
    url = f"ws://{options.address}:{options.port}{PATH}?{query}"
    return WebSocketLink(url, site.clock, remedy=PLAYER_REMEDY)


def _sdk(site: Site[BhapticsSdkOptions]) -> ByteLink:
    options = site.options
    return BhapticsSdkLink(options.app_id, options.api_key_file, site.clock, remedy=PLAYER_REMEDY)


WIRINGS = (
    Wiring(
        NEOSENSORY_BUZZ,
        make=band_that_speaks(_buzz),
        real=ble_band,
        simulated=worn_as(BuzzSimulator),
    ),
    Wiring(
        VHP_SLIM,
        make=band_that_speaks(_slim),
        real=ble_band,
        simulated=worn_as(SlimBoardSimulator),
    ),
    Wiring(
        VHP_SLEEVE,
        make=band_that_speaks(_sleeve),
        real=serial_port(VHP_BAUD),
        simulated=worn_as(SleeveSimulator),
    ),
    Wiring(
        BHAPTICS,
        make=band_that_speaks(_bhaptics),
        real=_player,
        simulated=worn_as(BhapticsPlayerSimulator),
    ),
    Wiring(
        BHAPTICS_SDK,
        make=band_that_speaks(_bhaptics_sdk),
        real=_sdk,
        simulated=worn_as(BhapticsSdkSimulator),
    ),
    Wiring(
        ASCII_ARMBAND,
        make=band_that_speaks(_ascii),
        real=serial_port(),
        simulated=worn_as(TextBandSimulator),
    ),
    Wiring(
        HID_ARMBAND,
        make=band_that_speaks(_reports),
        real=linked_by(HidLink, *PLUGGED_IN),
        simulated=worn_as(ReportBandSimulator),
    ),
    Wiring(
        USB_ARMBAND,
        make=band_that_speaks(_reports),
        real=linked_by(UsbLink, *PLUGGED_IN),
        simulated=worn_as(ReportBandSimulator, number=None),
    ),
)
