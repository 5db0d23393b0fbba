"""Measure how far gaze in the world is off while the head turns and the eyes stay on a target.

    python -m benchmarks.gaze_while_turning [--look-ahead-ms MS] [--json]

A head turns to and fro, steadily but for the moments in which it turns round; its eyes hold a point
of the world without any error, and the tracker has none of its own. Each headset and each source
of gaze is the driver of Visavis on its simulated wire; the session's own frame loop puts them
together. The headset foresees the head for the light of its frames (`--look-ahead-ms`; otherwise
as the simulator does: 11 ms `simulated_headset`, 22 ms the runtimes). Printed is the 95th
percentile of the angle between gaze in the world and the target; the turns round are left out, as
they are not what is asked. A source that does not tell its clock is given its own delay, as a lab
measures it (`gaze_delay_ms`). "Ratio" is limit / value.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any, cast
from unittest import mock

import numpy as np
import numpy.typing as npt

from benchmarks.table import Row, show
from visavis.devices.contracts import EYES_DTYPE, EyeTracker, Headset, OneStretch
from visavis.devices.registry import driver_spec, driver_wiring
from visavis.devices.sim.gaze.tracker_error import TrackerErrorModel
from visavis.devices.wiring import Site
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.geometry import Vector, angle_deg, quat_conjugate, quat_from_yaw_pitch_deg, rotate
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.protocol.session.rig import Rig, RunningRig
from visavis.protocol.session.states import StateMachine
from visavis.recording.writer import Recorder
from visavis.results.opened_study import find_study
from visavis.stage.contracts import GeometryStage

HEADSETS = ("simulated_headset", "openvr_headset", "openxr_headset")
LATENCY_MS = 12.0
ONE_WAY: Mapping[str, Any] = {"gaze_delay_ms": LATENCY_MS}
"""Options of trackers that do not tell what their clock shows."""
SOURCES: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "pupil_core": ("pupil_core", {}),
    "neon": ("neon", {}),
    "fove": ("fove", ONE_WAY),
    # its stamps are whole milliseconds, at 120 Hz a third of one too early on average
    "vive_pro_eye": ("vive_pro_eye", {"gaze_delay_ms": LATENCY_MS - 1 / 3}),
    "varjo": ("varjo", {}),
    "lsl_gaze": ("lsl_gaze", {}),
    "openxr_gaze": ("openxr_gaze", {}),
    "openxr_gaze (htc)": ("openxr_gaze", {"per_eye": "htc"}),
    "openxr_gaze (meta)": ("openxr_gaze", {"per_eye": "meta"}),
}
"""Driver and options by name; trackers before a screen are not worn with a headset."""
SPEEDS_DEG_S = (0.0, 50.0, 100.0, 150.0)
LIMIT_DEG = 0.1
HALF_TURN_S = 0.5
ROUND_S = 0.12
"""How long after the head turned round gaze is left out."""
SECONDS = 4.0
SETTLED_NS = NS_PER_S
TARGET_M = np.array([0.0, 1.2, -4.0])
EYE_X_M = np.array([0.032, 0.0, 0.0])
PERFECT = TrackerErrorModel(
    offset_deg=0,
    eye_offset_deg=0,
    gain_sd_01=0,
    white_deg=0,
    slow_deg=0,
    latency_ms=LATENCY_MS,
    latency_jitter_ms=0,
)


class TurningHead(OneStretch):
    """A head that turns to and fro about the straight line to a target which its eyes hold."""

    def __init__(self, deg_per_s: float) -> None:
        self._deg_per_s = deg_per_s
        self.target_m = TARGET_M

    def since_turned_round_s(self, t_ns: npt.NDArray[np.int64]) -> Vector:
        """Return how long ago the head turned round last."""
        since_s: Vector = (t_ns / NS_PER_S) % HALF_TURN_S
        return since_s

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return where the head is."""
        cycle = (t_ns / NS_PER_S) % (2 * HALF_TURN_S)
        turned_s = min(cycle, 2 * HALF_TURN_S - cycle) - HALF_TURN_S / 2
        turn = quat_from_yaw_pitch_deg(self._deg_per_s * turned_s)
        return np.array([0.0, 1.2, 0.0]), turn

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return both eyes on the target."""
        eyes = np.zeros(t_ns.size, EYES_DTYPE)
        for i, at_ns in enumerate(t_ns.tolist()):
            place_m, turn = self.head(at_ns)
            target = rotate(quat_conjugate(turn), self.target_m - place_m)
            for name, eye_m in (("left", -EYE_X_M), ("right", EYE_X_M)):
                ray = target - eye_m
                eyes[f"{name}_direction_head"][i] = ray / np.linalg.norm(ray)
        eyes["openness_01"], eyes["pupil_mm"] = 1.0, 3.5
        return eyes


class _Rows:
    """Take the rows of one stream, as the recorder would."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.batches: list[SampleBatch] = []

    def declare(self, schema: StreamSchema) -> None:
        """Know the stream."""

    def append(self, batch: SampleBatch) -> None:
        """Keep a batch of it."""
        if batch.schema.name == self._name:
            self.batches.append(batch)

    def event(self, name: str, t_ns: int, **payload: object) -> None:
        """Keep nothing."""


def errors_deg(
    headset: str, source: str, deg_per_s: float, look_ahead_ms: float | None = None
) -> Vector:
    """Return the angles (n,) between gaze in the world and the target, turns round left out."""
    clock, body = SimClock(), TurningHead(deg_per_s)
    rows = _Rows("gaze_targets")
    with ExitStack() as stack:
        for module in ("gaze.source", "pupil.capture"):
            where = f"visavis.devices.sim.{module}.TrackerErrorModel"
            stack.enter_context(mock.patch(where, return_value=PERFECT))
        shared: dict[str, Any] = {}

        def made(name: str, role: str, options: Mapping[str, Any]) -> Any:
            spec, wiring = driver_spec(name), driver_wiring(name)
            checked = spec.checked_options(role, options)
            site = Site(spec, role, clock, checked, body=body, shared=shared, stack=stack)
            simulated = cast("Callable[[Any], Any]", wiring.simulated)
            return wiring.make(site, simulated(site))

        ahead = {} if look_ahead_ms is None else {"look_ahead_ms": look_ahead_ms}
        display: Headset = made(headset, "headset", ahead)
        driver, gaze_options = SOURCES[source]
        tracker: EyeTracker = made(driver, "eye_tracker", gaze_options)
        loops: list[FrameLoop] = []
        with RunningRig(
            Rig(display, tracker, {}), clock, lambda role, batch: loops[0].sink(role, batch)
        ) as rig:
            experiment = find_study("stare").experiment({})
            loops.append(
                FrameLoop(
                    experiment,
                    rig,
                    rig.headset.display_rate_hz,
                    rig.gaze_rate_hz,
                    (),
                    GeometryStage(),
                    cast("Recorder", rows),
                    clock,
                    StateMachine(),
                )
            )
            (loop,) = loops
            rig.start()
            loop.show_scene(experiment.blank(None))
            end_ns = clock.now_ns() + round(SECONDS * NS_PER_S)
            is_dated = False
            while loop.t_ns < end_ns:
                loop.next()
                if not is_dated and loop.t_ns > SETTLED_NS:  # as a trial begins
                    loop.observer.align(tracker.clock_pairs())
                    is_dated = True
            loop.flush()
    values = np.concatenate([batch.values for batch in rows.batches])
    values = values[values["valid"]]
    is_steady = body.since_turned_round_s(values["t_sample_ns"]) > ROUND_S
    values = values[is_steady & (values["t_sample_ns"] > SETTLED_NS)]
    truth = TARGET_M - values["origin_world_m"].astype(np.float64)
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    return angle_deg(values["direction_world"].astype(np.float64), truth)


def rows_of(headset: str, look_ahead_ms: float | None) -> list[Row]:
    """Return a headset's row for every source and speed."""
    rows = []
    for source in SOURCES:
        for deg_per_s in SPEEDS_DEG_S:
            p95_deg = float(
                np.percentile(errors_deg(headset, source, deg_per_s, look_ahead_ms), 95)
            )
            name = f"{headset}, {source}, {deg_per_s:g} deg/s"
            rows.append(Row(name, p95_deg, "deg", LIMIT_DEG))
    return rows


def main(arguments: list[str]) -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(prog="benchmarks.gaze_while_turning", description=__doc__)
    parser.add_argument("--look-ahead-ms", type=float, help="how far the headset foresees")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    options = parser.parse_args(arguments)
    rows = [row for headset in HEADSETS for row in rows_of(headset, options.look_ahead_ms)]
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
