"""Measure body trackers and headset runtimes: parsing, stamp lag, clocks, damage, pacing.

    python -m benchmarks.body_devices [--frames 200000] [--json]

"Ratio" is limit / value: 1 or more is within the limit. Costs are CPU time of this process. The
stamp lag is arrival stamp minus the moment before the datagram was sent on the loopback, so it
contains both ends' system calls.
"""

import argparse
import socket
import struct
import sys
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from benchmarks.table import Row, show
from visavis.devices.body_contract import OneStretch
from visavis.devices.datagrams import UdpTransport
from visavis.devices.drivers.natnet import codec as natnet_codec
from visavis.devices.drivers.natnet.driver import NatNet
from visavis.devices.drivers.openvr import codec as openvr_codec
from visavis.devices.drivers.openvr.headset import OpenVrHeadset
from visavis.devices.drivers.openxr.headset import OpenXrHeadset
from visavis.devices.drivers.xsens import codec as xsens_codec
from visavis.devices.drivers.xsens.driver import XsensMvn
from visavis.devices.pump import Pump
from visavis.devices.sim.body.wire import BodyWire
from visavis.devices.sim.native_build import find_compiler
from visavis.devices.sim.natnet import NatNetSimulator
from visavis.devices.sim.openvr.runtime import SimulatedVrRuntime
from visavis.devices.sim.openxr.runtime import SimulatedXrRuntime
from visavis.devices.sim.xsens import XsensSimulator
from visavis.devices.transports import MemoryTransport
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock, SystemClock, cpu_time_s
from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector
from visavis.lab.schema import SampleBatch

REPEATS = 5_000
LAG_DATAGRAMS = 2_000
OFFSET_LIMIT_MS = 0.2
LAG_LIMIT_MS = 0.2
WORN = {"Wand": "right_hand", "Cap": "head"}
DRIFT_PPM, DELAY_MS, JITTER_MS = 50.0, 2.0, 5.0
CLOCK_SECONDS = 120


class NoddingBody(OneStretch):
    """Stand still and turn the head slowly; costs next to nothing to ask."""

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return nothing worth seeing."""
        raise NotImplementedError

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return a head that turns."""
        half = 0.1 * np.sin(t_ns * 1e-9)
        return np.array([0.0, 1.6, 0.0]), np.array([np.cos(half), 0.0, np.sin(half), 0.0])

    def segments(self, names: Sequence[str], t_ns: npt.NDArray[np.int64]) -> tuple[Vector, Vector]:
        """Return segments at rest."""
        turns = np.zeros((t_ns.size, len(names), 4))
        turns[..., 0] = 1.0
        return np.zeros((t_ns.size, len(names), 3)), turns

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Feel nothing."""


def cost_us(action: Callable[[], object]) -> float:
    """Return CPU µs per call."""
    action()
    start_s = cpu_time_s()
    for _ in range(REPEATS):
        action()
    return (cpu_time_s() - start_s) / REPEATS * 1e6


def sample_datagrams() -> tuple[bytes, bytes, bytes]:
    """Return an MVN sample, a NatNet 4.1 frame and 64 OpenVR poses."""
    clock = SimClock()
    mvn = XsensSimulator(NoddingBody(), clock, seed=1)
    motive = NatNetSimulator(NoddingBody(), clock, seed=1, bodies=WORN)
    raw_mvn = mvn.encode(1, 0, *_rest(len(mvn.segments)), tracked=True)[0]
    raw_natnet = motive.encode(1, 0, *_rest(len(WORN)), tracked=True)[0]
    poses = np.zeros(openvr_codec.MAX_DEVICES, openvr_codec.POSE_DTYPE)
    poses["matrix"][:, :3, :3] = np.eye(3)
    poses["result"], poses["is_valid"], poses["is_connected"] = 200, True, True
    return raw_mvn, raw_natnet, poses.tobytes()


def _rest(n: int) -> tuple[Vector, Vector]:
    turns = np.zeros((n, 4))
    turns[:, 0] = 1.0
    return np.zeros((n, 3)), turns


def parse_rows() -> list[Row]:
    """Measure decoding of one sample of each wire, and plain struct on the same bytes."""
    mvn, motive, vr = sample_datagrams()
    assembler = xsens_codec.Assembler()

    def decode_mvn() -> None:
        datagram = xsens_codec.decode_datagram(mvn)
        assert isinstance(datagram, xsens_codec.Datagram)
        assembler.add(datagram)

    payload = natnet_codec.split_message(motive)[1]
    plain = struct.Struct(">" + "i7f" * 23)
    return [
        Row("MVN: decode 23 segments", cost_us(decode_mvn), "µs"),
        Row("peer: struct.unpack alone", cost_us(lambda: plain.unpack(mvn[24:])), "µs"),
        Row(
            "NatNet 4.1: decode a frame of 2 bodies",
            cost_us(lambda: natnet_codec.decode_frame(payload, (4, 1))),
            "µs",
        ),
        Row(
            "OpenVR: decode the headset's pose of 64",
            cost_us(lambda: openvr_codec.decode_pose(openvr_codec.decode_poses(vr)[0])),
            "µs",
        ),
    ]


def lag_rows() -> list[Row]:
    """Measure arrival stamp minus time before sending, on the loopback."""
    clock = SystemClock()
    wire = UdpTransport(clock, local_address="127.0.0.1")
    wire.open(1.0)
    mvn = sample_datagrams()[0]
    lags = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(LAG_DATAGRAMS):
            before_ns = clock.now_ns()
            sender.sendto(mvn, ("127.0.0.1", wire.port))
            messages = wire.receive(1.0)
            lags += [m.t_host_ns - before_ns for m in messages]
    wire.close()
    milliseconds = np.array(lags) / NS_PER_MS
    return [
        Row("UDP: host-stamp lag, median", float(np.median(milliseconds)), "ms", LAG_LIMIT_MS),
        Row("UDP: host-stamp lag, 99 %", float(np.quantile(milliseconds, 0.99)), "ms"),
        Row("UDP: datagrams lost of 2000", float(LAG_DATAGRAMS - len(lags)), ""),
    ]


def clock_rows() -> list[Row]:
    """Recover the clock offset of one-way streams with 50 ppm drift and 5 ms jitter."""
    rows = []
    for name, seed in (("MVN", 1), ("MVN", 2), ("NatNet", 1), ("NatNet", 2)):
        clock = SimClock()
        body = NoddingBody()
        options = {"drift_ppm": DRIFT_PPM, "delay_ms": DELAY_MS, "jitter_ms": JITTER_MS}
        simulator: BodyWire
        if name == "MVN":
            simulator = XsensSimulator(body, clock, seed=seed, **options)  # type: ignore[arg-type]  # floats
            driver: XsensMvn | NatNet = XsensMvn("body", MemoryTransport(simulator, clock), clock)
        else:
            simulator = NatNetSimulator(body, clock, seed=seed, bodies=WORN, **options)  # type: ignore[arg-type]  # floats
            driver = NatNet("body", MemoryTransport(simulator, clock), clock, bodies=WORN)
        batches: list[SampleBatch] = []
        driver.open(2.0)
        pump = Pump(driver, batches.append, clock)
        pump.start()
        for _ in range(CLOCK_SECONDS * 90):
            clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 90)
            pump.step()
        health = driver.health()
        first = batches[0]
        reference_ns = int(first.t_device_ns[0])
        true_ns = clock.now_ns() - simulator.device_ns(clock.now_ns())
        assert health.clock_offset_ms is not None
        assert health.clock_drift_ppm is not None
        elapsed_ns = simulator.device_ns(clock.now_ns()) - reference_ns
        fitted_ms = health.clock_offset_ms + elapsed_ns * health.clock_drift_ppm * 1e-6 / NS_PER_MS
        error_ms = abs(fitted_ms - true_ns / NS_PER_MS - DELAY_MS)
        # MVN's time code has whole milliseconds, cut off: half of one is not a fault of the fit.
        note = " (time code of 1 ms)" if name == "MVN" else ""
        rows.append(
            Row(
                f"{name}: offset error after {CLOCK_SECONDS} s, seed {seed}{note}",
                error_ms,
                "ms",
                OFFSET_LIMIT_MS,
            )
        )
    return rows


def damage_rows(frames: int) -> list[Row]:
    """Feed damaged messages to the decoders; count exceptions other than DataError."""
    rng = np.random.default_rng(1)
    mvn, motive, vr = sample_datagrams()
    assembler = xsens_codec.Assembler()
    failures = accepted = 0
    for number in range(frames):
        source = (mvn, motive, vr)[number % 3]
        raw = np.frombuffer(source, np.uint8).copy()
        at = rng.integers(0, raw.size, rng.integers(1, 8))
        raw[at] = rng.integers(0, 256, at.size)
        data = (
            raw.tobytes()[: int(rng.integers(1, raw.size + 1))]
            if number % 5 == 0
            else raw.tobytes()
        )
        try:
            if source is mvn:
                found = xsens_codec.decode_datagram(data)
                if isinstance(found, xsens_codec.Datagram):
                    assembler.add(found)
                    accepted += 1
            elif source is motive:
                natnet_codec.decode_frame(natnet_codec.split_message(data)[1], (4, 1))
                accepted += 1
            else:
                for pose in openvr_codec.decode_poses(data)[:2]:
                    openvr_codec.decode_pose(pose)
        except DataError:
            continue
        except Exception as problem:  # what this counts
            failures += 1
            print(f"{type(problem).__name__}: {problem}", file=sys.stderr)
    return [
        Row(f"exceptions in {frames} damaged messages", float(failures), "", 0.0),
        Row("  of them readable all the same", float(accepted), ""),
    ]


def pacing_rows() -> list[Row]:
    """Run 900 frames on each simulated runtime, virtual clock: pace and CPU per frame."""
    if find_compiler() is None:
        return []
    rows = []
    clock = SimClock()
    with SimulatedVrRuntime(NoddingBody(), clock) as vr:
        headset = OpenVrHeadset("headset", vr.library().transport(), clock)
        rows += _paced("OpenVR", headset, (1, 2))
    clock = SimClock()
    with SimulatedXrRuntime(NoddingBody(), clock) as xr:
        rows += _paced("OpenXR", OpenXrHeadset("headset", xr.library().transport(), clock), ())
    return rows


def _paced(
    name: str, headset: OpenVrHeadset | OpenXrHeadset, images: Sequence[object]
) -> list[Row]:
    headset.open(2.0)
    headset.start(lambda batch: None)
    start_s = cpu_time_s()
    frames = []
    for _ in range(900):
        frames.append(headset.wait_frame())
        headset.submit(frames[-1], images)
        headset.poll(0.0)
    cpu_us = (cpu_time_s() - start_s) / len(frames) * 1e6
    headset.close()
    steps_ms = np.diff([f.t_ns for f in frames]) / NS_PER_MS
    return [
        Row(f"{name}: frame step, median", float(np.median(steps_ms)), "ms"),
        Row(f"{name}: frame step, largest error", float(np.abs(steps_ms - 1e3 / 90).max()), "ms"),
        Row(f"{name}: dropped of 900", float(sum(f.dropped for f in frames)), ""),
        Row(f"{name}: CPU per frame, simulator included", cpu_us, "µs"),
    ]


def main() -> int:
    """Print every figure; return 1 where a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--frames", type=int, default=200_000, help="damaged messages")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    rows = [
        *parse_rows(),
        *lag_rows(),
        *clock_rows(),
        *damage_rows(arguments.frames),
        *pacing_rows(),
    ]
    return show(rows, as_json=arguments.json)


if __name__ == "__main__":
    sys.exit(main())
