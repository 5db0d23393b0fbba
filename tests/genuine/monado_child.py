"""One scenario on Monado in a process of its own, since a runtime may take it along.

    python -m tests.genuine.monado_child SCENARIO

Prints JSON. Some scenarios ask for the end and the start of the service by a line each
(`tests.genuine.monado.call`).
"""

import json
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tests.faults.sessions import lab, request
from tests.genuine.monado import Remote, call
from tests.genuine.whole_sessions import WHOLE, on_monado
from visavis.analysis.frame_times import PoseAge, heads_of, pose_age
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.openvr.headset import OpenVrHeadset
from visavis.devices.drivers.openvr.library import OpenVrLibrary
from visavis.devices.drivers.openxr.headset import OpenXrHeadset
from visavis.devices.drivers.openxr.library import OpenXrLibrary
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.errors import DeviceError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import quat_from_yaw_pitch_deg
from visavis.protocol.session.operator import Action, Command, UnattendedOperator
from visavis.recording.journal import as_json
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new
from visavis.stage.window import Window

PLACES = (((0.0, 1.6, 0.0), 0.0), ((0.25, 1.5, -0.5), 40.0), ((-1.0, 1.2, 0.75), -75.0))
FRAMES = 60
CLOCK = SystemClock()


def wait_s(seconds: float) -> None:
    """Let the runtime take what was set."""
    CLOCK.sleep_until_ns(CLOCK.now_ns() + round(seconds * NS_PER_S))


class Run:
    """The headset's driver on Monado, with or without pictures."""

    def __init__(self, *, shows: bool, over_openvr: bool = False) -> None:
        self.window = Window("Visavis", (64, 64)) if shows else None
        self.textures: Sequence[Any] = ()
        if self.window is not None:
            context = self.window.context
            self.textures = [context.texture((64, 64), 4, bytes(64 * 64 * 4)) for _ in (0, 1)]
        self.headset: OpenXrHeadset | OpenVrHeadset
        if over_openvr:
            library = OpenVrLibrary(CLOCK, application="scene")
            self.headset = OpenVrHeadset("headset", library.transport(), CLOCK)
        else:
            self.headset = OpenXrHeadset("headset", OpenXrLibrary(CLOCK).transport(), CLOCK)
            if shows:
                self.headset.show_images()
        self.batches: list[Any] = []
        self.headset.open(10.0)
        self.headset.start(self.batches.append)

    def frames(self, n: int) -> list[Any]:
        """Perform frames as the session's loop does."""
        frames = []
        for _ in range(n):
            frames.append(self.headset.wait_frame())
            try:
                self.headset.submit(frames[-1], self.textures)
                self.headset.poll(0.0)
            except DeviceError:
                continue  # it is away
        return frames

    def last(self, stream: str) -> Any:
        """Return the last row of a stream."""
        return [b for b in self.batches if b.schema.name == stream][-1].values[-1]

    def close(self) -> None:
        """End it as a session does: the stage outlives the devices."""
        self.headset.close()
        if self.window is not None:
            self.window.close()


def poses(*, shows: bool, over_openvr: bool = False) -> dict[str, Any]:
    """Return how far poses are from where the head was put, and what the frames were like."""
    remote = Remote()
    run = Run(shows=shows, over_openvr=over_openvr)
    apart_m, apart = [], []
    frames = []
    for place, yaw_deg in PLACES:
        w, x, y, z = quat_from_yaw_pitch_deg(yaw_deg)
        remote.put_head(place, (x, y, z, w))
        wait_s(0.1)
        frames += run.frames(FRAMES)
        for stream in ("head", "head_measured"):
            row = run.last(stream)
            apart_m.append(float(np.abs(row["position_m"] - place).max()))
            dot = float(abs(row["orientation_wxyz"] @ np.array([w, x, y, z])))
            apart.append(1 - dot)
    result = {
        "state": run.headset.state.value,
        "faults": [f.message for f in run.headset.check()],
        "runtime": run.headset.info.model,
        "apart_m": max(apart_m),
        "apart": max(apart),
        "period_ms": float(np.median(np.diff([f.t_ns for f in frames])) / 1e6),
        "ahead_ms": float(np.median([f.predicted_display_ns - f.t_ns for f in frames]) / 1e6),
    }
    result["pose_age"] = as_json(age_of(run, frames))
    run.close()
    remote.close()
    return result


def age_of(run: Run, frames: Sequence[FrameInfo]) -> PoseAge:
    """Return the age of the pictures' heads by the runtime's own stamps."""
    described_ns, handed_ns = heads_of(run.batches)
    light_of = {frame.t_ns: frame.predicted_display_ns for frame in frames}
    rows = [i for i, at_ns in enumerate(handed_ns.tolist()) if at_ns in light_of]
    light_ns = np.array([light_of[int(handed_ns[i])] for i in rows], np.int64)
    return pose_age(described_ns[rows], handed_ns[rows], light_ns)


def knob() -> dict[str, Any]:
    """Return the distance of the views after the eyes were moved."""
    remote = Remote()
    remote.put_eyes(0.058)
    wait_s(0.3)
    run = Run(shows=True)

    def apart_mm() -> float:
        run.frames(30)
        left, right = run.headset.eye_views()
        return 1000 * (right.offset_m[0] - left.offset_m[0])

    first = apart_mm()
    remote.put_eyes(0.070)
    wait_s(0.3)
    result = {
        "first": first,
        "then": apart_mm(),
        "faults": [f.message for f in run.headset.check()],
    }
    run.close()
    return result


def killed() -> dict[str, Any]:
    """Return the states before, during and after the service was away."""
    run = Run(shows=True)
    run.frames(30)
    states = [run.headset.state.value]
    for word in ("kill", "start"):
        call(word)
        end_ns = CLOCK.now_ns() + (3 if word == "kill" else 20) * NS_PER_S
        while CLOCK.now_ns() < end_ns:
            run.frames(10)
            if word == "start" and run.headset.state is DeviceState.STREAMING:
                break
        states.append(run.headset.state.value)
    run.frames(60)
    result = {"states": states, "valid": bool(run.last("head")["valid"])}
    run.close()
    return result


def session(ending: str) -> dict[str, Any]:
    """Perform a short session whose headset is Monado's; return what became of its recording."""

    def terminate(*_: object) -> None:
        raise SystemExit(143)

    signal.signal(signal.SIGTERM, terminate)  # as `visavis` does
    data_root = Path(os.environ["XDG_CONFIG_HOME"]) / ending
    config = on_monado(lab(data_root), shows=True)

    class Ended(UnattendedOperator):
        """Ends the session some seconds after its first frame, in one of the usual ways."""

        end_ns = 0

        def poll(self) -> Sequence[Command]:
            """Wait for the moment."""
            self.end_ns = self.end_ns or CLOCK.now_ns() + 3 * NS_PER_S
            if CLOCK.now_ns() < self.end_ns:
                return ()
            if ending == "abort":
                return (Command(Action.ABORT),)
            os.kill(os.getpid(), {"sigterm": signal.SIGTERM, "ctrl-c": signal.SIGINT}[ending])
            return ()

    made = replace(request(config, Ended(), trial_s=0.5), clock=CLOCK)
    problem = ""
    try:
        perform_new(made)
    except BaseException as error:
        problem = type(error).__name__
    recording = Recording(next(data_root.glob("simulated/*/sub-*/ses-001")))
    timing = recording.stream_arrays("frame_timing")
    return {
        "problem": problem,
        "status": recording.status,
        "problems": list(recording.part_problems(1)),
        "shown": int((timing["t_submitted_ns"] >= 0).sum()),
        "beyond_ms": float(
            np.nanmax(np.append(recording.stream_arrays("gaze_targets")["head_beyond_ms"], 0.0))
        ),
    }


SCENARIOS: Mapping[str, Callable[[], dict[str, Any]]] = {
    **WHOLE,
    **{ending: partial(session, ending) for ending in ("abort", "sigterm", "ctrl-c")},
    "headless": lambda: poses(shows=False),
    "pictures": lambda: poses(shows=True),
    "openvr": lambda: poses(shows=True, over_openvr=True),
    "knob": knob,
    "killed": killed,
}

if __name__ == "__main__":
    sys.stdout.write(json.dumps(SCENARIOS[sys.argv[1]]()) + "\n")
