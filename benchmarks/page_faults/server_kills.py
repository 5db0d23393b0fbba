"""Kill the server of a page's session, or cut its network, around random replies.

A client keeps the page's protocol: what is not acknowledged is kept and sent again. The server's
process is killed (SIGKILL) before a reply is sent, on its way, or while it is written, and begun
anew at the same address; or the connection is closed before the acknowledgement is read.
"""

import http.client
import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.page_faults.study import (
    FAULT_EVERY,
    OPTIONS,
    Found,
    Server,
    kept_replies,
)
from visavis.lab.clock import StopWatch, SystemClock
from visavis.recording.reader import Recording
from visavis.running.page.server import KEY, LOCAL

MAX_WRITING_S: Final = 0.01
PATIENCE_S: Final = 30.0


def told_by(server: Server, path: str, body: dict[str, Any], *, reads: bool = True) -> Any:
    """Post and return what the server told; None where the answer is not waited for."""
    connection = http.client.HTTPConnection(LOCAL, server.port, timeout=PATIENCE_S)
    try:
        connection.request(
            "POST", path, json.dumps(body), {"Content-Type": "application/json", KEY: server.key}
        )
        return json.loads(connection.getresponse().read()) if reads else None
    finally:
        connection.close()


def faults_of_server(
    root: Path, kills: Found, cuts: Found, limits: tuple[int, int], rng: np.random.Generator
) -> None:
    """Perform sessions with faults until there were enough, and look through their recordings."""
    while kills.faults < limits[0] or cuts.faults < limits[1]:
        _session(root, f"S{kills.sessions + 1:03d}", kills, cuts, limits, rng)


def _session(
    root: Path,
    label: str,
    kills: Found,
    cuts: Found,
    limits: tuple[int, int],
    rng: np.random.Generator,
) -> None:
    server = Server(root, label)
    server.start()
    told = told_by(server, "/api/hello", {"tab": "t", "at_ms": 0.0, "about": {}})
    sent: dict[int, str] = {}
    acknowledged = 0
    while told["step"]["kind"] != "end":
        n, content, option = told["ack"] + 1, {}, ""
        if told["step"]["kind"] == "watch":
            option = str(rng.integers(1, OPTIONS + 1))
            given = {"option": option, "at_ms": float(n), "by": "keys"}
            content = {"shown_ms": float(n), "answers": {"answer": given}}
        sent[n] = option
        event = {
            "n": n,
            "kind": "reply",
            "at_ms": float(n),
            "step": told["number"],
            "reply": content,
        }
        body = {"tab": "t", "events": [event]}
        if rng.random() < 1 / FAULT_EVERY and kills.faults < limits[0]:
            where = int(rng.integers(3))
            if where:
                told_by(server, "/api/events", body, reads=False)
            if where == 2:
                SystemClock().sleep_until_ns(
                    SystemClock().now_ns() + round(rng.uniform(0, MAX_WRITING_S) * 1e9)
                )
            server.kill()
            kills.faults += 1
            watch = StopWatch()
            server.start()
            told = told_by(server, "/api/events", body)
            kills.resumes_s.append(watch.elapsed_s())
        else:
            if rng.random() < 1 / FAULT_EVERY and cuts.faults < limits[1]:
                told_by(server, "/api/events", body, reads=False)
                cuts.faults += 1
            told = told_by(server, "/api/events", body)
        acknowledged = told["ack"]
    server.wait()
    recording = Recording(server.path)
    told_rows = [str(a) for a in recording.trials()["answer"]]
    whole = recording.status == "complete" and told_rows == [o for o in sent.values() if o]
    kills.not_whole += not whole
    kills.look_through({n: sent[n] for n in range(1, acknowledged + 1)}, kept_replies(server.path))
    cuts.sessions += 1
