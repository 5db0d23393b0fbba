"""A Neosensory Buzz as its text line shows it.

Written against neosensory/neosensory-sdk-for-python (commands) and chrisbartley/BuzzBLE (echo,
JSON with `status_code` 200 or 400, prompt). Motors do nothing before authorisation and
`motors start`. Not modelled: the microphone programme, buttons and lights, the 16 ms pace of its
frame queue (a new frame shows at once), what the firmware does when the link breaks: here the
last frame goes on, the worst case.
"""

import base64
import binascii
import json
import re
from typing import Any

from visavis.devices.sim.bands.peer import BandPeer

MOTORS = 4
LINE = re.compile(rb"\r\n|\r|\n")
VIBRATE = re.compile(r'motors vibrate "?([A-Za-z0-9+/=]*)"?$')


class BuzzSimulator(BandPeer):
    """The `BytePeer` of a Buzz; `battery_percent` may be changed, `authorises` refuses."""

    battery_percent = 76
    authorises = True
    serial_number = "BZ-0042"

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._line = b""
        self._asked_to_accept = self._is_authorised = self._motors_on = False
        self.commands: list[str] = []

    def restart(self, t_ns: int) -> None:
        """Authorisation belongs to a connection."""
        self._line = b""
        self._asked_to_accept = self._is_authorised = False

    def receive(self, data: bytes, t_ns: int) -> None:
        """Obey whole lines."""
        *lines, self._line = LINE.split(self._line + data)
        for line in lines:
            if line:
                self._obey(line.decode("utf-8", "replace").strip(), t_ns)

    def _obey(self, text: str, t_ns: int) -> None:
        self.commands.append(text)
        if text == "device info":
            version = {"major": 1, "minor": 9, "serial_number": self.serial_number}
            self._answer(text, t_ns, data={"device_id": "0A1B2C3D", **version})
        elif text == "device battery_soc":
            self._answer(text, t_ns, data={"battery_soc": self.battery_percent})
        elif text == "auth as developer":
            self._asked_to_accept = self.authorises
            if self.authorises:
                self._answer(text, t_ns, message='Type "accept" to accept the terms')
            else:
                self._refuse(text, t_ns, "Not available")
        elif text == "accept":
            self._is_authorised = self._asked_to_accept
            if self._is_authorised:
                self._answer(text, t_ns)
            else:
                self._refuse(text, t_ns, "Nothing to accept")
        elif not text.startswith(("audio ", "motors ")):
            self._refuse(text, t_ns, "Unknown command")
        elif not self._is_authorised:
            self._refuse(text, t_ns, "Not authorized")
        else:
            self._command_motors(text, t_ns)

    def _command_motors(self, text: str, t_ns: int) -> None:
        if text.startswith("motors vibrate"):
            match = VIBRATE.match(text)
            try:
                levels = base64.b64decode(match[1] if match else "", validate=True)
            except binascii.Error:
                levels = b""
            if not levels or len(levels) % MOTORS:
                self._refuse("motors vibrate", t_ns, "Bad frame")
            elif self._motors_on:
                self.set_levels([value / 255 for value in levels[-MOTORS:]], t_ns)
            return
        if text == "motors start":
            self._motors_on = True
        elif text == "motors stop":
            self._motors_on = False
            self.set_levels((0.0,) * MOTORS, t_ns)
        self._answer(text, t_ns)

    def _answer(self, echo: str, t_ns: int, **fields: Any) -> None:
        self._send(echo, t_ns, {"status_code": 200, **fields})

    def _refuse(self, echo: str, t_ns: int, message: str) -> None:
        self._send(echo, t_ns, {"status_code": 400, "message": message})

    def _send(self, echo: str, t_ns: int, answer: dict[str, Any]) -> None:
        self.say(f"{echo}\r\n{json.dumps(answer)}\r\nble_cli:~$ ".encode(), t_ns)
