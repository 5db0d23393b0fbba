"""Start and stop LabRecorder with a session, by the remote control it offers (EnableRCS).

One command is a line; each is answered `OK`, whatever it did (App-LabRecorder,
`src/tcpinterface.cpp`), so what is told here is that the program is there and has heard.
"""

import socket
from typing import Final

from visavis.lab.errors import DeviceError, DeviceNotFound

PORT: Final = 22345
"""LabRecorder's own, unless its configuration says otherwise (`RCSPort`)."""
PATIENCE_S: Final = 10.0
"""It looks for streams for a second at `update`, and answers after it."""
ROLE: Final = "lab_recorder"
REMEDY: Final = (
    "start LabRecorder and tick EnableRCS, or take lab_recorder out of sync in lab_config.yaml"
)


class LabRecorder:
    """Own the line to a LabRecorder; `address` is HOST or HOST:PORT.

    Raises:
        DeviceNotFound: nothing answers there.
    """

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":") if ":" in address else (address, "", str(PORT))
        self._address = f"{host}:{port}"
        try:
            self._line = socket.create_connection((host, int(port)), timeout=PATIENCE_S)
        except (OSError, ValueError) as error:
            raise DeviceNotFound(
                f"LabRecorder does not answer at {self._address} ({error})",
                role=ROLE,
                remedy=REMEDY,
            ) from error
        self._is_recording = False

    def start(self, *, study: str, participant: str, session: int, part: int) -> None:
        """Let it record every stream it finds, into a file named for the session.

        Raises:
            DeviceError: it went away.
        """
        for command in (
            "update",
            f"filename {{participant:{participant}}} {{session:{session:03d}}} "
            f"{{task:{study}}} {{run:{part}}}",
            "start",
        ):
            self._ask(command)
        self._is_recording = True

    def stop(self) -> str:
        """Let it end its file; return what went wrong, mostly ""."""
        trouble = ""
        try:
            if self._is_recording:
                self._ask("stop")
        except DeviceError as error:
            trouble = f"{error}; end its recording there"
        finally:
            self._is_recording = False
            self._line.close()
        return trouble

    def _ask(self, command: str) -> None:
        """Send a line and wait for its answer."""
        try:
            self._line.sendall(command.encode() + b"\n")
            answer = b""
            while len(answer) < len(b"OK"):
                got = self._line.recv(len(b"OK") - len(answer))
                if not got:
                    raise ConnectionError("it closed the connection")
                answer += got
        except OSError as error:
            raise DeviceError(
                f"LabRecorder at {self._address} did not take {command.split(' ')[0]!r} ({error})",
                role=ROLE,
                remedy=REMEDY,
            ) from error
