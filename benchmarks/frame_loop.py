"""Measure what Visavis does per frame in a session in real time.

    python -m benchmarks.frame_loop [--seconds 20] [--wire sockets|memory|both] [--json]

A session of the stare study runs on the system clock: calibration, then scenes with eleven agents,
the plan's step, gaze at 120 Hz and hits on the heads, every stream recorded by the writer thread
with data synced each second. Work is the time from the end of one wait for the display to the
beginning of the next; frames of calibration are left out. Over sockets the simulated tracker
lives in a thread of this process and takes part in its scheduling; in memory its samples are made
within the frame, which therefore costs more than with a real tracker. "Ratio" is limit / value.
Beneath stands what the same frames take without wire and tracker, where one follows the other at
once, and where each comes after a wait: meanwhile the processor's memory serves others.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.table import Row, show
from visavis.devices.contracts import SessionName
from visavis.devices.drivers.pupil.driver import PupilCore
from visavis.devices.shared_body import SharedBody
from visavis.devices.sim.body.headset import SimulatedHeadset
from visavis.devices.sim.pupil.capture import PupilCoreSimulator
from visavis.devices.sim.zmq_host import ZmqHost
from visavis.devices.transports import (
    MemoryTransport,
    Message,
    MessageTransport,
    ZmqTransport,
)
from visavis.lab.clock import StopWatch, SystemClock
from visavis.lab.frame import FrameInfo
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.protocol.session.operator import Operator, UnattendedOperator
from visavis.protocol.session.rig import Rig
from visavis.protocol.session.session import Session
from visavis.protocol.session.session_setup import SessionSetup
from visavis.recording.writer import REAL_TIME_BATCH_NS, Recorder
from visavis.results.opened_study import find_study
from visavis.running.sessions.session_request import device_seed
from visavis.stage.contracts import GeometryStage

SEED = 1
DISPLAY_HZ = 90
TRACKER_HZ = 120
MEDIAN_LIMIT_MS = 1.0
P99_LIMIT_MS = 2.0
QUICK = TargetTiming(100, 100, 100, 100)
WIRES = ("sockets", "memory")
WAIT_NS = 8_000_000
"""Most of a frame at 90 Hz."""


class LeapingClock(SystemClock):
    """A clock that stands at a frame's time and leaps to the next; it may wait meanwhile."""

    def __init__(self, *, waits: bool) -> None:
        super().__init__()
        self._at_ns = 0
        self._waits = waits

    def now_ns(self) -> int:
        """Return the time of the frame."""
        return self._at_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Leap there, after most of a frame's time where it waits."""
        if self._waits and deadline_ns - self._at_ns > WAIT_NS:
            SystemClock.sleep_until_ns(clock := SystemClock(), clock.now_ns() + WAIT_NS)
        self._at_ns = max(self._at_ns, deadline_ns)


class WatchedTransport(MemoryTransport):
    """A wire in memory that notes how long it and the simulated tracker behind it take."""

    took_s = 0.0

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return what has arrived."""
        watch = StopWatch()
        messages = super().receive(timeout_s)
        self.took_s += watch.elapsed_s()
        return messages


class WatchedHeadset(SimulatedHeadset):
    """Note how long each frame took outside `wait_frame`, and when the frame began."""

    def __init__(self, role: str, body: SharedBody, clock: SystemClock) -> None:
        super().__init__(role, body, clock, display_rate_hz=DISPLAY_HZ)
        self.wire: WatchedTransport | None = None
        self.work: list[tuple[int, float]] = []
        self.dropped: list[tuple[int, int]] = []
        self._watch: StopWatch | None = None
        self._t_ns = 0

    def wait_frame(self) -> FrameInfo:
        """Wait as the simulated headset does."""
        if self._watch is not None:
            taken_s = self._watch.elapsed_s()
            if self.wire is not None:
                taken_s -= self.wire.took_s
                self.wire.took_s = 0.0
            self.work.append((self._t_ns, taken_s * 1e3))
        frame = super().wait_frame()
        self._t_ns = frame.t_ns
        self.dropped.append((frame.t_ns, frame.dropped))
        self._watch = StopWatch()
        return frame


def work_per_frame_ms(
    wire: str,
    seconds: float,
    root: Path,
    operator: Operator | None = None,
    clock: SystemClock | None = None,
) -> tuple[list[float], int]:
    """Run a session; return the work of every frame in trials, and how many were dropped.

    On a `LeapingClock` the work is that without the wire and the tracker behind it.
    """
    study = find_study("stare")
    clock = SystemClock() if clock is None else clock
    experiment = study.experiment({"trial_s": seconds / 2, "intertrial_s": 0.5})
    plan = experiment.plan(0, SEED, "")
    block = plan.blocks[1]
    plan = replace(plan, blocks=(replace(block, trials=block.trials[:2]),), questionnaires=())
    with ExitStack() as stack:
        body = SharedBody(study.participant(0, SEED, effect=True))
        simulator = PupilCoreSimulator(
            body, clock=clock, seed=device_seed(SEED, 0), rate_hz=TRACKER_HZ
        )
        transport: MessageTransport
        if wire == "sockets":
            host = stack.enter_context(ZmqHost(simulator, clock))
            transport = ZmqTransport("127.0.0.1", host.port, clock, is_simulated=True)
        else:
            transport = WatchedTransport(simulator, clock)
        headset = WatchedHeadset("headset", body, clock)
        if isinstance(clock, LeapingClock) and isinstance(transport, WatchedTransport):
            headset.wire = transport
        tracker = PupilCore("eye_tracker", transport, clock, rate_hz=TRACKER_HZ)
        part = root / wire
        part.mkdir()
        recorder = stack.enter_context(
            Recorder(part, clock, threaded=True, max_batch_ns=REAL_TIME_BATCH_NS, is_simulated=True)
        )
        Session(
            SessionSetup(
                experiment=experiment,
                plan=plan,
                name=SessionName(study.name, "B01", 1, 1),
                rig=Rig(headset, tracker, {}),
                stage=GeometryStage([body]),
                recorder=recorder,
                clock=clock,
                operator=operator or UnattendedOperator(),
                respondent=body,
                judge_validation=study.judge_validation,
                participant=body,
                timing=QUICK,
            )
        ).run()
    spans = trial_spans(part)

    def in_trial(t_ns: int) -> bool:
        return any(start_ns <= t_ns < end_ns for start_ns, end_ns in spans)

    work_ms = [ms for t_ns, ms in headset.work if in_trial(t_ns)]
    return work_ms, sum(count for t_ns, count in headset.dropped if in_trial(t_ns))


def trial_spans(part: Path) -> list[tuple[int, int]]:
    """Return begin and end of the trials in a journal, session ns."""
    lines = [json.loads(line) for line in (part / "events.jsonl").read_text().splitlines()]
    rows = [line["row"] for line in lines if line.get("kind") == "trial"]
    return [(row["t_start_ns"], row["t_end_ns"]) for row in rows]


@cache
def own_work_ms(seconds: float, *, waits: bool) -> tuple[float, float]:
    """Return median and 99th percentile of a frame's work without wire and tracker.

    Frame follows frame at once, or after a wait as long as between the frames of a display.
    """
    with tempfile.TemporaryDirectory() as scratch:
        clock = LeapingClock(waits=waits)
        work_ms, _ = work_per_frame_ms("memory", seconds, Path(scratch), clock=clock)
    return float(np.median(work_ms)), float(np.percentile(work_ms, 99))


def rows_of(wire: str, seconds: float) -> list[Row]:
    """Return the figures of a session over one wire."""
    with tempfile.TemporaryDirectory() as scratch:
        work_ms, dropped = work_per_frame_ms(wire, seconds, Path(scratch))
    median_ms, p99_ms = np.percentile(work_ms, [50, 99]).tolist()
    at_once, after_waits = (own_work_ms(seconds, waits=waits) for waits in (False, True))
    median_name, p99_name = (
        f"without wire and tracker {ms:.2g} ms where frames follow at once, and after waits of 8 ms"
        for ms in at_once
    )
    return [
        Row(f"{wire}: frames measured", len(work_ms), ""),
        Row(
            f"{wire}: work per frame, median",
            median_ms,
            "ms",
            MEDIAN_LIMIT_MS,
            floor=after_waits[0],
            floor_name=median_name,
            floor_is_ours=True,
        ),
        Row(
            f"{wire}: work per frame, p99",
            p99_ms,
            "ms",
            P99_LIMIT_MS,
            floor=after_waits[1],
            floor_name=p99_name,
            floor_is_ours=True,
        ),
        Row(f"{wire}: work per frame, longest", max(work_ms), "ms"),
        Row(f"{wire}: frames dropped", dropped, ""),
    ]


def main(arguments: list[str]) -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(prog="benchmarks.frame_loop", description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="length of the scenes")
    parser.add_argument("--wire", choices=(*WIRES, "both"), default="both")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    options = parser.parse_args(arguments)
    wires = WIRES if options.wire == "both" else (options.wire,)
    rows = [row for wire in wires for row in rows_of(wire, options.seconds)]
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
