"""Build our own armband over Bluetooth: low energy, or the classic serial port."""

from devices.byte_links import ByteLink
from devices.drivers.armband.dialect import FramedDialect
from devices.drivers.armband.driver import ArmbandDriver
from devices.drivers.links.by_driver import real_link
from lab.clock import Clock


def ble_armband(
    role: str,
    clock: Clock,
    *,
    address: str = "",
    name: str = "Visavis",
    max_rate_hz: float = 50.0,
    link: ByteLink | None = None,
) -> ArmbandDriver:
    """Return our armband behind a Nordic UART service, found by address or name."""
    if link is None:
        link = real_link("ble_armband", clock, address=address, name=name)
    return ArmbandDriver(
        role, link, FramedDialect(), clock, driver="ble_armband", max_rate_hz=max_rate_hz
    )


def spp_armband(
    role: str,
    clock: Clock,
    *,
    port: str = "",
    address: str = "",
    channel: int = 1,
    max_rate_hz: float = 50.0,
    link: ByteLink | None = None,
) -> ArmbandDriver:
    """Return our armband on Bluetooth classic: the serial port it was paired as, or its address."""
    if link is None:
        link = real_link("spp_armband", clock, port=port, address=address, channel=channel)
    return ArmbandDriver(
        role, link, FramedDialect(), clock, driver="spp_armband", max_rate_hz=max_rate_hz
    )
