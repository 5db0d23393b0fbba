"""Sensors on Bluetooth LE: the driver on its link, and its simulator."""

from visavis.devices.byte_links import ByteLink
from visavis.devices.drivers.ble_sensor.codec import PROFILES, Column, Profile, own_profile
from visavis.devices.drivers.ble_sensor.driver import BleSensor
from visavis.devices.drivers.ble_sensor.spec import BLE_SENSOR, BleSensorOptions
from visavis.devices.drivers.links.ble import BleLink
from visavis.devices.sim.ble_sensor import BleSensorSimulator
from visavis.devices.wiring import Site, Wiring, spoken_by


def _profile(options: BleSensorOptions) -> Profile:
    if options.profile != "own":
        return PROFILES[options.profile]
    columns = [Column(**column.model_dump()) for column in options.columns]
    hello = bytes.fromhex(options.hello)
    return own_profile(columns, options.notify_uuid, options.write_uuid, hello, options.rate_hz)


def _sensor(site: Site[BleSensorOptions], link: ByteLink) -> BleSensor:
    options = site.options
    return BleSensor(
        site.role, link, site.clock, profile=_profile(options), lost_after_s=options.lost_after_s
    )


def _link(site: Site[BleSensorOptions]) -> BleLink:
    options, profile = site.options, _profile(site.options)
    return BleLink(
        site.clock,
        address=options.address,
        name=options.name,
        splits=False,
        write_uuid=profile.write_uuid,
        notify_uuid=profile.notify_uuid,
        device=site.spec.product.model,
    )


WIRINGS = (Wiring(BLE_SENSOR, make=_sensor, real=_link, simulated=spoken_by(BleSensorSimulator)),)
