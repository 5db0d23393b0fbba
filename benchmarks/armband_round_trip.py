"""Measure the armband: driver overhead, contact to command, dead man, fuzz, reconnect.

    python -m benchmarks.armband_round_trip [--commands 2000] [--frames 1000000] [--json]

"Ratio" is limit / value: 1 or more is within the limit. The round trip runs over a
pseudo-terminal to a separate process that answers at once; its wire time is the same exchange
done with bare system calls after the same waits, and the overhead is the difference of the two. The
firmware runs in simavr where its packages are installed, otherwise as C on this computer.
"""

import argparse
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import termios
import tty
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.table import Row, show
from tests.devices.wire_ends.armband_machine import TerminalMachine, build, make
from visavis.devices.byte_links import Chunk, MemoryLink
from visavis.devices.contracts import HAPTICS, Armband
from visavis.devices.drivers.armband import codec
from visavis.devices.drivers.links.serial_port import SerialLink
from visavis.devices.faults import FaultSchedule
from visavis.devices.pump import Pump
from visavis.devices.registry import driver_wiring
from visavis.devices.sim.armband.firmware import (
    HIGHEST_DUTY,
    LOWEST_DUTY,
    ArmbandFirmware,
    Protection,
)
from visavis.devices.sim.armband.simulator import ArmbandSimulator
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock, SimClock, SystemClock, cpu_time_s
from visavis.lab.errors import DeviceError, DeviceNotFound, DeviceTimeout
from visavis.lab.schema import SampleBatch

LOSSES = 5
WITHIN_S = 60.0
"""The longest any measurement of round trips may take, however busy the computer is."""
CONTACTS = 500
FASTEST_HZ = 1000.0
APART_NS = round(1.1 * NS_PER_S / FASTEST_HZ)
"""Commands that come sooner wait their turn in the driver, which is not an overhead of its own."""
MOTORS_ON = (1.0, 1.0, 1.0, 1.0)
ROOT = Path(__file__).resolve().parents[1]

ECHO = """
import os, sys
from visavis.devices.sim.armband.firmware import ArmbandFirmware
firmware = ArmbandFirmware()
own = int(sys.argv[1])
while True:
    said = firmware.feed(os.read(own, 4096), 0)
    if said:
        os.write(own, said)
"""

HOST = """
import sys
from visavis.devices.registry import driver_wiring
from visavis.lab.clock import SystemClock
driver = driver_wiring("serial_armband").on_wire("arm", SystemClock(), port=sys.argv[1])
driver.open(30.0)
driver.start(lambda batch: None)
driver.set_amplitudes((1, 1, 1, 1), 10_000)
while True:
    driver.keep_alive()
    driver.poll(0.02)
"""


class EchoBand:
    """A process that answers commands as the band does, on a pseudo-terminal; no wire delay."""

    def __enter__(self) -> "EchoBand":
        self._own, self._other = os.openpty()
        tty.setraw(self._other)
        self.port = os.ttyname(self._other)
        self._process = subprocess.Popen(
            [sys.executable, "-c", ECHO, str(self._own)], cwd=ROOT, pass_fds=(self._own,)
        )
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._own)
        os.close(self._other)


def band_on(clock: Clock, wire: MemoryLink | None = None, **options: Any) -> Armband:
    """Return the driver of the serial band, on this wire or on its real one."""
    driver = driver_wiring("serial_armband").on_wire("arm", clock, wire, **options)
    assert isinstance(driver, Armband)
    return driver


def busy() -> str:
    """Say how busy the computer is, for a figure that it may have spoiled."""
    waiting = os.getloadavg()[0]
    return f"{waiting:.1f} programs want this computer's {os.cpu_count()} cores"


def bare_round_trips_ms(port: str, count: int, within_s: float = 2.0) -> list[float]:
    """Send SET and read its answer with system calls alone: what the wire itself takes.

    Raises DeviceTimeout when an answer does not come.
    """
    clock = SystemClock()
    line = os.open(port, os.O_RDWR | os.O_NOCTTY)
    termios.tcflush(line, termios.TCIOFLUSH)
    times: list[float] = []
    for i in range(count):
        # As long after the last one as the driver's: a computer that has waited is slower.
        clock.sleep_until_ns(clock.now_ns() + APART_NS)
        data = codec.encode_set(i % 256, 500, (255,) * 4)
        start_ns = clock.now_ns()
        os.write(line, data)
        answer = b""
        while len(answer) < len(data):  # an answer is as long as its question
            if not select.select([line], [], [], within_s)[0]:
                os.close(line)
                raise DeviceTimeout(
                    f"no whole answer within {within_s:g} s, after {len(times)} that came"
                )
            answer += os.read(line, 4096)
        times.append((clock.now_ns() - start_ns) / NS_PER_MS)
    os.close(line)
    return times


def link_round_trips_ms(port: str, count: int) -> list[float]:
    """Send SET and read its answer through the link, without the driver above it."""
    clock = SystemClock()
    link = SerialLink(clock, port=port)
    link.open(10.0)
    times: list[float] = []
    for i in range(count):
        clock.sleep_until_ns(clock.now_ns() + APART_NS)
        data = codec.encode_set(i % 256, 500, (255,) * 4)
        start_ns, got = clock.now_ns(), 0
        link.write(data)
        while got < len(data):
            chunks = link.read(2.0)
            if not chunks:
                raise DeviceTimeout(f"no whole answer, after {len(times)} that came")
            got += sum(len(chunk.data) for chunk in chunks)
        times.append((clock.now_ns() - start_ns) / NS_PER_MS)
    link.close()
    return times


def driver_round_trips_ms(port: str, count: int) -> list[float]:
    """Command through the driver, and wait until its row is delivered as acknowledged."""
    clock = SystemClock()
    driver = band_on(clock, port=port, max_rate_hz=FASTEST_HZ)
    done: dict[int, bool] = {}

    def take(batch: SampleBatch) -> None:
        if batch.schema is HAPTICS:
            for number, acknowledged in zip(
                batch.values["command"], batch.values["acknowledged"], strict=True
            ):
                done[int(number)] = bool(acknowledged)

    driver.open(10.0)
    driver.start(take)
    times: list[float] = []
    deadline_ns = clock.now_ns() + round(WITHIN_S * NS_PER_S)
    for _ in range(count):
        clock.sleep_until_ns(clock.now_ns() + APART_NS)
        start_ns = clock.now_ns()
        if start_ns >= deadline_ns:
            driver.close()
            raise DeviceTimeout(
                f"{len(times)} of {count} commands were answered in {WITHIN_S:g} s; {busy()}"
            )
        number = driver.set_amplitudes(MOTORS_ON, 500)
        while number not in done:  # answered, or given up after 250 ms
            driver.poll(0.5)
        if done[number]:
            times.append((clock.now_ns() - start_ns) / NS_PER_MS)
    driver.close()
    return times


class ClockPutForward(SystemClock):
    """The system clock, which can be put forward instead of waiting."""

    def __init__(self) -> None:
        super().__init__()
        self._ahead_ns = 0

    def now_ns(self) -> int:
        """Return the system clock's time and what it was put forward by."""
        return super().now_ns() + self._ahead_ns

    def leap(self, ns: int) -> None:
        """Put it forward."""
        self._ahead_ns += ns


class BandWithoutWire:
    """A band in this process that answers at once, and how long its own answers took."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._firmware = ArmbandFirmware()
        self._answers: list[Chunk] = []
        self.took_ns = 0

    def connect(self, now_ns: int) -> None:
        """Be there."""

    def accept(self, data: bytes, now_ns: int) -> None:
        """Answer."""
        begin_ns = self._clock.now_ns()
        answer = self._firmware.feed(data, 0)
        if answer:
            self._answers.append(Chunk(now_ns, answer))
        self.took_ns += self._clock.now_ns() - begin_ns

    def outgoing(self, now_ns: int) -> list[Chunk]:
        """Return the answers since the last call."""
        answers, self._answers = self._answers, []
        return answers


def own_work_ms(*, waits: bool, count: int = 500) -> float:
    """Return the median time of the driver's own work on a command, after a wait or at once."""
    clock = ClockPutForward()
    band = BandWithoutWire(clock)
    driver = band_on(clock, MemoryLink(band, clock), max_rate_hz=FASTEST_HZ)
    driver.open(1.0)
    driver.start(lambda batch: None)
    times = []
    for _ in range(count):
        if waits:
            SystemClock().sleep_until_ns(SystemClock().now_ns() + APART_NS)
        else:
            clock.leap(APART_NS)
        start_ns, before_ns = clock.now_ns(), band.took_ns
        driver.set_amplitudes(MOTORS_ON, 500)
        driver.poll(0.0)
        times.append((clock.now_ns() - start_ns - (band.took_ns - before_ns)) / NS_PER_MS)
    driver.close()
    return float(np.median(times))


def contact_to_command_ms(port: str) -> list[float]:
    """Touch at a frame's start: the time until the command's last byte has left the driver.

    The contact is a sphere that enters a forearm, found by distance, at 90 frames a second of
    work without the waiting between them.
    """
    clock = SystemClock()
    driver = band_on(clock, port=port, max_rate_hz=FASTEST_HZ)
    batches: list[SampleBatch] = []
    pump = Pump(driver, batches.append, clock)
    driver.open(10.0)
    pump.start()
    rng = np.random.default_rng(1)
    arm_m = np.array([[0.2, 1.0, -0.3], [0.25, 1.0, -0.05]])
    contacts: dict[int, int] = {}
    deadline_ns = clock.now_ns() + round(WITHIN_S * NS_PER_S)
    while len(contacts) < CONTACTS:
        if clock.now_ns() >= deadline_ns:
            raise DeviceTimeout(f"{len(contacts)} contacts in {WITHIN_S:g} s; {busy()}")
        clock.sleep_until_ns(clock.now_ns() + APART_NS)
        passer_m = rng.normal((0.22, 1.0, -0.2), 0.02, 3)
        contact_ns = clock.now_ns()
        along = np.clip(
            (passer_m - arm_m[0]) @ (arm_m[1] - arm_m[0]) / np.sum((arm_m[1] - arm_m[0]) ** 2), 0, 1
        )
        distance_m = float(np.linalg.norm(arm_m[0] + along * (arm_m[1] - arm_m[0]) - passer_m))
        if distance_m < 0.1:
            strength_01 = 1 - distance_m / 0.1
            contacts[driver.set_amplitudes((strength_01,) * 4, 300)] = contact_ns
        pump.step()
    pump.stop()
    driver.close()
    found = []
    for batch in batches:
        if batch.schema is HAPTICS:
            for number, sent_ns in zip(
                batch.values["command"], batch.values["t_sent_ns"], strict=True
            ):
                if int(number) in contacts and sent_ns > 0:
                    found.append((int(sent_ns) - contacts[int(number)]) / NS_PER_MS)
    return found


def _runs(host: "subprocess.Popen[bytes]") -> bool:
    return host.poll() is None


def silence_after_loss_ms(command: list[str], how: str) -> list[float]:
    """Lose the host while motors run: time from its last byte to the PWM's end.

    `how` is "SIGKILL", "SIGSTOP" or "cut cable". Both are on the machine's own clock, which falls
    behind the system's on a busy computer; the host's end comes after its last byte, at most 50 ms.
    """
    clock = SystemClock()
    found = []
    for _ in range(LOSSES):
        with TerminalMachine(command) as machine:
            host = subprocess.Popen([sys.executable, "-c", HOST, machine.port], cwd=ROOT)
            try:
                machine.wait_for(running=True, within_s=60.0, host_runs=partial(_runs, host))
            except DeviceTimeout:
                host.kill()
                host.wait()
                raise
            clock.sleep_until_ns(clock.now_ns() + 100 * NS_PER_MS)
            if how == "cut cable":
                machine.cut()
            else:
                os.kill(host.pid, getattr(signal, how))
            off = machine.wait_for(running=False)
            host.kill()
            host.wait()
        found.append((off.t_us - machine.received_us[-1][0]) / 1000)
    return found


def damage(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip, drop, insert, cut or overwrite within a frame; its leading zero stays."""
    at = int(rng.integers(1, len(data)))
    kind = int(rng.integers(5))
    if kind == 0:
        return data[:at] + bytes((data[at] ^ 1 << int(rng.integers(8)),)) + data[at + 1 :]
    if kind == 1:
        return data[:at] + data[at + 1 :]
    if kind == 2:
        return data[:at] + bytes((int(rng.integers(256)),)) + data[at:]
    if kind == 3:
        return data[:at]
    noise = rng.integers(0, 256, int(rng.integers(1, 6))).astype(np.uint8).tobytes()
    return data[:at] + noise + data[at + len(noise) :]


def fuzz_python(count: int) -> tuple[int, int]:
    """Send damaged commands to the Python band and damaged answers to the driver's reader.

    Each is followed by the host's refresh; return (wrong until the refresh, surviving it). One in
    64 is whole though nobody meant it, as damage that passes the check would be.
    """
    rng = np.random.default_rng(7)
    firmware = ArmbandFirmware(protection=Protection(budget_ms=120_000))
    firmware.feed(codec.encode_arm(1, True), 0)
    reader = codec.FrameReader()
    ack = codec.encode_acknowledgement(
        codec.Acknowledgement(codec.SET, 9, 123_456, codec.OK, (1, 2, 3, 4), 3900, 25.0)
    )
    wrong = survived = now_us = 0
    for i in range(count // 2):
        seq = 2 * i % 256
        amplitudes = tuple(int(v) for v in rng.integers(0, 256, 4))
        intact = codec.encode_set(seq, int(rng.integers(1, 10_000)), amplitudes)
        forged = rng.integers(64) == 0
        broken = intact if forged else damage(intact, rng)
        if not forged and intact.strip(b"\0") in broken.split(b"\0"):
            continue  # what was changed lies outside the frame
        before = firmware.duties
        firmware.feed(broken, now_us)
        wrong += firmware.duties != before and any(firmware.duties)
        wanted = int(rng.integers(256)) * int(rng.integers(2))
        refresh = (
            codec.encode_set((seq + 1) % 256, 500, (wanted,) * 4)
            if wanted
            else codec.encode_ping((seq + 1) % 256, None)
        )
        firmware.feed(codec.encode_arm(seq, True) + refresh, now_us)
        if any(bool(duty) != bool(wanted) for duty in firmware.granted_duties):
            survived += 1
        if any(duty and not LOWEST_DUTY <= duty <= HIGHEST_DUTY for duty in firmware.duties):
            survived += 1
        for frame in reader.feed(damage(ack, rng) + b"\0" + ack):
            codec.decode_answer(frame)
        now_us += 50_000
        firmware.step(now_us)
    return wrong, survived


def fuzz_firmware(count: int, folder: Path) -> tuple[int, int]:
    """Run the C fuzzer, compiled with address and undefined-behaviour checks."""
    make("host", folder)
    done = subprocess.run(
        [str(folder / "armband_fuzz"), str(count), "7"], capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout)
    return found["wrong_until_refresh"], found["survived"]


def reconnect_after_return_s() -> float:
    """Take the band away for 3 s on the virtual clock: how long after its return it obeys."""
    clock = SimClock()
    faults = FaultSchedule.from_config([{"kind": "disconnect", "start_s": 1, "duration_s": 3}])
    peer = ArmbandSimulator("arm", clock, faults=faults)
    driver = band_on(clock, MemoryLink(peer, clock))
    pump = Pump(driver, lambda batch: None, clock)
    driver.open(1.0)
    pump.start()
    while clock.now_ns() < 10 * NS_PER_S:
        clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 90)
        driver.keep_alive()
        pump.step()
        for event in pump.take_events():
            if event.kind == "reconnected":
                return event.t_ns / NS_PER_S - 4.0
    raise RuntimeError("the driver did not come back")


def machine_command(folder: Path) -> tuple[str, list[str]]:
    """Return where the firmware runs and the command for it."""
    try:
        return "simavr", build("simavr", folder)
    except DeviceNotFound as missing:
        print(f"{missing}; the same C runs on this computer instead", file=sys.stderr)
        return "host", build("host", folder)


def round_trips(port: str, commands: int) -> list[Row]:
    """Return the figures of commands and their answers beside those of the wire alone."""
    through = np.array(driver_round_trips_ms(port, commands))
    bare = np.array(bare_round_trips_ms(port, commands))
    (middle, late), (wire, wire_late) = (np.percentile(x, [50, 99]) for x in (through, bare))
    link = float(np.median(link_round_trips_ms(port, commands))) - float(wire)
    hot_ms, waited_ms = own_work_ms(waits=False), own_work_ms(waits=True)
    parts = (
        f"the link alone (the driver's code alone after such waits {waited_ms:.2g} ms, "
        f"back to back {hot_ms:.2g})"
    )
    return [
        Row("wire alone, median", float(wire), "ms"),
        Row("driver round trip, median", float(middle), "ms"),
        Row(
            "driver overhead, median",
            float(middle - wire),
            "ms",
            0.3,
            floor=link,
            floor_name=parts,
            floor_is_ours=True,
        ),
        Row("driver overhead, p99", float(late - wire_late), "ms", 2.0),
        Row("answered of commands", 100 * len(through) / commands, "%"),
        Row("driver CPU per command", driver_cpu_ms(), "ms"),
    ]


def measure(commands: int, frames: int) -> list[Row]:
    """Run every measurement."""
    with EchoBand() as band:
        rows = round_trips(band.port, commands)
        contact = contact_to_command_ms(band.port)
    rows += [
        Row("contact to command, median", float(np.median(contact)), "ms", 1.0),
        Row("contact to command, p99", float(np.percentile(contact, 99)), "ms"),
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        kind, command = machine_command(folder)
        for how in ("SIGKILL", "SIGSTOP", "cut cable"):
            try:
                off = silence_after_loss_ms(command, how)
            except DeviceError as problem:  # the firmware has to run in real time
                print(f"after {how}: not measured: {problem}; {busy()}", file=sys.stderr)
                continue
            told = f"motors off after {how}"
            rows.append(Row(f"{told}, median ({kind})", float(np.median(off)), "ms"))
            rows.append(Row(f"{told}, worst ({kind})", max(off), "ms", 300.0))
        wrong, survived = fuzz_firmware(frames, folder)
    rows.append(Row(f"C: wrong of {frames} damaged or forged, until refresh", wrong, "frames"))
    rows.append(Row("C: wrong that survived the refresh", survived, "frames", 0.0))
    wrong, survived = fuzz_python(frames)
    rows.append(Row(f"Python: wrong of {frames} damaged or forged, until refresh", wrong, "frames"))
    rows.append(Row("Python: wrong that survived the refresh", survived, "frames", 0.0))
    rows.append(Row("obeys again after the peer's return", reconnect_after_return_s(), "s", 2.0))
    return rows


def driver_cpu_ms(count: int = 3000) -> float:
    """Return CPU time of one command, its answer and its row, simulator included."""
    clock = SimClock()
    peer = ArmbandSimulator("arm", clock, latency_ms=0, jitter_ms=0)
    driver = band_on(clock, MemoryLink(peer, clock), max_rate_hz=FASTEST_HZ)
    driver.open(1.0)
    driver.start(lambda batch: None)

    def once() -> None:
        driver.set_amplitudes(MOTORS_ON, 500)
        clock.sleep_until_ns(clock.now_ns() + 11 * NS_PER_MS)
        driver.poll(0.0)

    return repeated_cpu_ms(once, count)


def repeated_cpu_ms(work: Callable[[], None], count: int) -> float:
    """Return CPU milliseconds per call."""
    work()
    start_s = cpu_time_s()
    for _ in range(count):
        work()
    return (cpu_time_s() - start_s) / count * 1e3


def main() -> None:
    """Print the table, or JSON; exit 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commands", type=int, default=2000)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    try:
        rows = measure(arguments.commands, arguments.frames)
    except DeviceError as problem:
        print(f"not measured: {problem}; {busy()}", file=sys.stderr)
        sys.exit(1)
    status = show(rows, as_json=arguments.json)
    missed = [found for found in rows if found.is_missed]
    if missed and not arguments.json:
        print(f"missed: {', '.join(found.name for found in missed)}; {busy()}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
