"""The real wire of every armband driver, by the driver's name; nothing is opened yet."""

from typing import Any
from urllib.parse import urlencode

from devices.byte_links import ByteLink
from devices.drivers.bands import bhaptics_codec
from devices.drivers.links.ble import BleLink
from devices.drivers.links.rfcomm import RfcommLink
from devices.drivers.links.serial_port import BAUD, SerialLink
from devices.drivers.links.usb import HidLink, UsbLink
from devices.drivers.links.websocket import WebSocketLink
from lab.clock import Clock
from lab.errors import ConfigError

VHP_BAUD = 1_000_000
ASCII_BAUD = 115_200
BLE_NAMES = {"ble_armband": "Visavis", "neosensory_buzz": "Buzz", "vhp_slim": "Slim"}
PLAYER_REMEDY = "start the bHaptics Player on this computer, switch the unit on and pair it there"
_PORT_OPTIONS = ("port", "vid", "pid", "serial_number")


def real_link(driver: str, clock: Clock, **options: Any) -> ByteLink:
    """Return the link a driver's options describe; options of other things are left aside.

    Raises DeviceNotFound when the options name no device, ConfigError for an unknown driver.
    """
    if driver in BLE_NAMES:
        name = options.get("name", BLE_NAMES[driver])
        splits = driver != "vhp_slim"
        return BleLink(clock, address=options.get("address", ""), name=name, splits=splits)
    if driver == "spp_armband" and not options.get("port"):
        return RfcommLink(
            clock, address=options.get("address", ""), channel=options.get("channel", 1)
        )
    bauds = {
        "serial_armband": BAUD,
        "spp_armband": BAUD,
        "vhp_sleeve": VHP_BAUD,
        "ascii_armband": ASCII_BAUD,
    }
    if driver in bauds:
        port = {key: options[key] for key in _PORT_OPTIONS if key in options}
        return SerialLink(clock, baud=options.get("baud", bauds[driver]), **port)
    if driver in ("hid_armband", "usb_armband"):
        link = HidLink if driver == "hid_armband" else UsbLink
        return link(
            clock,
            vid=options["vid"],
            pid=options["pid"],
            serial_number=options.get("serial_number", ""),
        )
    if driver == "bhaptics":
        query = urlencode({"app_id": options.get("app_id", "visavis"), "app_name": "Visavis"})
        address, port_number = options.get("address", "127.0.0.1"), options.get("port")
        place = f"{address}:{port_number or bhaptics_codec.PORT}{bhaptics_codec.PATH}"
        return WebSocketLink(f"ws://{place}?{query}", clock, remedy=PLAYER_REMEDY)
    raise ConfigError(f"driver {driver!r} has no wire known here")
