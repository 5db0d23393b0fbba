"""Time a simulated session of the crowd study, and from contact to command within it.

    python -m benchmarks.crowd_session [--configurations 8] [--real-time] [--json]

Plan, simulated wires of headset, eye tracker, body tracker and four bands, recorder and all. The
CPU time of the whole session is printed beside the limit for 24 walks; with fewer configurations
it is extrapolated by the walks performed (three per configuration and the practice). The first
session of a process loads compiled kernels; a short one before the clock starts does that.

On the virtual clock computing takes no time: there the delay tells that no frame lies between
contact and command. `--real-time` performs four walks of 20 s on the system's clock and times what
passes there; other programs on the machine count.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from visavis.cli.app import load_lab
from visavis.experiments.crowd.pulses import pulse_rows
from visavis.lab.clock import Clock, SystemClock, cpu_time_s
from visavis.lab.config_files import EXAMPLE
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

LIMIT_S = 60.0
LIMIT_SENT_MS = 5.0
WALKS = 25


def one_session(folder: Path, clock: Clock | None = None, **parameters: float) -> Recording:
    """Simulate one session of participant 0 and return its recording."""
    study = find_study("crowd")
    config = load_lab(EXAMPLE, quiet=True).model_copy(update={"data_root": folder})
    request = simulated_request(
        study, study.experiment(parameters), config, label="B01", index=0, seed=1, effect=True
    )
    return Recording(perform_new(request if clock is None else replace(request, clock=clock)))


def sent_after_ms(recording: Recording) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return from contact to command on the wire for every pulse that left."""
    sent = [p["sent_ms"] for p in pulse_rows(recording) if p["sent_ms"] is not None]
    return np.array(sent, float)


def in_real_time(folder: Path) -> dict[str, float]:
    """Perform a short session on the system's clock; return how soon contact was answered."""
    sent_ms = sent_after_ms(one_session(folder, SystemClock(), configurations=1, limit_s=20.0))
    return {
        "real_time_pulses": len(sent_ms),
        "real_time_contact_to_sent_median_ms": float(np.median(sent_ms)),
        "real_time_contact_to_sent_95_percent_ms": float(np.percentile(sent_ms, 95)),
        "real_time_contact_to_sent_worst_ms": float(sent_ms.max()),
    }


def main() -> None:
    """Print what a session takes and how soon contact was answered."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--configurations", type=int, default=8)
    parser.add_argument("--real-time", action="store_true")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        one_session(Path(scratch) / "warm", configurations=1, limit_s=2.0)
        begun_s = cpu_time_s()
        recording = one_session(Path(scratch) / "timed", configurations=chosen.configurations)
        cpu_s = cpu_time_s() - begun_s
        trials = recording.trials()
        pulses = pulse_rows(recording)
        sent_ms = sent_after_ms(recording)
        real = in_real_time(Path(scratch) / "real") if chosen.real_time else {}
    walked_s = float(((trials["t_end_ns"] - trials["t_start_ns"]) / 1e9).sum())
    found = {
        "walks": len(trials),
        "walk_s": walked_s / len(trials),
        "cpu_per_walk_s": cpu_s / len(trials),
        "cpu_of_24_walks_and_practice_s": cpu_s / len(trials) * WALKS,
        "pulses": len(pulses),
        "pulses_unacknowledged": sum(not p["acknowledged"] for p in pulses),
        "contact_to_sent_median_ms": float(np.median(sent_ms)),
        "contact_to_sent_worst_ms": float(sent_ms.max()),
        **real,
    }
    if chosen.json:
        print(json.dumps(found))
        return
    for name, value in found.items():
        print(f"{name:<40} {value:10.3f}")
    kept = found["cpu_of_24_walks_and_practice_s"] <= LIMIT_S
    print(f"session limit {LIMIT_S:.0f} s of CPU: {'kept' if kept else 'MISSED'}")
    kept = found["contact_to_sent_worst_ms"] < LIMIT_SENT_MS
    print(f"contact to command limit {LIMIT_SENT_MS:.0f} ms: {'kept' if kept else 'MISSED'}")


if __name__ == "__main__":
    main()
