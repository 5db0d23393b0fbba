"""Read a HID eye tracker by the real hidapi until its script ends; prints one JSON line."""

import json
import sys

import numpy as np

from visavis.devices.drivers.hid_gaze.driver import HidGaze
from visavis.devices.drivers.hid_gaze.reports import HidReports
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.errors import DeviceDisconnected

wanted = int(sys.argv[1])
clock = SystemClock()
driver = HidGaze("eyes", HidReports("", clock), clock)
driver.open(10.0)
batches = []
driver.start(batches.append)
deadline_ns = clock.now_ns() + 20 * NS_PER_S
end = "deadline"
while sum(map(len, batches)) < wanted and clock.now_ns() < deadline_ns:
    try:
        driver.poll(0.05)
    except DeviceDisconnected as gone:
        end = str(gone)
        break
else:
    end = "all"
faults = [fault.message for fault in driver.check()]
driver.close()
directions = np.concatenate([batch.values["direction_head"] for batch in batches])
stamps_ns = np.concatenate([batch.t_device_ns for batch in batches])
report = {
    "end": end,
    "count": len(directions),
    "steps_ms": (np.diff(stamps_ns) / 1e6).tolist(),
    "direction": directions[-1].tolist(),
    "serial": driver.info.serial,
    "model": driver.info.model,
    "transport": driver.info.transport,
    "faults": faults,
}
sys.stdout.write(f"{json.dumps(report)}\n")
