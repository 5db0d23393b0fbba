"""Let many simulated participants come to a served study at once, and time every step they take.

    python -m benchmarks.page_crowd [--people N] [--trials N] [--json]

`visavis serve` runs in a process of its own, as in a lab; people come within a few seconds, think
for a second or so before each answer, and are acknowledged once their answer is on the disk. A step
is timed from sending an answer to having the next step. Exits with 1 where p99 is 100 ms or more,
where a session is not whole, or where an answer is missing.
"""

import argparse
import asyncio
import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np

from visavis.lab.clock import StopWatch
from visavis.recording.reader import Recording
from visavis.running.page.server import KEY, LOCAL

STUDY = """
from visavis import Factor, Rating, Study

study = Study("many", factors=[Factor("place", list(range({trials})))], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.ask(Rating("answer", 1, 9))
"""
MAX_P99_MS = 100.0
COME_WITHIN_S = 10.0
THINK_S = (0.4, 1.6)


async def person(base: str, rng: np.random.Generator, steps_ms: list[float]) -> None:
    """Come, answer every step after a thought, and time it."""
    await asyncio.sleep(rng.uniform(0, COME_WITHIN_S))
    async with aiohttp.ClientSession(base) as http:

        async def post(path: str, body: Any, key: str = "") -> Any:
            async with http.post(path, json=body, headers={KEY: key}) as response:
                told = await response.json()
                assert response.status == 200, told
                return told

        arrived = await post("/api/arrive", {"parameters": {}})
        key, watch = arrived["key"], StopWatch()
        told = await post("/api/hello", {"tab": "t", "at_ms": 0.0, "about": {}}, key)
        while (step := told["step"])["kind"] != "end":
            await asyncio.sleep(rng.uniform(*THINK_S))
            at_ms = 1000 * watch.elapsed_s()
            reply: dict[str, Any] = {}
            if step["kind"] == "watch":
                reply = {
                    "shown_ms": at_ms,
                    "off_ms": at_ms,
                    "hidden_ms": 0.0,
                    "films": {},
                    "answers": {
                        q["name"]: {"option": "5", "at_ms": at_ms, "by": "keys"}
                        for q in step["questions"]
                    },
                }
            event = {
                "n": told["ack"] + 1,
                "kind": "reply",
                "at_ms": at_ms,
                "step": told["number"],
                "reply": reply,
            }
            sent = StopWatch()
            told = await post("/api/events", {"tab": "t", "events": [event]}, key)
            steps_ms.append(1000 * sent.elapsed_s())


async def crowd(base: str, people: int) -> list[float]:
    """Let everybody come; return the milliseconds of all steps."""
    steps_ms: list[float] = []
    streams = np.random.default_rng(1).spawn(people)
    await asyncio.gather(*(person(base, rng, steps_ms) for rng in streams))
    return steps_ms


def main() -> int:
    """Run it and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--people", type=int, default=50)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "many.py").write_text(STUDY.format(trials=options.trials), encoding="utf-8")
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        command = "from visavis.cli.main import main; main()"
        subprocess.run(
            [sys.executable, "-c", command, "init"],
            cwd=root,
            check=True,
            env=environment,
            stdout=subprocess.DEVNULL,
        )
        server = subprocess.Popen(
            [
                sys.executable,
                "-c",
                command,
                "serve",
                "./many.py",
                "--port",
                "0",
                "--devices",
                "sim",
            ],
            cwd=root,
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert server.stdout is not None
        base = ""
        for line in server.stdout:
            if "/board#" in line:
                base = line.strip().partition("/board#")[0]
                break
        assert base.startswith(f"http://{LOCAL}:"), "the server told no address"
        cpu_before = os.times()
        steps_ms = asyncio.run(crowd(base, options.people))
        used = os.times()
        server.send_signal(signal.SIGINT)
        server.wait(timeout=60)
        sessions = sorted(root.glob("**/ses-001/manifest.json"))
        whole = [Recording(p.parent) for p in sessions]
        done = sum(r.status == "complete" for r in whole)
        answers = sum(len(r.trials()) for r in whole)
    p50, p99 = np.percentile(steps_ms, [50, 99])
    told = {
        "people": options.people,
        "steps": len(steps_ms),
        "p50_ms": round(float(p50), 1),
        "p99_ms": round(float(p99), 1),
        "worst_ms": round(max(steps_ms), 1),
        "sessions_complete": done,
        "answers": answers,
        "client_cpu_s": round(used.user - cpu_before.user, 1),
    }
    sys.stdout.write(
        json.dumps(told) + "\n"
        if options.json
        else "\n".join(f"{name:20} {value}" for name, value in told.items()) + "\n"
    )
    is_fine = p99 < MAX_P99_MS and done == options.people
    return 0 if is_fine and answers == options.people * options.trials else 1


if __name__ == "__main__":
    raise SystemExit(main())
