"""Send a few samples through LSL on this machine and print what an inlet received, as JSON."""

import json
import sys

import numpy as np
import pylsl

from visavis.devices.contracts import GAZE, body_schema
from visavis.devices.drivers.lsl.body import LslBody
from visavis.devices.drivers.lsl.inlet import LslInlet
from visavis.devices.drivers.lsl.outlet import LslOutlets, LslScope
from visavis.lab.clock import SystemClock
from visavis.lab.schema import SampleBatch, empty_values

clock = SystemClock()
body = body_schema(("head", "left_hand"), 60.0)
outlets = LslOutlets(
    {"eye_tracker": (GAZE,), "body_tracker": (body,)},
    LslScope(f"visavis-test-{sys.argv[1]}", machine_only=True),
    clock,
    source="study-P01-001",
    is_simulated=True,
    offset_of=lambda role: 1_000_000_000,
)
found = pylsl.resolve_byprop("name", "visavis eye_tracker gaze", timeout=10)
marks = pylsl.resolve_byprop("name", "visavis events", timeout=10)
inlet, events = pylsl.StreamInlet(found[0]), pylsl.StreamInlet(marks[0])
inlet.open_stream(timeout=10)
events.open_stream(timeout=10)
info = inlet.info(timeout=10)
values = empty_values(GAZE, 5)
values["direction_head"] = [0.6, 0.0, -0.8]
values["left_pupil_mm"] = np.nan
t_ns = clock.now_ns() + np.arange(-5, 0) * 8_000_000
batch = SampleBatch(GAZE, np.arange(5), t_ns - 1_000_000_000, t_ns + 3_000_000, values)
outlets.take("eye_tracker", batch)
outlets.event("trial_start", int(t_ns[0]), trial_id="T01")
rows, stamps = [], []
while len(rows) < 5:
    row, stamp = inlet.pull_sample(timeout=10)
    rows.append([None if x != x else x for x in row])
    stamps.append(stamp)
text, mark = events.pull_sample(timeout=10)
suit = LslBody(
    "body",
    LslInlet(clock, name="visavis body_tracker body", content_type="MoCap"),
    clock,
    objects={"left_hand": "left_hand"},
)
suit.open(20.0)
batches = []
suit.start(batches.append)
moves = empty_values(body, 1)
moves["position_m"] = [[[0.0, 1.6, 0.0], [-0.5, 1.25, -0.25]]]
moves["orientation_wxyz"] = [1.0, 0.0, 0.0, 0.0]
moves["valid"] = True
now = np.array([clock.now_ns()])
outlets.take("body_tracker", SampleBatch(body, np.arange(1), now, now, moves))
while not batches:
    suit.poll(1.0)
suit.close()
outlets.close()
sys.stdout.write(
    json.dumps(
        {
            "type": info.type(),
            "xml": info.as_xml(),
            "rows": rows,
            "late_ms": [(s - t / 1e9) * 1e3 for s, t in zip(stamps, t_ns.tolist(), strict=True)],
            "event": text[0],
            "event_late_ms": (mark - int(t_ns[0]) / 1e9) * 1e3,
            "difference_ms": outlets.clock_difference_ns / 1e6,
            "body": batches[0].values["position_m"][0].tolist(),
            "body_valid": batches[0].values["valid"][0].tolist(),
            "session": info.session_id(),
        }
    )
)
