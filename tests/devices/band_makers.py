"""Armbands by name on a link that is given, or on their real one."""

from visavis.devices.byte_links import MemoryLink
from visavis.devices.registry import driver_wiring
from visavis.devices.sim.armband.simulator import ArmbandSimulator


def maker(driver, /, **usual):
    def make(role, clock, *, link=None, **options):
        return driver_wiring(driver).on_wire(role, clock, link, **{**usual, **options})

    return make


serial_armband = maker("serial_armband")
ble_armband = maker("ble_armband", name="Visavis")
spp_armband = maker("spp_armband")
neosensory_buzz = maker("neosensory_buzz")
vhp_slim = maker("vhp_slim", max_rate_hz=20.0)
vhp_sleeve = maker("vhp_sleeve", max_rate_hz=100.0)
bhaptics = maker("bhaptics")
bhaptics_sdk = maker("bhaptics_sdk")
ascii_armband = maker("ascii_armband")
hid_armband = maker("hid_armband", max_rate_hz=100.0)
usb_armband = maker("usb_armband", max_rate_hz=100.0)


def simulated_armband(role, clock, *, wrap=None, **simulator):
    """Our driver on a simulated band; `wrap` puts something on the link, such as a log."""
    link = MemoryLink(ArmbandSimulator(role, clock, **simulator), clock)
    link = wrap(link) if wrap is not None else link
    return driver_wiring("simulated_armband").on_wire(role, clock, link)
