"""Start and stop LabRecorder with a session, by its remote control (EnableRCS).

A command is one line. LabRecorder answers each with `OK`, whatever it did (App-LabRecorder,
`src/tcpinterface.cpp`). So an answer only shows that the program runs and got the command.
"""

import socket
from typing import Final

from visavis.lab.errors import DeviceError, DeviceNotFound

PORT: Final = 22345
"""LabRecorder's default; its configuration may set another (`RCSPort`)."""
PATIENCE_S: Final = 10.0
"""More than LabRecorder takes: at `update` it looks for streams for a second, then answers."""
ROLE: Final = "lab_recorder"
REMEDY: Final = (
    "start LabRecorder and tick EnableRCS, or take lab_recorder out of sync in lab_config.yaml"
)


class LabRecorder:
    """The connection to a LabRecorder; `address` is HOST or HOST:PORT.

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
        """Record every stream that LabRecorder finds, into a file named after the session.

        Raises:
            DeviceError: the connection was lost.
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
        """End LabRecorder's file; return what went wrong, "" if nothing."""
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
        """Send a command and wait for its answer."""
        try:
            self._line.sendall(command.encode() + b"\n")
            answer = b""
            while len(answer) < len(b"OK"):
                chunk = self._line.recv(len(b"OK") - len(answer))
                if not chunk:
                    raise ConnectionError("it closed the connection")
                answer += chunk
        except OSError as error:
            raise DeviceError(
                f"LabRecorder at {self._address} did not take {command.split(' ')[0]!r} ({error})",
                role=ROLE,
                remedy=REMEDY,
            ) from error
