"""Two bands of a laboratory's own making: text commands on a serial line, reports over USB.

There is no source to compare with: they stand for a plain sketch that parses `M<motor> <value>`
lines, `S` and `B?`, and for a firmware that copies report bytes to its motors. Neither silences
itself. Not modelled: board resets on opening, endpoints that stall.
"""

import re
from typing import Any

from visavis.devices.sim.bands.peer import BandPeer

MOTOR = re.compile(rb"M(\d) (\d+)$")


class TextBandSimulator(BandPeer):
    """The `BytePeer` of a sketch: `M0 128`, `S` for silence, `B?` answered by `B 57`."""

    battery_percent = 57

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._line = b""

    def restart(self, t_ns: int) -> None:
        """Forget half a line."""
        self._line = b""

    def receive(self, data: bytes, t_ns: int) -> None:
        """Obey whole lines."""
        *lines, self._line = (self._line + data).split(b"\n")
        for line in lines:
            match = MOTOR.match(line)
            if line == b"S":
                self.set_levels((0.0,) * len(self.levels_01), t_ns)
            elif line == b"B?":
                self.say(b"B %d\r\n" % self.battery_percent, t_ns)
            elif match and int(match[1]) < len(self.levels_01) and int(match[2]) <= 255:
                levels = list(self.levels_01)
                levels[int(match[1])] = int(match[2]) / 255
                self.set_levels(levels, t_ns)
            else:
                self.say(b"? %s\r\n" % line[:20], t_ns)


class ReportBandSimulator(BandPeer):
    """The `BytePeer` of a USB band: report number (unless `number` is None), then bytes.

    Motors stand at bytes 2 to 5 after the start A5 01; input reports bear the battery at byte 1.
    """

    def __init__(self, *args: Any, number: int | None = 0, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._number = number
        self._reports: list[bytes] = []
        self.refused_count = 0

    def receive(self, data: bytes, t_ns: int) -> None:
        """Obey one report."""
        if self._number is not None:
            if not data or data[0] != self._number:
                self.refused_count += 1
                return
            data = data[1:]
        if len(data) != 8 or data[:2] != b"\xa5\x01":
            self.refused_count += 1
            return
        self.set_levels([value / 255 for value in data[2:6]], t_ns)

    def next_report(self, until_ns: int) -> bytes | None:
        """Return one input report, as USB does; None if there is none."""
        self._reports += [chunk.data for chunk in self.outgoing(until_ns)]
        return self._reports.pop(0) if self._reports else None

    def tell_battery(self, percent: int, t_ns: int) -> None:
        """Send an input report."""
        self.say(bytes((0x01, percent)) + bytes(6), t_ns)
