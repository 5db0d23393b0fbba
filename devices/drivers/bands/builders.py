"""Build the armbands that are not our own, from what stands in `lab_config.yaml`.

Every function takes role and clock; `link` takes the place of the real wire, for simulators and
replays. The libraries of the wires are imported when the device is opened.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from devices.byte_links import ByteLink
from devices.drivers.bands import bhaptics_codec
from devices.drivers.bands.ascii_codec import AsciiLanguage, AsciiTemplates
from devices.drivers.bands.bhaptics_codec import BhapticsLanguage
from devices.drivers.bands.buzz_codec import BuzzLanguage
from devices.drivers.bands.driver import HostTimedBand
from devices.drivers.bands.report_codec import ReportLanguage, ReportLayout
from devices.drivers.bands.vhp_codec import SLEEVE, SLIM_BOARD, VhpSleeveLanguage, VhpSlimLanguage
from devices.drivers.links.by_driver import real_link
from lab.clock import Clock
from lab.errors import ConfigError

RECIPIENTS = {"sleeve": SLEEVE, "slim": SLIM_BOARD}


def neosensory_buzz(
    role: str,
    clock: Clock,
    *,
    address: str = "",
    name: str = "Buzz",
    max_rate_hz: float = 50.0,
    link: ByteLink | None = None,
) -> HostTimedBand:
    """Return a Neosensory Buzz, found by address or by the beginning of its name."""
    if link is None:
        link = real_link("neosensory_buzz", clock, address=address, name=name)
    return HostTimedBand(
        role,
        link,
        BuzzLanguage(),
        clock,
        driver="neosensory_buzz",
        vendor="Neosensory",
        model="Buzz",
        max_rate_hz=max_rate_hz,
    )


def vhp_slim(
    role: str,
    clock: Clock,
    *,
    address: str = "",
    name: str = "Slim",
    channels: Sequence[int] = (0, 2, 4, 8),
    max_rate_hz: float = 20.0,
    link: ByteLink | None = None,
) -> HostTimedBand:
    """Return Google's slim board over Bluetooth LE; `channels` are logical channels from 0."""
    if link is None:
        link = real_link("vhp_slim", clock, address=address, name=name)
    return HostTimedBand(
        role,
        link,
        VhpSlimLanguage(channels),
        clock,
        driver="vhp_slim",
        vendor="Google (open hardware)",
        model="VHP slim board",
        max_rate_hz=max_rate_hz,
    )


def vhp_sleeve(
    role: str,
    clock: Clock,
    *,
    port: str = "",
    vid: int | None = None,
    pid: int | None = None,
    serial_number: str = "",
    channels: Sequence[int] = (5, 7, 8, 6),
    board: str = "sleeve",
    max_rate_hz: float = 100.0,
    link: ByteLink | None = None,
) -> HostTimedBand:
    """Return Google's sleeve on its serial port; `channels` are PWM channels from 0."""
    if link is None:
        link = real_link(
            "vhp_sleeve", clock, port=port, vid=vid, pid=pid, serial_number=serial_number
        )
    return HostTimedBand(
        role,
        link,
        VhpSleeveLanguage(channels, RECIPIENTS[board]),
        clock,
        driver="vhp_sleeve",
        vendor="Google (open hardware)",
        model=f"VHP {board}",
        max_rate_hz=max_rate_hz,
    )


def bhaptics(
    role: str,
    clock: Clock,
    *,
    address: str = "127.0.0.1",
    port: int = bhaptics_codec.PORT,
    position: str = "ForearmL",
    points: Sequence[int] = (0, 2, 3, 5),
    app_id: str = "visavis",
    max_rate_hz: float = 50.0,
    link: ByteLink | None = None,
) -> HostTimedBand:
    """Return a bHaptics forearm unit behind the Player; `points` are its motors from 0."""
    if link is None:
        link = real_link("bhaptics", clock, address=address, port=port, app_id=app_id)
    return HostTimedBand(
        role,
        link,
        BhapticsLanguage(position, points),
        clock,
        driver="bhaptics",
        vendor="bHaptics",
        model=f"Tactosy {position}",
        max_rate_hz=max_rate_hz,
    )


def ascii_armband(
    role: str,
    clock: Clock,
    *,
    commands: Mapping[str, Any],
    port: str = "",
    vid: int | None = None,
    pid: int | None = None,
    serial_number: str = "",
    baud: int = 115_200,
    max_rate_hz: float = 50.0,
    link: ByteLink | None = None,
) -> HostTimedBand:
    """Return a laboratory's own firmware on a serial port.

    `commands` has the fields of `AsciiTemplates`.
    """
    try:
        listed: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in commands.items()
        }
        language = AsciiLanguage(AsciiTemplates(**listed))
    except (TypeError, ValueError) as cause:
        raise ConfigError(f"{role}: {cause}; correct `commands` in lab_config.yaml") from cause
    if link is None:
        found = {"port": port, "vid": vid, "pid": pid, "serial_number": serial_number}
        link = real_link("ascii_armband", clock, baud=baud, **found)
    return HostTimedBand(
        role,
        link,
        language,
        clock,
        driver="ascii_armband",
        vendor="own firmware",
        model="text commands",
        max_rate_hz=max_rate_hz,
    )


def hid_armband(
    role: str,
    clock: Clock,
    *,
    vid: int,
    pid: int,
    layout: Mapping[str, Any],
    serial_number: str = "",
    max_rate_hz: float = 100.0,
    link: ByteLink | None = None,
) -> HostTimedBand:
    """Return a USB HID whose output reports set its motors."""
    if link is None:
        link = real_link("hid_armband", clock, vid=vid, pid=pid, serial_number=serial_number)
    return _report_band(role, clock, link, layout, "hid_armband", max_rate_hz)


def usb_armband(
    role: str,
    clock: Clock,
    *,
    vid: int,
    pid: int,
    layout: Mapping[str, Any],
    serial_number: str = "",
    max_rate_hz: float = 100.0,
    link: ByteLink | None = None,
) -> HostTimedBand:
    """Return a vendor-class USB device whose packets set its motors."""
    if link is None:
        link = real_link("usb_armband", clock, vid=vid, pid=pid, serial_number=serial_number)
    return _report_band(role, clock, link, layout, "usb_armband", max_rate_hz)


def _report_band(
    role: str,
    clock: Clock,
    link: ByteLink,
    layout: Mapping[str, Any],
    driver: str,
    max_rate_hz: float,
) -> HostTimedBand:
    """`layout` has the fields of `ReportLayout`, `prefix` as hexadecimal digits."""
    start = layout.get("prefix", "")
    number = layout.get("report_id")
    if number is None and driver == "hid_armband":
        number = 0
    try:
        fields = {**layout, "report_id": number, "prefix": bytes.fromhex(start)}
        language = ReportLanguage(ReportLayout(**fields))
    except (TypeError, ValueError) as cause:
        raise ConfigError(f"{role}: {cause}; correct `layout` in lab_config.yaml") from cause
    return HostTimedBand(
        role,
        link,
        language,
        clock,
        driver=driver,
        vendor="own firmware",
        model="report band",
        max_rate_hz=max_rate_hz,
    )
