"""Run the LSL gaze driver against a real outlet, in a process of its own; prints one JSON line."""

import json
import sys

import numpy as np
import pylsl

from tests.devices import gaze_rigs
from tests.devices.bodies import FixatingBody
from tests.devices.gaze_rigs import PERFECT
from tests.devices.wire_ends.lsl_outlet import LslOutletHost
from visavis.devices.drivers.lsl.gaze import LslGaze
from visavis.devices.drivers.lsl.inlet import LslInlet
from visavis.devices.drivers.lsl.outlet import LslScope
from visavis.devices.sim.lsl.gaze import LslGazeSimulator
from visavis.lab.clock import SystemClock
from visavis.lab.geometry import angle_deg

clock = SystemClock()
name = f"gaze {sys.argv[1]}"
body = FixatingBody(5.0, 3.0)
simulator = LslGazeSimulator(body, clock=clock, seed=1, error=PERFECT, epoch_ns=clock.now_ns())
configuration = LslScope(f"test {sys.argv[1]}", machine_only=True).configuration()
inlet = LslInlet(clock, name=name, configuration=configuration)
driver = LslGaze("eyes", inlet, clock, exchange_interval_s=0.2)
pylsl.set_config_content(configuration)  # before the outlet, the first user of LSL here
with LslOutletHost(simulator, clock, name):
    driver.open(10.0)
    with gaze_rigs.pumped(driver, clock) as (pump, batches):
        gaze_rigs.step_until(clock, pump, lambda: sum(map(len, batches)) > 60)
        gaze_rigs.step_until(clock, pump, lambda: len(driver.clock_pairs()) > 1)
    values = np.concatenate([b.values for b in batches])
    device_ns = np.concatenate([b.t_device_ns for b in batches])
    made = []

    def make():
        made.append(LslGaze("eyes", LslInlet(clock, name=name), clock))
        return made[-1]

    gaze_rigs.conformance.check_batches(make, gaze_rigs.let_pass_on(clock))
    for device in made:
        device.close()
errors_deg = angle_deg(values["direction_head"].astype("f8"), body.direction)
report = {
    "error_deg": float(errors_deg.max()),
    "gaps": int((np.diff(device_ns) > 12_500_000).sum()),
    "offset_ms": driver.health().clock_offset_ms,
    "capabilities": sorted(driver.info.capabilities),
}
sys.stdout.write(f"{json.dumps(report)}\n")
