"""Send marks through our outlet and receive them with pylsl's inlet: a process of its own."""

import json
import sys

import pylsl

from visavis.devices.registry import driver_wiring
from visavis.lab.clock import NS_PER_MS, SystemClock


def main() -> None:
    clock = SystemClock()
    device = driver_wiring("lsl_triggers").on_wire(
        "triggers", clock, codes={"a": 1, "b": 255}, width_ms=1.0, source_id=f"t{sys.argv[1]}"
    )
    device.open(5.0)
    device.start(lambda batch: None)
    found = pylsl.resolve_byprop("source_id", f"t{sys.argv[1]}", timeout=20)
    inlet = pylsl.StreamInlet(found[0])
    inlet.open_stream(timeout=10)
    before = pylsl.local_clock()
    device.trigger("a", clock.now_ns())
    device.trigger("b", clock.now_ns())
    for _ in range(20):
        clock.sleep_until_ns(clock.now_ns() + NS_PER_MS)
        device.poll(0.0)
    after = pylsl.local_clock()
    samples = [inlet.pull_sample(timeout=5) for _ in range(2)]
    device.close()
    told = {
        "codes": [sample[0] for sample, _ in samples],
        "type": found[0].type(),
        "between_stamps": all(before <= stamp <= after for _, stamp in samples),
    }
    print(json.dumps(told))  # noqa: T201 - the parent reads it


if __name__ == "__main__":
    main()
