"""What participants press, as Visavis knows it: options, wires, simulators."""

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from devices.options import SimulatedOptions
from devices.spec import DriverSpec, Site, driven_by

if TYPE_CHECKING:
    from devices.byte_links import ByteLink

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
    from devices.drivers.buttons.keyboard import KeyLink

    return KeyLink(site.clock)


def _pressed_keys(site: Site[KeyboardOptions]) -> "ByteLink":
    from devices.byte_links import MemoryLink
    from devices.sim.buttons.keyboard import PressedKeys

    names = {control: key for key, control in site.options.keys.items()}
    return MemoryLink(PressedKeys(site.watched, site.clock, site.faults, names), site.clock)


KEYBOARD = DriverSpec(
    name="keyboard",
    kind="responses",
    options=KeyboardOptions,
    make=driven_by("devices.drivers.buttons.keyboard:Keyboard"),
    real=_window_keys,
    simulated=_pressed_keys,
    carries="bytes",
    vendor="any",
    model="keyboard",
    wire="the window's events",
    remedy=KEYBOARD_REMEDY,
    capabilities=frozenset({"keys"}),
    stands_for="the keyboard of this computer",
    checked="real key events of an X server, through GLFW",
    unproven="the keyboard's own delay",
)
SPECS = (KEYBOARD,)
