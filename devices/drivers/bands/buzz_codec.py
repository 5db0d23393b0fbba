"""Translate between a Neosensory Buzz wristband's four motors and its text commands; pure.

Sources: neosensory/neosensory-sdk-for-python (the commands, their CRLF, base64 of one byte per
motor, the order of authorisation) and chrisbartley/BuzzBLE (answers: the command's echo, a JSON
object with `status_code` 200 or 400 and `data`, then a prompt). Over Bluetooth LE the text runs
on the Nordic UART service. The band's own microphone programme is stopped while it is ours.
"""

import base64
import math
from collections.abc import Sequence
from typing import Any

from visavis.devices.drivers.bands.language import (
    Condition,
    JsonReader,
    Notice,
    Ready,
    Refusal,
    level,
)

MOTORS = 4
FULL = 255
PROMPT = "ble_cli:~$ "
OK = 200
DEVELOPER_REMEDY = "update the band in its phone app, disconnect the phone, then open it again"


def command(text: str) -> bytes:
    """Return one command line."""
    return f"{text}\r\n".encode("ascii")


def vibrate(levels: Sequence[int]) -> bytes:
    """Return the command that sets the motors, one byte each."""
    payload = base64.b64encode(bytes(levels)).decode("ascii")
    return command(f'motors vibrate "{payload}"')


class BuzzLanguage:
    """Speak to a Buzz; see `BandLanguage`."""

    motor_count = MOTORS
    answers = True
    rate_range_hz = (math.nan, math.nan)

    def __init__(self) -> None:
        self._reader = JsonReader(PROMPT)
        self._identity = Ready()
        self._confirmed_count = 0

    @property
    def unreadable_count(self) -> int:
        """Answers that could not be read."""
        return self._reader.unreadable_count

    def lasts_ms(self, ttl_ms: int) -> int | None:
        """Return None: no source says that the motors stop by themselves."""
        return None

    def opening(self) -> Sequence[bytes]:
        """Ask for the motors: authorise, take them from the microphone, empty their queue."""
        lines = (
            "device info",
            "auth as developer",
            "accept",
            "audio stop",
            "motors clear_queue",
            "motors start",
        )
        return [command(line) for line in lines]

    def drive(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None = None
    ) -> Sequence[bytes]:
        """Return one command."""
        return (vibrate([level(a, FULL) for a in amplitudes_01]),)

    def silence(self) -> Sequence[bytes]:
        """Empty the queue of frames still to be played, then set zeros."""
        return (command("motors clear_queue"), vibrate((0,) * MOTORS))

    def closing(self) -> Sequence[bytes]:
        """Stop the motors; the microphone programme is the wearer's own to start."""
        return (command("motors stop"),)

    def inquiry(self) -> Sequence[bytes]:
        """Ask for the battery."""
        return (command("device battery_soc"),)

    def feed(self, data: bytes) -> Sequence[Notice]:
        """Return what the band said."""
        notices: list[Notice] = []
        for before, answer in self._reader.feed(data):
            notices += self._read(before.strip(), answer)
        return notices

    def reset(self) -> None:
        """Discard an answer that is only partly received."""
        self._reader.reset()
        self._confirmed_count = 0

    def _read(self, echo: str, answer: dict[str, Any]) -> list[Notice]:
        data = answer.get("data")
        fields = data if isinstance(data, dict) else {}
        status = answer.get("status_code")
        if isinstance(status, int) and status != OK:
            message = str(answer.get("message", ""))[:80]
            return [Refusal(f"refused {echo or 'a command'!r}: {message}", DEVELOPER_REMEDY)]
        notices: list[Notice] = []
        charge = fields.get("battery_soc")
        if isinstance(charge, int | float) and 0 <= charge <= 100:
            notices.append(Condition(battery_01=charge / 100))
        if echo.endswith("device info"):
            version = f"{fields.get('major', '?')}.{fields.get('minor', '?')}"
            serial = str(fields.get("serial_number", ""))
            self._identity = Ready(f"Buzz (firmware {version})", serial)
        if status == OK:
            self._confirmed_count += 1
            is_opening_done = not echo and self._confirmed_count >= len(self.opening())
            if is_opening_done or echo.endswith("motors start"):
                notices.append(self._identity)
        return notices
