"""Monado, a genuine OpenXR runtime, with its remote driver: poses are set over TCP and so known.

Debian 13 has it (monado-service, libopenxr1-monado); pictures need Xvfb and Mesa besides. The
remote driver speaks fixed packets: a name of eight bytes, the head with a pose for each eye, both
hands (Monado's source, `r_interface.h`).
"""

import contextlib
import json
import os
import shutil
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from visavis.lab.clock import NS_PER_S, SystemClock

RUNTIME = Path("/usr/share/openxr/1/openxr_monado.json")
PORT = 4242
MAGIC = b"mndrmt3\0"
HEAD_BYTES, HAND_BYTES = 128, 120
CENTRE_AT, EYE_BYTES, PER_VIEW_AT = 96, 48, 124
FOV = struct.pack("<4f", -0.74, 0.74, 0.78, -0.78)
PATIENCE_S = 20.0


def missing() -> str:
    """Return what is to be installed for Monado to run here; empty where it can."""
    wanted = {"monado-service": "monado-service libopenxr1-monado (Debian 13)", "Xvfb": "xvfb"}
    absent = [package for program, package in wanted.items() if shutil.which(program) is None]
    if not RUNTIME.exists() and not absent:
        absent = ["libopenxr1-monado"]
    return f"apt-get install {' '.join(absent)}" if absent else ""


class Service:
    """The runtime's service and a screen without a monitor, in a folder of their own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._service: subprocess.Popen[bytes] | None = None
        config = folder / "config" / "monado"
        config.mkdir(parents=True)
        remote = {"version": 0, "port": PORT, "view_count": 2}
        (config / "config_v0.json").write_text(json.dumps({"active": "remote", "remote": remote}))
        (folder / "run").mkdir(mode=0o700)
        self.environment = {
            **os.environ,
            "XDG_RUNTIME_DIR": str(folder / "run"),
            "XDG_CONFIG_HOME": str(folder / "config"),
            "XRT_COMPOSITOR_NULL": "1",
            "XR_RUNTIME_JSON": str(RUNTIME),
        }

    def start(self) -> None:
        """Start it; returns when a program can connect."""
        for left in (self._folder / "run").glob("monado*"):
            left.unlink()
        with (self._folder / "monado.log").open("ab") as log:
            self._service = subprocess.Popen(
                ["monado-service"],  # noqa: S607 - wherever the system has it
                stdin=subprocess.PIPE,  # it ends with its input
                stdout=log,
                stderr=log,
                env=self.environment,
            )
        clock = SystemClock()
        deadline_ns = clock.now_ns() + round(PATIENCE_S * NS_PER_S)
        while not (self._folder / "run" / "monado_comp_ipc").exists():
            if clock.now_ns() > deadline_ns or self._service.poll() is not None:
                raise RuntimeError((self._folder / "monado.log").read_text()[-2000:])
            clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 20)

    def kill(self) -> None:
        """End it at once, as a crash does."""
        if self._service is not None:
            self._service.kill()
            self._service.wait()
            if self._service.stdin is not None:
                self._service.stdin.close()
            self._service = None


def call(word: str) -> None:
    """Ask the test to "kill" or to "start" the service, from a child; return when it has."""
    sys.stdout.write(f"{word}\n")
    sys.stdout.flush()
    sys.stdin.readline()


@contextlib.contextmanager
def screen(environment: dict[str, str]) -> Iterator[None]:
    """Let programs with this environment open windows that nobody sees."""
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "640x480x24"],  # noqa: S607 - as above
        pass_fds=(write,),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    try:
        with os.fdopen(read) as number:
            environment["DISPLAY"] = f":{number.readline().strip()}"
        yield
    finally:
        server.terminate()
        server.wait()


class Remote:
    """Where the head and its eyes are, said over TCP."""

    def __init__(self) -> None:
        self._socket = socket.create_connection(("127.0.0.1", PORT), PATIENCE_S)
        raw = b""
        while len(raw) < len(MAGIC) + HEAD_BYTES + 2 * HAND_BYTES:
            raw += self._socket.recv(4096)
        self._head = bytearray(raw[8 : 8 + HEAD_BYTES])
        self._hands = raw[8 + HEAD_BYTES : 8 + HEAD_BYTES + 2 * HAND_BYTES]

    def put_head(
        self, position_m: tuple[float, float, float], turn_xyzw: tuple[float, float, float, float]
    ) -> None:
        """Put the head somewhere."""
        self._head[CENTRE_AT : CENTRE_AT + 28] = struct.pack("<7f", *turn_xyzw, *position_m)
        self._send()

    def put_eyes(self, ipd_m: float) -> None:
        """Move the eyes so far apart."""
        for eye, x_m in enumerate((-ipd_m / 2, ipd_m / 2)):
            pose = struct.pack("<7f", 0, 0, 0, 1, x_m, 0, 0)
            at = eye * EYE_BYTES
            self._head[at : at + len(FOV) + len(pose)] = FOV + pose
        self._head[PER_VIEW_AT] = 1
        self._send()

    def close(self) -> None:
        """Leave it."""
        self._socket.close()

    def _send(self) -> None:
        self._socket.sendall(MAGIC + bytes(self._head) + self._hands)
