"""Button boxes on a serial port whose buttons a simulated body presses.

Not modelled: the voice key and light sensors of a Cedrus pad, its lines out.
"""

import struct

from visavis.devices.sim.buttons.presses import PressingPeer
from visavis.lab.clock import NS_PER_MS


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
