"""Send numbers and texts by pylsl's own outlets and record them by our driver; prints JSON.

The first argument is a tag in the streams' names, so that runs side by side do not meet.
"""

import json
import sys
import threading

import numpy as np
import pylsl

from tests.devices.bodies import FixatingBody
from tests.devices.wire_ends.lsl_outlet import copy_description
from visavis.devices.drivers.lsl.inlet import LslInlet
from visavis.devices.drivers.lsl.stream import LslStream
from visavis.devices.sim.lsl.stream import LslStreamSimulator
from visavis.lab.clock import NS_PER_MS, SystemClock

clock = SystemClock()
tag = sys.argv[1]
simulator = LslStreamSimulator(FixatingBody(), clock=clock, seed=1)
info = pylsl.StreamInfo(f"eeg {tag}", "EEG", 3, 250.0, pylsl.cf_float32, f"amp {tag}")
copy_description(simulator.desc(), info.desc())
numbers = pylsl.StreamOutlet(info)
marks = pylsl.StreamOutlet(
    pylsl.StreamInfo(f"marks {tag}", "Markers", 1, 0.0, pylsl.cf_string, f"marks {tag}")
)
sent_s = []
stopping = threading.Event()


def send():
    i = 0
    while not stopping.is_set():
        stamp_s = pylsl.local_clock()
        sent_s.append(stamp_s)
        numbers.push_sample([i, -i, 0.5], stamp_s)
        if i % 50 == 0:
            marks.push_sample([f"stimulus {i} ä"], stamp_s)
        i += 1
        clock.sleep_until_ns(clock.now_ns() + 4 * NS_PER_MS)


sender = threading.Thread(target=send, daemon=True)
sender.start()
found = {}
for role, name, kind in (("eeg", f"eeg {tag}", "EEG"), ("marks", f"marks {tag}", "Markers")):
    driver = LslStream(
        role, LslInlet(clock, name=name, content_type=kind), clock, exchange_interval_s=0.1
    )
    driver.open(10.0)
    batches = []
    driver.start(batches.append)
    end_ns = clock.now_ns() + 600 * NS_PER_MS
    while clock.now_ns() < end_ns:
        driver.poll(0.05)
    values = np.concatenate([b.values for b in batches])
    (schema,) = driver.describe()
    stamps_ns = np.concatenate([b.t_device_ns for b in batches])
    found[role] = {
        "fields": [[f.name, f.unit] for f in schema.fields],
        "stamped_as_sent": bool(np.isin(stamps_ns, [round(s * 1e9) for s in sent_s]).all()),
        "first": values[0].tolist(),
        "pairs": len(driver.clock_pairs()),
        "faults": [f.message for f in driver.check()],
    }
    if role == "marks":
        found[role]["first"] = bytes(values["text"][0]).rstrip(b"\0").decode()
    driver.close()
stopping.set()
sender.join()
sys.stdout.write(json.dumps(found))
