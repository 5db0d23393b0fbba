"""Run the armband's firmware itself as a driver's peer: the AVR image in simavr, or the same C.

`firmware/armband/lockstep.c` has the lines of text that are exchanged. The machine's time is the
session's: nothing here depends on how fast this computer is, except `TerminalMachine`.
"""

import math
import os
import select
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

from tests.product_files import ROOT
from visavis.devices.byte_links import Chunk
from visavis.devices.sim.armband.firmware import ArmbandFirmware, Protection, Surroundings
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SystemClock
from visavis.lab.closing import Closing
from visavis.lab.errors import DeviceError, DeviceNotFound, DeviceTimeout

SOURCES = ROOT / "firmware" / "armband"
BYTE_US = 260
"""One byte at the firmware's 38400 baud; simavr tells a byte when its sending starts."""

STARTED_S = 30.0
LOOK_NS = 200 * NS_PER_MS

SKIN_OPEN = 1023
"""What the thermistor's divider reads without a thermistor."""

MachineKind = Literal["simavr", "host"]


class DutyChange(NamedTuple):
    """What the four PWM outputs do from a machine time on; `host_ns` is the system's clock."""

    t_us: int
    host_ns: int
    duties: tuple[int, ...]


def build(kind: MachineKind, folder: Path, limits: str = "") -> list[str]:
    """Compile into `folder` and return the command that runs the machine.

    With "boot_old.elf" or "boot_new.elf" of `folder` behind it, simavr's begins every reset there.

    Raises DeviceNotFound naming the packages that are missing, DeviceError when the firmware
    itself does not compile.
    """
    programs, headers, packages = ["make", "cc"], {}, "make gcc"
    if kind == "simavr":
        programs.append("avr-gcc")
        headers = {"simavr/sim_avr.h": "cc", "avr/io.h": "avr-gcc"}
        packages += " gcc-avr avr-libc simavr libsimavr-dev"
    missing = [name for name in programs if shutil.which(name) is None]
    missing = missing or [h for h, compiler in headers.items() if not _has_header(compiler, h)]
    if missing:
        raise DeviceNotFound(
            f"the armband's firmware cannot be built for {kind} without {', '.join(missing)}",
            remedy=f"run: apt-get install {packages}",
        )
    if kind == "simavr":
        make("avr", folder, limits)
        make("simulator", folder)
        return [str(folder / "armband_simavr"), str(folder / "armband.elf")]
    make("host", folder, limits)
    return [str(folder / "armband_host")]


def make(target: str, folder: Path, limits: str = "") -> None:
    """Run make in the firmware's folder; raises DeviceError with the compiler's words."""
    command = ["make", "-C", str(SOURCES), target, f"OUT={folder}", f"LIMITS={limits}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise DeviceError(
            f"make {target} failed: {done.stderr.strip()[-800:]}",
            remedy=f"correct {SOURCES}",
        )


def _has_header(compiler: str, header: str) -> bool:
    probe = subprocess.run(
        [compiler, "-E", "-x", "c", "-"],
        input=f"#include <{header}>\n",
        capture_output=True,
        text=True,
        check=False,
    )
    return "No such file" not in probe.stderr


def skin_reading(skin_c: float) -> int:
    """Return what the divider reads, of 1023: 10 kOhm at 25 degrees, B 3380 K, against 10 kOhm."""
    ratio = math.exp(3380.0 * (1 / (273.15 + skin_c) - 1 / 298.15))
    return round(SKIN_OPEN * ratio / (1 + ratio))


class LockstepMachine(Closing):
    """A machine that runs exactly as far as it is told; a `BytePeer` and a context manager."""

    def __init__(self, command: Sequence[str], origin_ns: int = 0) -> None:
        self._origin_ns = origin_ns
        self._process = subprocess.Popen(
            list(command),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self._unread: list[Chunk] = []
        self.sent: list[tuple[int, int]] = []
        """(time in us, byte) of everything the machine said."""
        self.changes: list[DutyChange] = []

    def give(self, t_us: int, data: bytes) -> None:
        """Let bytes reach the machine from `t_us` on."""
        self._write(f"B {t_us} {data.hex()}\n")

    def run_to(self, t_us: int) -> None:
        """Run up to this machine time and take what it said."""
        self._write(f"T {t_us}\n")
        stream = self._process.stdout
        while stream is not None:
            word, *fields = stream.readline().split() or ["end"]
            if word == "K":
                return
            if word == "X":
                at_us, byte = int(fields[0]) + BYTE_US, int(fields[1], 16)
                self.sent.append((at_us, byte))
                self._unread.append(Chunk(self._origin_ns + at_us * 1000, bytes((byte,))))
            elif word == "D":
                at_us, host_ns, *duties = (int(field) for field in fields)
                self.changes.append(DutyChange(at_us, host_ns, tuple(duties)))
            elif word == "end":
                raise DeviceNotFound(
                    "the simulated processor stopped", remedy="run it by hand to see why"
                )

    def surround(
        self,
        battery_mv: int,
        temperature_c: float,
        motor_mv: int = 3300,
        skin_c: float | None = None,
    ) -> None:
        """Set what the analogue inputs see; without `skin_c` there is no thermistor."""
        reading = SKIN_OPEN if skin_c is None else skin_reading(skin_c)
        self._write(f"A {battery_mv} {motor_mv} {round(temperature_c * 100)} {reading}\n")

    def hang(self) -> None:
        """Let the program run wild; only its watchdog can help."""
        self._write("H\n")

    @property
    def duties(self) -> tuple[int, ...]:
        """What the motors' outputs do now."""
        return self.changes[-1].duties if self.changes else ()

    def connect(self, t_ns: int) -> None:
        """Forget what was said before."""
        self._unread.clear()

    def accept(self, data: bytes, t_ns: int) -> None:
        """Take bytes from the host."""
        self.give((t_ns - self._origin_ns) // 1000, data)

    def outgoing(self, until_ns: int) -> Sequence[Chunk]:
        """Run, and return the bytes that have arrived by then."""
        self.run_to((until_ns - self._origin_ns) // 1000)
        arrived = [chunk for chunk in self._unread if chunk.t_host_ns <= until_ns]
        self._unread = self._unread[len(arrived) :]
        return arrived

    def close(self) -> None:
        """End the program."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        self._process.wait()

    def _write(self, line: str) -> None:
        if self._process.stdin is not None:
            self._process.stdin.write(line)
            self._process.stdin.flush()


class TerminalMachine(Closing):
    """A machine in real time on a pseudo-terminal; a context manager. pyserial opens `port`."""

    def __init__(self, command: Sequence[str]) -> None:
        program, *image = command
        self._process = subprocess.Popen(
            [program, "--pty", *image],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
        )
        self._clock = SystemClock()
        self._unread = b""
        self.changes: list[DutyChange] = []
        self.received_us: list[tuple[int, int]] = []
        """(machine time in us, system clock in ns) at which bytes came from the host."""
        self.port = self._read_until("P", self._clock.now_ns() + round(STARTED_S * NS_PER_S))

    def wait_for(
        self,
        *,
        running: bool,
        within_s: float = 30.0,
        host_runs: Callable[[], bool] = lambda: True,
    ) -> DutyChange:
        """Read on until the motors run, or are silent; return the change that made it so.

        Raises DeviceTimeout when it does not happen, at once when `host_runs` says that nobody
        is there any more who could make them run.
        """
        deadline_ns = self._clock.now_ns() + round(within_s * NS_PER_S)
        wanted = "run" if running else "stop"
        while True:
            step_ns = min(deadline_ns, self._clock.now_ns() + LOOK_NS)
            try:
                self._read_until("D", step_ns)
            except DeviceTimeout:
                if running and not host_runs():
                    raise DeviceTimeout(
                        "the host program ended before the motors ran",
                        remedy="its own message says why; on a busy computer try again",
                    ) from None
                if step_ns >= deadline_ns:
                    raise DeviceTimeout(
                        f"the motors did not {wanted} within {within_s:g} s",
                        remedy="close other programs: the machine has to run in real time",
                    ) from None
                continue
            if any(self.changes[-1].duties) == running:
                return self.changes[-1]

    def cut(self) -> None:
        """Cut the cable: nothing passes any more, either way."""
        if self._process.stdin is not None:
            self._process.stdin.write(b"C")

    def close(self) -> None:
        """End the program; what it said last is read first."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        try:
            self._process.wait(STARTED_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _read_until(self, wanted: str, deadline_ns: int) -> str:
        while (line := self._line(deadline_ns)) is not None:
            word, *fields = line.split() or ["end"]
            if word == "D":
                at_us, host_ns, *duties = (int(field) for field in fields)
                self.changes.append(DutyChange(at_us, host_ns, tuple(duties)))
            elif word == "R":
                self.received_us.append((int(fields[0]), int(fields[1])))
            elif word == "end":
                break
            if word == wanted:
                return fields[0]
        raise DeviceNotFound("the simulated processor stopped", remedy="run it by hand to see why")

    def _line(self, deadline_ns: int) -> str | None:
        """Return the next line, None at the end; raises DeviceTimeout at the deadline."""
        stream = self._process.stdout
        while b"\n" not in self._unread:
            left_s = max(0, deadline_ns - self._clock.now_ns()) / NS_PER_S
            if stream is None or not select.select([stream], [], [], left_s)[0]:
                raise DeviceTimeout("the simulated processor says nothing")
            data = os.read(stream.fileno(), 65536)
            if not data:
                return None
            self._unread += data
        line, _, self._unread = self._unread.partition(b"\n")
        return line.decode()


class PythonMachine(Closing):
    """The firmware's model in Python behind the same methods, where nothing can be compiled."""

    def __init__(self, protection: Protection | None = None) -> None:
        self.firmware = ArmbandFirmware(protection=protection or Protection())
        self._at_us = 0
        self._hangs_until_us: int | None = None
        self.sent: list[tuple[int, int]] = []
        self.changes = [DutyChange(0, 0, self.firmware.duties)]
        self._said(self.firmware.boot(0))

    def give(self, t_us: int, data: bytes) -> None:
        """Let bytes reach the machine at `t_us`."""
        self.run_to(t_us)
        if self._hangs_until_us is None:
            self._said(self.firmware.feed(data, t_us))
            self._note()

    def run_to(self, t_us: int) -> None:
        """Run up to this machine time."""
        while self._at_us < t_us:
            self._at_us = min(t_us, self._at_us + 500)
            if self._hangs_until_us is not None:
                if self._at_us < self._hangs_until_us:
                    continue
                self._hangs_until_us = None
                self._said(self.firmware.boot(self._at_us))
            self._said(self.firmware.step(self._at_us))
            self._note()

    def surround(
        self,
        battery_mv: int,
        temperature_c: float,
        motor_mv: int = 3300,
        skin_c: float | None = None,
    ) -> None:
        """Set what the analogue inputs see; without `skin_c` there is no thermistor."""
        self.firmware.surroundings = Surroundings(battery_mv, temperature_c, motor_mv, skin_c)

    def hang(self) -> None:
        """Stand still until the watchdog bites."""
        self._hangs_until_us = self._at_us + 120_000

    @property
    def duties(self) -> tuple[int, ...]:
        """What the motors' outputs do now."""
        return self.changes[-1].duties

    def close(self) -> None:
        """Do nothing."""

    def _said(self, data: bytes) -> None:
        self.sent += [(self._at_us, byte) for byte in data]

    def _note(self) -> None:
        if self.firmware.duties != self.changes[-1].duties:
            self.changes.append(DutyChange(self._at_us, 0, self.firmware.duties))
