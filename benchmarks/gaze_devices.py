"""Measure the eye trackers beyond Pupil Core: stamp lag, clock recovery, fuzz, reconnecting.

    python -m benchmarks.gaze_devices [--seconds 2] [--frames 150000] [--json]

"Ratio" is limit / value: 1 or more is within the limit. The stamp lag is real time from the
sender's last instruction before it hands a sample to the wire to the driver's stamp, so load on
the computer shows in it. Clock and reconnect rows run on virtual time and repeat exactly.
"""

import argparse
import socket
import struct
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.device_wire import StillBody
from benchmarks.table import Row, show
from tests.devices.wire_ends.fove_library import FoveStub, build_stub
from visavis.devices.contracts import ClockPair, DeviceState
from visavis.devices.drivers.eyelink import codec as eyelink_codec
from visavis.devices.drivers.eyelink.driver import EyeLink
from visavis.devices.drivers.fove import codec as fove_codec
from visavis.devices.drivers.fove.driver import Fove
from visavis.devices.drivers.fove.library import FoveLibrary
from visavis.devices.drivers.gazepoint import codec as gazepoint_codec
from visavis.devices.drivers.gazepoint.driver import Gazepoint
from visavis.devices.drivers.hid_gaze import codec as hid_gaze_codec
from visavis.devices.drivers.hid_gaze.driver import HidGaze
from visavis.devices.drivers.links.stream_socket import StreamSocket
from visavis.devices.drivers.lsl import gaze_codec as lsl_gaze_codec
from visavis.devices.drivers.lsl.gaze import LslGaze
from visavis.devices.drivers.neon import codec as neon_codec
from visavis.devices.drivers.neon.driver import Neon
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.drivers.streaming.stream_device import OneWayClock
from visavis.devices.faults import FaultSchedule, WireFault
from visavis.devices.pump import Pump
from visavis.devices.sim.eyelink import EyeLinkSimulator
from visavis.devices.sim.fove import FoveSimulator
from visavis.devices.sim.gazepoint import GazepointSimulator
from visavis.devices.sim.hid_gaze import DESCRIPTOR, HidGazeSimulator
from visavis.devices.sim.lsl.gaze import LslGazeSimulator
from visavis.devices.sim.neon import PAYLOAD_SIZES, NeonSimulator
from visavis.devices.transports import MemoryTransport
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock, SystemClock
from visavis.lab.clock_fit import fit_clock
from visavis.lab.errors import DeviceNotFound
from visavis.lab.schema import SampleBatch

RATES_HZ = (120, 250, 500, 1000)
LAG_LIMIT_MS = 0.2
OFFSET_LIMIT_MS = 0.2
RECONNECT_LIMIT_S = 2.0
DRAWS = 10
MINUTES = 10
JITTER_NS = 5e6
DRIFT = 50e-6
GONE_FOR_S = (0.7, 2.3, 5.1, 9.7, 31.0)
TRACKERS: dict[str, tuple[Any, Any]] = {
    "fove": (Fove, FoveSimulator),
    "gazepoint": (Gazepoint, GazepointSimulator),
    "neon": (Neon, NeonSimulator),
    "hid_gaze": (HidGaze, HidGazeSimulator),
    "lsl_gaze": (LslGaze, LslGazeSimulator),
    "eyelink": (EyeLink, EyeLinkSimulator),
}


def paced(clock: SystemClock, rate_hz: int, seconds: float) -> Iterator[int]:
    """Yield at a steady rate, each time the present moment."""
    start_ns = clock.now_ns() + 50 * NS_PER_MS
    for k in range(round(rate_hz * seconds)):
        clock.sleep_until_ns(start_ns + k * NS_PER_S // rate_hz)
        yield clock.now_ns()


def lags_ms(
    driver: Any, clock: SystemClock, send: Callable[[], None], offset_ns: int = 0
) -> npt.NDArray[np.float64]:
    """Return arrival stamp minus the device's stamp while `send` sends in another thread."""
    batches: list[SampleBatch] = []
    driver.start(batches.append)
    sender = threading.Thread(target=send)
    sender.start()
    while sender.is_alive():
        driver.poll(0.02)
    driver.poll(0.02)
    driver.stop()
    host = np.concatenate([b.t_host_ns for b in batches])
    device = np.concatenate([b.t_device_ns for b in batches])
    lag: npt.NDArray[np.float64] = (host - device - offset_ns) / NS_PER_MS
    return lag


def tcp_lag_rows(seconds: float) -> list[Row]:
    """Send Gazepoint records through a real socket, stamped as they are sent."""
    clock = SystemClock()
    rows = []
    for rate_hz in RATES_HZ:
        with socket.create_server(("127.0.0.1", 0)) as listener:
            wire = StreamSocket("127.0.0.1", listener.getsockname()[1], clock)
            driver = Gazepoint("eyes", wire, clock, rate_hz=rate_hz)
            greeter = threading.Thread(target=_greet, args=(listener,))
            greeter.start()
            driver.open(5.0)
            greeter.join()
            client = _CLIENTS.pop()

            def send(client: socket.socket = client, rate_hz: int = rate_hz) -> None:
                for k, now_ns in enumerate(paced(clock, rate_hz, seconds)):
                    line = f'<REC CNT="{k}" TIME_TICK="{now_ns}" BPOGX="0.5" BPOGY="0.5" />\r\n'
                    client.sendall(line.encode())

            lag = lags_ms(driver, clock, send)
            driver.close()
            client.close()
        name = f"stamp lag over TCP at {rate_hz} Hz, median"
        rows.append(Row(name, float(np.median(lag)), "ms", LAG_LIMIT_MS))
    return rows


_CLIENTS: list[socket.socket] = []
_TICKS_PER_S = NS_PER_S


def _greet(listener: socket.socket) -> None:
    client, _ = listener.accept()
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    asked = b""
    while b"ENABLE_SEND_DATA" not in asked:
        asked += client.recv(4096)
    client.sendall(
        f'<ACK ID="TIME_TICK_FREQUENCY" FREQ="{_TICKS_PER_S}" />\r\n'
        '<ACK ID="ENABLE_SEND_DATA" STATE="1" />\r\n'.encode()
    )
    _CLIENTS.append(client)


def library_lag_rows(seconds: float) -> list[Row]:
    """Push eye frames into the compiled stand-in of FoveClient, stamped as they are pushed."""
    clock = SystemClock()
    rows = []
    frame = struct.Struct("<QQ")
    with tempfile.TemporaryDirectory() as folder:
        try:
            library = build_stub(Path(folder))
        except DeviceNotFound:
            return [Row("stamp lag over a library: no C compiler, not measured", 0.0, "")]
        simulator = FoveSimulator(StillBody(), clock=clock, seed=1)
        rest = simulator.to_message(simulator.source.take(clock.now_ns() + NS_PER_S)[0])[0][16:]
        stub = FoveStub(library, simulator, clock)
        for rate_hz in RATES_HZ:
            driver = Fove("eyes", FoveLibrary(str(library), clock), clock, rate_hz=rate_hz)
            driver.open(5.0)

            def send(rate_hz: int = rate_hz) -> None:
                for k, now_ns in enumerate(paced(clock, rate_hz, seconds)):
                    stub.push(frame.pack(k, now_ns // 1000) + rest)

            lag = lags_ms(driver, clock, send)
            driver.close()
            name = f"stamp lag over a library at {rate_hz} Hz, median"
            rows.append(Row(name, float(np.median(lag)), "ms", LAG_LIMIT_MS))
    return rows


def clock_rows() -> list[Row]:
    """Recover offsets with 50 ppm drift and 5 ms jitter: exchanges, and one-way arrivals."""
    two_way, one_way = [], []
    floor_ns = 12 * NS_PER_MS
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed)
        device = np.arange(MINUTES * 120) * (NS_PER_S // 2)
        up, down = (100_000 + rng.exponential(JITTER_NS, (2, device.size))).astype(np.int64)
        host = device + np.rint(device * DRIFT).astype(np.int64)
        pairs = [
            ClockPair(int(h - u), int(d), int(h + w))
            for h, d, u, w in zip(host, device, up, down, strict=True)
        ]
        two_way.append(np.abs(fit_clock(pairs).to_host_ns(device) - host).max() / NS_PER_MS)
        device = np.arange(MINUTES * 60 * 120) * (NS_PER_S // 120)
        host = device + np.rint(device * DRIFT).astype(np.int64)
        late = np.maximum.accumulate(
            host + floor_ns + rng.exponential(JITTER_NS, device.size).astype(np.int64)
        )
        follower = OneWayClock()
        follower.add(device.tolist(), late.tolist())
        fit = follower.fit()
        assert fit is not None
        one_way.append(np.abs(fit.to_host_ns(device) - host - floor_ns).max() / NS_PER_MS)
    return [
        Row("clock by exchanges: worst error, all draws", max(two_way), "ms", OFFSET_LIMIT_MS),
        Row("clock by arrivals: worst error, all draws", max(one_way), "ms", OFFSET_LIMIT_MS),
    ]


def fuzz_rows(n_frames: int) -> list[Row]:
    """Damage good frames of every codec and count exceptions and rays that are not unit vectors."""
    rows = []
    total = wrong = 0
    for name, (payload, decode) in codecs().items():
        rng = np.random.default_rng(7)
        exceptions = 0
        kept: list[bytes] = []
        for _ in range(n_frames):
            try:
                row = decode(damaged(payload, rng))
            except Exception:  # what is counted
                exceptions += 1
                continue
            if row is not None:
                kept.append(row)
        values = rows_to_values(kept)
        for column in ("direction_head", "left_direction_head", "right_direction_head"):
            lengths = np.linalg.norm(values[column].astype(np.float64), axis=1)
            wrong += int((np.abs(lengths[np.isfinite(lengths)] - 1) > 1e-4).sum())
        total += n_frames
        rows.append(Row(f"fuzz {name}: exceptions in {n_frames} frames", float(exceptions), ""))
    rows.append(Row("fuzz: damaged frames in all", float(total), ""))
    rows.append(Row("fuzz: rays that are neither unit vectors nor missing", float(wrong), ""))
    return rows


def damaged(payload: bytes, rng: np.random.Generator) -> bytes:
    """Flip some bytes; now and then cut or lengthen."""
    raw = bytearray(payload)
    for place in rng.integers(0, len(raw), int(rng.integers(1, 6))):
        raw[place] = int(rng.integers(0, 256))
    if rng.random() < 0.1:
        del raw[int(rng.integers(0, len(raw))) :]
    elif rng.random() < 0.05:
        raw += rng.bytes(int(rng.integers(1, 20)))
    return bytes(raw)


def codecs() -> dict[str, tuple[bytes, Callable[[bytes], bytes | None]]]:
    """Return a good frame and a decoder per codec; the decoder gives a row or None."""
    clock = SimClock()
    screen = Screen()
    found: dict[str, tuple[bytes, Callable[[bytes], bytes | None]]] = {}

    def frame(simulator: Any) -> bytes:
        shot = simulator.source.take(NS_PER_S)[0]
        last: bytes = simulator.to_message(shot)[-1]
        return last

    def row_or_none(sample: Any) -> bytes | None:
        return None if sample is None else bytes(sample.row)

    def fove(raw: bytes) -> bytes | None:
        decoded = fove_codec.decode_eye_frame(raw, 0.064)
        return None if decoded is None else decoded[0].row

    found["fove"] = (frame(FoveSimulator(StillBody(), clock=clock, seed=1)), fove)
    gazepoint = GazepointSimulator(StillBody(), clock=clock, seed=1)
    gazepoint.answer((gazepoint_codec.set_line("ENABLE_SEND_DATA", STATE="1"),), 0)
    place = gazepoint_codec.Place(screen)

    def lines(raw: bytes) -> bytes | None:
        for line in gazepoint_codec.LineReader().feed(raw + b"\n"):
            return row_or_none(gazepoint_codec.decode_record(line.values, place, 10_000_000))
        return None

    found["gazepoint"] = (frame(gazepoint), lines)
    camera = neon_codec.SceneCamera(distortion=(0.1, -0.1, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0))
    for size in PAYLOAD_SIZES[-2:]:
        simulator = NeonSimulator(StillBody(), clock=clock, seed=1, payload_size=size)
        found[f"neon {size}"] = (
            frame(simulator),
            lambda raw: row_or_none(neon_codec.decode_gaze(0, 0, raw, camera)),
        )
    layout = hid_gaze_codec.tracking_layout(hid_gaze_codec.walk_descriptor(DESCRIPTOR))
    assert layout is not None

    def report(raw: bytes) -> bytes | None:
        decoded = hid_gaze_codec.decode_report(raw, layout, screen, 64.0)
        return None if decoded is None else decoded[1]

    found["hid_gaze"] = (frame(HidGazeSimulator(StillBody(), clock=clock, seed=1)), report)
    stream = LslGazeSimulator(StillBody(), clock=clock, seed=1)
    info = lsl_gaze_codec.parse_info(stream.xml())
    assert info is not None
    channels = lsl_gaze_codec.layout_of(info)
    assert channels is not None
    found["lsl_gaze"] = (
        frame(stream),
        lambda raw: row_or_none(lsl_gaze_codec.decode_sample(raw, channels, screen, 0.032)),
    )
    found["eyelink"] = (
        frame(EyeLinkSimulator(StillBody(), clock=clock, seed=1)),
        lambda raw: row_or_none(eyelink_codec.decode_sample(raw, screen, (1920, 1080), 0.032)),
    )
    return found


def reconnect_rows() -> list[Row]:
    """Let each peer go for several lengths; the time from its return to streaming, virtual."""
    rows = []
    for name, (driver_class, simulator_class) in TRACKERS.items():
        worst_s = max(back_after_s(driver_class, simulator_class, gone_s) for gone_s in GONE_FOR_S)
        rows.append(Row(f"reconnect {name}: worst", worst_s, "s", RECONNECT_LIMIT_S))
    return rows


def back_after_s(driver_class: Any, simulator_class: Any, gone_s: float) -> float:
    """Return the seconds from a peer's return until its driver streams again."""
    clock = SimClock()
    faults = FaultSchedule((WireFault("disconnect", 1.0, gone_s),))
    simulator = simulator_class(StillBody(), clock=clock, seed=1, faults=faults)
    driver = driver_class("eyes", MemoryTransport(simulator, clock), clock, lost_after_s=0.5)
    driver.open(2.0)
    pump = Pump(driver, lambda batch: None, clock)
    pump.start()
    was_lost = False
    return_ns = round((1.0 + gone_s) * NS_PER_S)
    while clock.now_ns() < return_ns + 20 * NS_PER_S:
        clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 90)
        pump.step()
        was_lost = was_lost or driver.state is DeviceState.FAULT
        if was_lost and driver.state is DeviceState.STREAMING:
            break
    return max(0.0, (clock.now_ns() - return_ns) / NS_PER_S)


def main(arguments: list[str]) -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(prog="benchmarks.gaze_devices", description=__doc__)
    parser.add_argument("--seconds", type=float, default=2.0, help="length of each lag run")
    parser.add_argument("--frames", type=int, default=150_000, help="damaged frames per codec")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    options = parser.parse_args(arguments)
    rows = [
        *tcp_lag_rows(options.seconds),
        *library_lag_rows(options.seconds),
        *clock_rows(),
        *reconnect_rows(),
        *fuzz_rows(options.frames),
    ]
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
