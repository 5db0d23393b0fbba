"""Our armband: its driver on a serial port, on Bluetooth, and on a simulated band."""

from typing import Any

from visavis.devices.byte_links import ByteLink
from visavis.devices.drivers.armband.dialect import FramedDialect
from visavis.devices.drivers.armband.driver import ArmbandDriver
from visavis.devices.drivers.armband.spec import (
    BAUD,
    BLE_ARMBAND,
    SERIAL_ARMBAND,
    SIMULATED_ARMBAND,
    SPP_ARMBAND,
    SppArmbandOptions,
)
from visavis.devices.drivers.links.ble import ble_band
from visavis.devices.drivers.links.rfcomm import RfcommLink
from visavis.devices.drivers.links.serial_port import SerialLink, serial_port
from visavis.devices.sim.armband.simulator import ArmbandSimulator
from visavis.devices.wiring import Site, Wiring, worn_as


def _armband(site: Site[Any], link: ByteLink) -> ArmbandDriver:
    rate_hz = site.options.max_rate_hz
    return ArmbandDriver(
        site.role, link, FramedDialect(), site.clock, spec=site.spec, max_rate_hz=rate_hz
    )


def _bluetooth_serial(site: Site[SppArmbandOptions]) -> ByteLink:
    """Return the paired serial port, or the way by address."""
    options = site.options
    if options.port:
        return SerialLink(site.clock, port=options.port, baud=BAUD)
    return RfcommLink(site.clock, address=options.address, channel=options.channel)


_SIMULATOR = worn_as(ArmbandSimulator)
WIRINGS = (
    Wiring(SERIAL_ARMBAND, make=_armband, real=serial_port(), simulated=_SIMULATOR),
    Wiring(BLE_ARMBAND, make=_armband, real=ble_band, simulated=_SIMULATOR),
    Wiring(SPP_ARMBAND, make=_armband, real=_bluetooth_serial, simulated=_SIMULATOR),
    Wiring(SIMULATED_ARMBAND, make=_armband, simulated=_SIMULATOR),
)
