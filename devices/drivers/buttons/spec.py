"""What participants press, as Visavis knows it: options, wires, simulators."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from visavis.devices.libraries import HID, SERIAL
from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import DriverSpec, Site, driven_by, imported

if TYPE_CHECKING:
    from visavis.devices.byte_links import ByteLink

Called = Annotated[dict[str, str], Field(json_schema_extra={"any_magnitude": True})]
"""What studies call some of a device's buttons, by the device's own names."""
KEYBOARD_REMEDY = (
    "click into the participant's window: keys go to the window in front "
    "(display.show: screen or window)"
)


class ButtonOptions(SimulatedOptions):
    """Options of everything with buttons: what studies call them."""

    keys: Called = Field(default_factory=dict)


class KeyboardOptions(ButtonOptions):
    """Options of `keyboard`."""

    keys: Called = Field(default_factory=lambda: {"space": "trigger", "enter": "select"})


def _window_keys(site: Site[KeyboardOptions]) -> "ByteLink":
    from visavis.devices.drivers.buttons.keyboard import KeyLink

    return KeyLink(site.clock)


def _pressed_keys(site: Site[KeyboardOptions]) -> "ByteLink":
    from visavis.devices.byte_links import MemoryLink
    from visavis.devices.sim.buttons.keyboard import PressedKeys

    names = {control: key for key, control in site.options.keys.items()}
    return MemoryLink(PressedKeys(site.watched, site.clock, site.faults, names), site.clock)


KEYBOARD = DriverSpec(
    name="keyboard",
    kind="responses",
    options=KeyboardOptions,
    make=driven_by("visavis.devices.drivers.buttons.keyboard:Keyboard"),
    real=_window_keys,
    simulated=_pressed_keys,
    carries="bytes",
    vendor="any",
    model="keyboard",
    wire="the window's events",
    remedy=KEYBOARD_REMEDY,
    hears_window=True,
    capabilities=frozenset({"keys"}),
    stands_for="the keyboard of this computer",
    checked="real key events of an X server, through GLFW",
    unproven="the keyboard's own delay",
)


class SerialButtonOptions(ButtonOptions):
    """Where the box is plugged in: a port, or what `visavis doctor` says of it."""

    of_wire = frozenset({"port", "vid", "pid", "serial_number", "baud"})

    port: str = ""
    vid: int | None = Field(default=None, ge=0, le=0xFFFF)
    pid: int | None = Field(default=None, ge=0, le=0xFFFF)
    serial_number: str = ""
    baud: int = Field(default=115_200, ge=300, le=4_000_000)


class XidOptions(SerialButtonOptions):
    """Options of `xid_buttons`; buttons are called by their numbers on the pad."""

    keys: Called = Field(default_factory=lambda: {"1": "trigger"})


class ByteOptions(SerialButtonOptions):
    """Options of `byte_buttons`: the characters that are buttons, and those that mean nothing.

    A scanner's pulse that comes on the same wire is best a button of its own ("5").
    """

    buttons: str = Field(default="1234", min_length=1, max_length=64)
    ignored: str = "\r\n"
    keys: Called = Field(default_factory=lambda: {"1": "trigger"})


def _serial(site: Site[Any]) -> "ByteLink":
    from visavis.devices.drivers.links.serial_port import SerialLink

    options = site.options
    return SerialLink(
        site.clock,
        port=options.port,
        vid=options.vid,
        pid=options.pid,
        serial_number=options.serial_number,
        baud=options.baud,
    )


def _box(simulator: str) -> Callable[[Site[Any]], "ByteLink"]:
    def link(site: Site[Any]) -> "ByteLink":
        from visavis.devices.byte_links import MemoryLink

        names = {control: key for key, control in site.options.keys.items()}
        peer = imported(simulator)(site.watched, site.clock, site.faults, names, seed=site.own_seed)
        return MemoryLink(peer, site.clock)

    return link


BOX_REMEDY = "plug the box in; `visavis doctor` lists serial ports with vid, pid and serial_number"
XID = DriverSpec(
    name="xid_buttons",
    kind="responses",
    options=XidOptions,
    make=driven_by("visavis.devices.drivers.buttons.xid:XidButtons"),
    real=_serial,
    simulated=_box("visavis.devices.sim.buttons.boxes:XidPad"),
    carries="bytes",
    vendor="Cedrus",
    model="XID response pad",
    wire="serial port",
    remedy=BOX_REMEDY,
    capabilities=frozenset({"keys", "own_time"}),
    library=SERIAL,
    stands_for="Cedrus response pads in XID mode",
    checked="presses read by the vendor's client pyxid2; a pseudo-terminal",
    unproven="a pad, drift of its timer",
)
BYTES = DriverSpec(
    name="byte_buttons",
    kind="responses",
    options=ByteOptions,
    make=driven_by("visavis.devices.drivers.buttons.codes:ByteButtons"),
    real=_serial,
    simulated=_box("visavis.devices.sim.buttons.boxes:ByteBox"),
    carries="bytes",
    vendor="any",
    model="serial button box",
    wire="serial port",
    remedy=BOX_REMEDY,
    capabilities=frozenset({"keys"}),
    library=SERIAL,
    stands_for="button boxes that send a character a press",
    checked="our reading of what such boxes do; a pseudo-terminal",
    unproven="any box, its delay",
)


class HidButtonOptions(ButtonOptions):
    """Options of `hid_buttons`; without vid and pid the first gamepad found is taken."""

    of_wire = frozenset({"vid", "pid", "serial_number"})

    vid: int | None = Field(default=None, ge=0, le=0xFFFF)
    pid: int | None = Field(default=None, ge=0, le=0xFFFF)
    serial_number: str = ""
    keys: Called = Field(default_factory=lambda: {"button_1": "trigger"})


def _hid(site: Site[HidButtonOptions]) -> "ByteLink":
    from visavis.devices.drivers.buttons.hid import HidButtonLink

    options = site.options
    return HidButtonLink(
        site.clock, vid=options.vid, pid=options.pid, serial_number=options.serial_number
    )


HID_BUTTONS = DriverSpec(
    name="hid_buttons",
    kind="responses",
    options=HidButtonOptions,
    make=driven_by("visavis.devices.drivers.buttons.hid:HidButtons"),
    real=_hid,
    simulated=_box("visavis.devices.sim.buttons.gamepad:Gamepad"),
    carries="bytes",
    vendor="any",
    model="HID gamepad or button box",
    wire="USB HID",
    remedy="plug it in; on Linux `visavis devices rules` says who may use it",
    capabilities=frozenset({"keys"}),
    library=HID,
    stands_for="gamepads and USB button boxes that are HIDs",
    checked="our reading of the HID class definition; stand-in for hidapi",
    unproven="real descriptors, polling interval",
)
SPECS = (KEYBOARD, XID, BYTES, HID_BUTTONS)
