"""Listen by the genuine sounddevice while a tone is played to a sound server's speakers.

Prints a line of JSON: the session times at which the player was started and had ended, and what the
voice key delivered (session time, 1 pressed or 0 released).
"""

import json
import subprocess
import sys

import numpy as np

from visavis.devices.registry import driver_wiring
from visavis.lab.clock import NS_PER_S, SystemClock

RATE_HZ = 48_000
TONE_S = 0.5
PLAYER = ["pacat", "-d", "ears", "--format=float32le", "--channels=1", f"--rate={RATE_HZ}"]


def listen() -> dict[str, object]:
    """Return what the key delivered over five seconds, with a tone after two."""
    clock = SystemClock()
    key = driver_wiring("voice_key").on_wire("responses", clock, device="pulse")
    rows: list[tuple[int, float]] = []
    key.open(5.0)
    key.start(
        lambda b: rows.extend(zip(b.t_host_ns.tolist(), b.values["value_01"].tolist(), strict=True))
    )
    tone = 0.3 * np.sin(2 * np.pi * 600 * np.arange(round(TONE_S * RATE_HZ)) / RATE_HZ)
    began_ns = clock.now_ns()
    player_ns: list[int] = []
    while clock.now_ns() - began_ns < 5 * NS_PER_S:
        key.poll(0.02)
        if not player_ns and clock.now_ns() - began_ns > 2 * NS_PER_S:
            player = [*PLAYER, "--latency-msec=20"]
            player_ns.append(clock.now_ns())
            subprocess.run(player, input=tone.astype("<f4").tobytes(), check=True)
            player_ns.append(clock.now_ns())
    faults = [fault.message for fault in key.check()]
    key.close()
    return {"player_ns": player_ns, "rows": rows, "faults": faults}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(listen()))
