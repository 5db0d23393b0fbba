"""Measure the Pupil Core wire: cost per datum, stamp lag on real sockets, clock recovery.

    python -m benchmarks.device_wire [--seconds 10] [--json]

"Ratio" is limit / value: 1 or more is within the limit. Costs are CPU time of this process.
The stamp lag is arrival stamp minus the moment the hosted simulator was to publish the datum,
so it contains the simulator's own loop of 1 ms.
"""

import argparse
import sys

import msgpack
import numpy as np
import numpy.typing as npt

from benchmarks.table import Row, show
from visavis.devices.contracts import EYES_DTYPE, ClockPair, OneStretch
from visavis.devices.drivers.pupil.codec import CONFIDENCE_THRESHOLD_01, decode_gaze
from visavis.devices.drivers.pupil.driver import PupilCore
from visavis.devices.pump import Pump
from visavis.devices.sim.gaze.tracker_error import TrackerErrorModel
from visavis.devices.sim.pupil.capture import PupilCoreSimulator
from visavis.devices.sim.pupil.wire import BINOCULAR_TOPIC, GAZE_VALUES, GazeTemplate
from visavis.devices.sim.zmq_host import ZmqHost
from visavis.devices.transports import MemoryTransport, ZmqTransport
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock, SystemClock, cpu_time_s
from visavis.lab.clock_fit import fit_clock, offset_ns
from visavis.lab.geometry import Vector
from visavis.lab.schema import SampleBatch

REPEATS = 20_000
FRAME_RATE_HZ = 90
LATENCY_MS = 12.0
CODEC_LIMIT_US = 25.0
OFFSET_LIMIT_MS = 0.2
LAG_LIMIT_MS = 8.3


class StillBody(OneStretch):
    """Look straight ahead at 2 m; costs next to nothing to ask."""

    def __init__(self) -> None:
        self._row = np.zeros(1, EYES_DTYPE)
        for name, x_m in (("left", -0.032), ("right", 0.032)):
            ray = np.array([-x_m, 0.0, -2.0])
            self._row[f"{name}_direction_head"] = ray / np.linalg.norm(ray)
        self._row["openness_01"] = 1.0
        self._row["pupil_mm"] = 3.5

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return the same state for every time."""
        return np.repeat(self._row, t_ns.size)

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return a head that does not move."""
        return np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])


def codec_rows() -> list[Row]:
    """Measure encoding and decoding, and plain msgpack on the same datum."""
    template = GazeTemplate(BINOCULAR_TOPIC, {0: (32.0, 0.0, 0.0), 1: (-32.0, 0.0, 0.0)})
    values = np.random.default_rng(1).uniform(0.1, 1.0, (1, len(GAZE_VALUES)))
    payload = template.pack(values)[0][1]
    datum = msgpack.unpackb(payload)
    encode_us = cost_us(lambda: template.pack(values))
    decode_us = cost_us(lambda: decode_gaze(payload, CONFIDENCE_THRESHOLD_01))
    return [
        Row("encode one datum", encode_us, "µs"),
        Row("decode one datum", decode_us, "µs"),
        Row("encode + decode", encode_us + decode_us, "µs", CODEC_LIMIT_US),
        Row("peer: msgpack.packb alone", cost_us(lambda: msgpack.packb(datum)), "µs"),
        Row("peer: msgpack.unpackb alone", cost_us(lambda: msgpack.unpackb(payload)), "µs"),
        Row("size of one datum", float(len(payload)), "bytes"),
    ]


def cost_us(action: object) -> float:
    """Return CPU µs per call."""
    assert callable(action)
    action()
    start_s = cpu_time_s()
    for _ in range(REPEATS):
        action()
    return (cpu_time_s() - start_s) / REPEATS * 1e6


def poll_rows() -> list[Row]:
    """Measure a whole step (simulate, encode, decode, deliver) on the virtual clock."""
    clock = SimClock()
    simulator = PupilCoreSimulator(StillBody(), clock=clock, seed=1)
    driver = PupilCore("eyes", MemoryTransport(simulator, clock), clock)
    batches: list[SampleBatch] = []
    driver.open(2.0)
    pump = Pump(driver, batches.append, clock)
    pump.start()
    begin_ns = clock.now_ns()
    for k in range(FRAME_RATE_HZ):  # compiles and fills caches
        clock.sleep_until_ns(begin_ns + k * NS_PER_S // FRAME_RATE_HZ)
        pump.step()
    batches.clear()
    begin_ns, start_s = clock.now_ns(), cpu_time_s()
    for k in range(REPEATS):
        clock.sleep_until_ns(begin_ns + k * NS_PER_S // FRAME_RATE_HZ)
        pump.step()
    spent_us = (cpu_time_s() - start_s) * 1e6
    samples = sum(map(len, batches))
    return [
        Row("step of 1/90 s, simulator and driver", spent_us / REPEATS, "µs"),
        Row("the same per datum at 120 Hz", spent_us / samples, "µs"),
    ]


def socket_rows(seconds: float) -> list[Row]:
    """Measure arrival stamps and the clock offset over real sockets at 120 Hz."""
    clock = SystemClock()
    error = TrackerErrorModel(latency_ms=LATENCY_MS, latency_jitter_ms=0.0)
    simulator = PupilCoreSimulator(StillBody(), clock=clock, seed=1, error=error)
    batches: list[SampleBatch] = []
    with ZmqHost(simulator, clock) as host:
        wire = ZmqTransport("127.0.0.1", host.port, clock, is_simulated=True)
        driver = PupilCore("eyes", wire, clock)
        driver.open(5.0)
        pump = Pump(driver, batches.append, clock)
        pump.start()
        end_ns = clock.now_ns() + round(seconds * NS_PER_S)
        while clock.now_ns() < end_ns:
            clock.sleep_until_ns(clock.now_ns() + NS_PER_S // FRAME_RATE_HZ)
            pump.step()
        pump.stop()
        pairs = driver.clock_pairs()
        driver.close()
    device_ns = np.concatenate([batch.t_device_ns for batch in batches])
    host_ns = np.concatenate([batch.t_host_ns for batch in batches])
    true_offset_ns = -simulator.device_ns(0)
    lag_ms = (host_ns - device_ns - true_offset_ns) / NS_PER_MS - LATENCY_MS
    found_ms = abs(offset_ns(pairs) - true_offset_ns) / NS_PER_MS
    span_s = (device_ns[-1] - device_ns[0]) / NS_PER_S
    return [
        Row("sockets: rate", (device_ns.size - 1) / span_s, "Hz"),
        Row("sockets: stamp lag, median", float(np.median(lag_ms)), "ms"),
        Row("sockets: stamp lag, p99", float(np.percentile(lag_ms, 99)), "ms", LAG_LIMIT_MS),
        Row("sockets: clock offset error", found_ms, "ms", OFFSET_LIMIT_MS),
    ]


def clock_rows() -> list[Row]:
    """Fit 20 min of exchanges with 50 ppm drift and 5 ms jitter each way, 50 draws."""
    worst_ms = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        device = np.arange(2400) * (NS_PER_S // 2)
        up, down = (100_000 + rng.exponential(5e6, (2, 2400))).astype(np.int64)
        host = device + np.rint(device * 50e-6).astype(np.int64)
        pairs = [
            ClockPair(int(h - u), int(d), int(h + w))
            for h, d, u, w in zip(host, device, up, down, strict=True)
        ]
        worst_ms.append(np.abs(fit_clock(pairs).to_host_ns(device) - host).max() / NS_PER_MS)
    return [
        Row("clock fit: worst error, median of draws", float(np.median(worst_ms)), "ms"),
        Row("clock fit: worst error, all draws", max(worst_ms), "ms", OFFSET_LIMIT_MS),
    ]


def main(arguments: list[str]) -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(prog="benchmarks.device_wire", description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="length of the socket run")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    options = parser.parse_args(arguments)
    rows = [*codec_rows(), *poll_rows(), *socket_rows(options.seconds), *clock_rows()]
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
