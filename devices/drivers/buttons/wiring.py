"""What participants press: drivers on their links, and simulated keys and boxes."""

from collections.abc import Callable
from typing import Any

from visavis.devices.byte_links import ByteLink, BytePeer, MemoryLink
from visavis.devices.drivers.buttons.codes import ByteButtons
from visavis.devices.drivers.buttons.hid import HidButtonLink, HidButtons
from visavis.devices.drivers.buttons.keyboard import Keyboard, KeyLink
from visavis.devices.drivers.buttons.spec import BYTES, HID_BUTTONS, KEYBOARD, XID, KeyboardOptions
from visavis.devices.drivers.buttons.xid import XidButtons
from visavis.devices.drivers.links.serial_port import serial_port
from visavis.devices.sim.buttons.boxes import ByteBox, Gamepad, XidPad
from visavis.devices.sim.buttons.keyboard import PressedKeys
from visavis.devices.wiring import Site, Wiring, driven_by, linked_by


def _window_keys(site: Site[KeyboardOptions]) -> ByteLink:
    return KeyLink(site.clock)


def _pressed_keys(site: Site[KeyboardOptions]) -> ByteLink:
    names = {control: key for key, control in site.options.keys.items()}
    return MemoryLink(PressedKeys(site.watched, site.clock, site.faults, names), site.clock)


def _pressed_on(simulator: Callable[..., BytePeer]) -> Callable[[Site[Any]], ByteLink]:
    """Return a `simulated`: a box whose buttons the body presses."""

    def link(site: Site[Any]) -> ByteLink:
        names = {control: key for key, control in site.options.keys.items()}
        peer = simulator(site.watched, site.clock, site.faults, names, seed=site.own_seed)
        return MemoryLink(peer, site.clock)

    return link


WIRINGS = (
    Wiring(
        KEYBOARD,
        make=driven_by(Keyboard),
        real=_window_keys,
        simulated=_pressed_keys,
    ),
    Wiring(
        XID,
        make=driven_by(XidButtons),
        real=serial_port(),
        simulated=_pressed_on(XidPad),
    ),
    Wiring(
        BYTES,
        make=driven_by(ByteButtons),
        real=serial_port(),
        simulated=_pressed_on(ByteBox),
    ),
    Wiring(
        HID_BUTTONS,
        make=driven_by(HidButtons),
        real=linked_by(HidButtonLink, "vid", "pid", "serial_number"),
        simulated=_pressed_on(Gamepad),
    ),
)
