"""Button boxes on a serial port, and a gamepad, whose buttons a simulated body presses.

The gamepad is as hidapi presents it: ten buttons, a hat switch and a stick, without report numbers.
Not modelled: the voice key and light sensors of a Cedrus pad, its lines out; triggers and rumble of
a gamepad, a stick that does not come back to its middle.
"""

import struct
from collections.abc import Mapping

from visavis.devices.contracts import Body
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.buttons.presses import PressingPeer
from visavis.lab.clock import NS_PER_MS, Clock

BUTTONS = 10
DESCRIPTOR = bytes.fromhex(
    "05010905a101"  # generic desktop, gamepad
    "05091901290a150025017501950a8102"  # buttons 1 to 10, a bit each
    "750195068103"  # six bits of padding
    "05010939150025073500463b016514750495018142"  # hat: 0 to 7, null otherwise
    "750495018103"
    "050109300931150026ff00750895028102"  # x, y: a byte each
    "c0"
)
REST = 0x08
MIDDLE = 0x80
SIDES = {"up": 0, "right": 2, "down": 4, "left": 6}


class Gamepad(PressingPeer):
    """Describe itself when asked, and send its whole state at every change."""

    def __init__(
        self,
        body: Body,
        clock: Clock,
        faults: FaultSchedule | None,
        names: Mapping[str, str],
        *,
        seed: int = 0,
    ) -> None:
        super().__init__(body, clock, faults, names, seed=seed)
        self._down: set[int] = set()
        self._hat = REST
        self._stick = [MIDDLE, MIDDLE]

    def accept(self, data: bytes, t_ns: int) -> None:
        """Describe itself."""
        if data == b"descriptor" and not self._active("mute", t_ns):
            self.say(b"D" + DESCRIPTOR, t_ns)

    def message(self, button: str, value_01: float, t_ns: int) -> bytes:
        """Return the report after a change."""
        is_down = value_01 > 0.5
        if button in SIDES:
            self._hat = SIDES[button] if is_down else REST
        elif button[:1] in ("x", "y") and button[1:] in ("-", "+"):
            sign = 1 if button[1] == "+" else -1
            self._stick["xy".index(button[0])] = MIDDLE + round(sign * 127 * value_01)
        elif button.startswith("button_"):
            (self._down.add if is_down else self._down.discard)(int(button[7:]))
        bits = sum(1 << (number - 1) for number in self._down if number <= BUTTONS)
        return b"R" + bits.to_bytes(2, "little") + bytes((self._hat, *self._stick))


class XidPad(PressingPeer):
    """A Cedrus pad in XID mode; its timer runs since it was switched on."""

    on_since_ns = -90 * 1_000 * NS_PER_MS

    def accept(self, data: bytes, t_ns: int) -> None:
        """Answer who it is."""
        if not self._active("mute", t_ns) and b"_c1" in data:
            self.say(b"_xid0", t_ns)

    def message(self, button: str, value_01: float, t_ns: int) -> bytes:
        """Return six bytes: k, button and direction, the timer in milliseconds."""
        number = int(button) if button.isdigit() else 1
        button_byte = (number % 8) << 5 | (0x10 if value_01 > 0.5 else 0)
        return struct.pack("<cBI", b"k", button_byte, (t_ns - self.on_since_ns) // NS_PER_MS)


class ByteBox(PressingPeer):
    """A box that sends a character when a button goes down, and nothing when it comes up."""

    def message(self, button: str, value_01: float, t_ns: int) -> bytes:
        """Return the button's character."""
        return button.encode("latin-1") if value_01 > 0.5 else b""
