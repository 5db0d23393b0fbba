"""Cedrus response pads that speak XID (RB-x40, Riponda, Lumina, c-pod), on their serial port.

The pad stamps every press and release with its own timer (whole milliseconds); these stamps are the
device's time. Source: the vendor's client pyxid2, which reads six bytes a press: `k`, the port and
button in one byte, and the timer.
"""

import struct
from collections.abc import Iterable, Mapping

from visavis.devices.byte_links import ByteLink
from visavis.devices.drivers.buttons.device import ButtonDevice, Press
from visavis.devices.drivers.buttons.spec import XID
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceTimeout, ProtocolViolation

WHO, IN_XID_MODE, TO_XID_MODE = b"_c1", b"_xid0", b"c10"
ANSWER_LENGTH = len(IN_XID_MODE)
ASK_AGAIN_S = 0.3
PRESS = struct.Struct("<cBI")
IS_DOWN, NO_PORT = 0x10, 0x0C
BUTTONS_OF_A_PORT = 8
PORTS = 4
BUTTONS = tuple(
    f"{button}" if port == 0 else f"port{port}_{button}"
    for port in range(PORTS)
    for button in range(1, BUTTONS_OF_A_PORT + 1)
)
"""Buttons by their number on the pad; sensors at its other ports as "port1_1"."""


class XidReader:
    """Cut bytes into presses; other bytes are skipped up to the next possible start of one."""

    def __init__(self) -> None:
        self.unreadable_count = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[Press]:
        """Return the presses these bytes complete."""
        data = self._rest + data
        presses: list[Press] = []
        at = 0
        while at < len(data):
            if data[at : at + 1] != b"k" or (at + 1 < len(data) and data[at + 1] & NO_PORT):
                start = at
                at = data.find(b"k", at + 1)
                at = len(data) if at < 0 else at
                self.unreadable_count += at - start
            elif len(data) - at < PRESS.size:
                break
            else:
                _, port_and_button, ticks_ms = PRESS.unpack_from(data, at)
                port, button = port_and_button & 0x0F, port_and_button >> 5 or BUTTONS_OF_A_PORT
                name = BUTTONS[port * BUTTONS_OF_A_PORT + button - 1]
                presses.append(
                    Press(name, float(bool(port_and_button & IS_DOWN)), ticks_ms * NS_PER_MS)
                )
                at += PRESS.size
        self._rest = data[at:]
        return presses


class XidButtons(ButtonDevice):
    """Follow the `ResponseInput` contract over XID."""

    def __init__(self, role: str, link: ByteLink, clock: Clock, *, keys: Mapping[str, str]) -> None:
        self._reader = XidReader()
        super().__init__(role, link, clock, XID, buttons=BUTTONS, keys=keys)

    @property
    def unreadable_count(self) -> int:
        """How many bytes belonged to no press."""
        return self._reader.unreadable_count

    def _fresh(self) -> None:
        self._reader = XidReader()

    def _read(self, data: bytes) -> Iterable[Press]:
        return self._reader.feed(data)

    def _greet(self, deadline_ns: int) -> None:
        """Ask for the mode, and switch a pad in another mode to XID."""
        answer = self._ask_mode(deadline_ns)
        if answer != IN_XID_MODE:
            self._link.write(TO_XID_MODE)
            answer = self._ask_mode(deadline_ns)
        if answer != IN_XID_MODE:
            raise ProtocolViolation(
                f"the pad stays in the mode {answer.decode('latin-1')!r}",
                role=self._role,
                remedy="set its switches to XID mode, as its manual says",
            )

    def _ask_mode(self, deadline_ns: int) -> bytes:
        data = b""
        while self._clock.now_ns() < deadline_ns:
            self._link.write(WHO)
            again_ns = min(deadline_ns, self._clock.now_ns() + round(ASK_AGAIN_S * NS_PER_S))
            while (now_ns := self._clock.now_ns()) < again_ns:
                for chunk in self._link.read((again_ns - now_ns) / NS_PER_S):
                    data += chunk.data
                at = data.find(b"_xid")
                if 0 <= at <= len(data) - ANSWER_LENGTH:
                    return data[at : at + ANSWER_LENGTH]
        raise DeviceTimeout(
            "no pad answers there in XID", role=self._role, remedy=self._spec.remedy
        )
