"""A gamepad as hidapi presents it: ten buttons, a hat switch and a stick, without report numbers.

Not modelled: triggers, rumble, a stick that does not come back to its middle.
"""

from collections.abc import Mapping

from visavis.devices.contracts import Body
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.buttons.presses import PressingPeer
from visavis.lab.clock import Clock

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
