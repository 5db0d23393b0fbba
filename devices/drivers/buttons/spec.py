"""What participants press, as Visavis knows it: options and descriptions."""

from typing import Annotated, ClassVar

from pydantic import Field

from visavis.devices.drivers.links.options import SerialOptions
from visavis.devices.libraries import HID, SERIAL
from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

ButtonNames = Annotated[dict[str, str], Field(json_schema_extra={"any_magnitude": True})]
"""What studies call some of a device's buttons, by the device's own names."""
KEYS = (
    *"0123456789abcdefghijklmnopqrstuvwxyz",
    *(f"f{n}" for n in range(1, 13)),
    *"space enter left right up down tab backspace escape".split(),
    *(f"{side}_{key}" for key in ("shift", "control", "alt") for side in ("left", "right")),
    *"-=[];'`,./\\",
)
"""Names of keys: what they type without shift in the layout that is set, or what they are."""
KEYBOARD_REMEDY = (
    "click into the participant's window: keys go to the window in front "
    "(display.show: screen or window)"
)


class ButtonOptions(SimulatedOptions):
    """Options of everything with buttons: what studies call them."""

    keys: ButtonNames = Field(default_factory=dict)


class KeyboardOptions(ButtonOptions):
    """Options of `keyboard`."""

    buttons: ClassVar = KEYS

    keys: ButtonNames = Field(default_factory=lambda: {"space": "trigger", "enter": "select"})


KEYBOARD = DriverSpec(
    name="keyboard",
    kind="responses",
    options=KeyboardOptions,
    product=Product(vendor="any", model="keyboard", capabilities=frozenset({"keys"})),
    wire=Wire(medium="the window's events", carries="bytes", hears_window=True),
    remedy=KEYBOARD_REMEDY,
    claims=Claims(
        stands_for="the keyboard of this computer",
        checked="real key events of an X server, through GLFW",
        unproven="the keyboard's own delay",
    ),
)


class SerialButtonOptions(ButtonOptions, SerialOptions):
    """Where the box is plugged in: a port, or what `visavis doctor` says of it."""

    of_wire = SerialOptions.of_wire | {"baud"}

    baud: int = Field(default=115_200, ge=300, le=4_000_000)


class XidOptions(SerialButtonOptions):
    """Options of `xid_buttons`; buttons are called by their numbers on the pad."""

    keys: ButtonNames = Field(default_factory=lambda: {"1": "trigger"})


class ByteOptions(SerialButtonOptions):
    """Options of `byte_buttons`: the characters that are buttons, and those that mean nothing.

    A scanner's pulse that comes on the same wire is best a button of its own ("5").
    """

    buttons: str = Field(default="1234", min_length=1, max_length=64)
    ignored: str = "\r\n"
    keys: ButtonNames = Field(default_factory=lambda: {"1": "trigger"})


BOX_REMEDY = "plug the box in; `visavis doctor` lists serial ports with vid, pid and serial_number"
XID = DriverSpec(
    name="xid_buttons",
    kind="responses",
    options=XidOptions,
    product=Product(
        vendor="Cedrus", model="XID response pad", capabilities=frozenset({"keys", "own_time"})
    ),
    wire=Wire(medium="serial port", carries="bytes", library=SERIAL),
    remedy=BOX_REMEDY,
    claims=Claims(
        stands_for="Cedrus response pads in XID mode",
        checked="presses read by the vendor's client pyxid2; a pseudo-terminal",
        unproven="a pad, drift of its timer",
    ),
)
BYTES = DriverSpec(
    name="byte_buttons",
    kind="responses",
    options=ByteOptions,
    product=Product(vendor="any", model="serial button box", capabilities=frozenset({"keys"})),
    wire=Wire(medium="serial port", carries="bytes", library=SERIAL),
    remedy=BOX_REMEDY,
    claims=Claims(
        stands_for="button boxes that send a character a press",
        checked="our reading of what such boxes do; a pseudo-terminal",
        unproven="any box, its delay",
    ),
)


class HidButtonOptions(ButtonOptions):
    """Options of `hid_buttons`; without vid and pid the first gamepad found is taken."""

    of_wire = frozenset({"vid", "pid", "serial_number"})

    vid: int | None = Field(default=None, ge=0, le=0xFFFF)
    pid: int | None = Field(default=None, ge=0, le=0xFFFF)
    serial_number: str = ""
    keys: ButtonNames = Field(default_factory=lambda: {"button_1": "trigger"})


HID_BUTTONS = DriverSpec(
    name="hid_buttons",
    kind="responses",
    options=HidButtonOptions,
    product=Product(
        vendor="any", model="HID gamepad or button box", capabilities=frozenset({"keys"})
    ),
    wire=Wire(medium="USB HID", carries="bytes", library=HID),
    remedy="plug it in; on Linux `visavis devices rules` says who may use it",
    claims=Claims(
        stands_for="gamepads and USB button boxes that are HIDs",
        checked="our reading of the HID class definition; stand-in for hidapi",
        unproven="real descriptors, polling interval",
    ),
)
SPECS = (KEYBOARD, XID, BYTES, HID_BUTTONS)
