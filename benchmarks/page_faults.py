"""Kill the server of a study on a page and cut its network, again and again; count what is lost.

    python -m benchmarks.page_faults [--kills N] [--cuts N] [--json]

A client keeps the page's protocol: what is not acknowledged is kept and sent again. Around random
replies the server's process is killed (SIGKILL), before the reply is sent, on its way, or while it
is written, and begun anew at the same address; or the connection is closed before the
acknowledgement is read. Every acknowledged reply must be in the recording once, with the answer
that was given, and every session must end whole. Exits with 1 where anything is lost.
"""

import argparse
import http.client
import json
import os
import signal
import sys
import tempfile
import traceback
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lab.clock import StopWatch, SystemClock
from lab.errors import RecordingError
from protocol.operator import UnattendedOperator
from recording.folder import session_dir
from recording.reader import Recording
from tests.faults.sessions import lab
from visavis.catalogue import find_study
from visavis.page.server import KEY, LOCAL
from visavis.sessions.perform import PageAddress, Request, perform_new, perform_rest

STUDY = """
from visavis import Factor, Rating, Study

study = Study("faults", factors=[Factor("number", list(range(24)))], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.ask(Rating("answer", 1, 9))
"""
FAULT_EVERY = 3
"""Faults come with one reply in so many."""
MAX_WRITING_S = 0.01
MAX_RESUME_S = 2.0
PATIENCE_S = 30.0


@dataclass
class Found:
    """What came of it."""

    kills: int = 0
    cuts: int = 0
    sessions: int = 0
    acknowledged: int = 0
    lost: int = 0
    twice: int = 0
    not_whole: int = 0
    resumes_s: list[float] = field(default_factory=list)


class Server:
    """A server process that is killed and begun anew."""

    def __init__(self, root: Path, label: str) -> None:
        self._root, self._label = root, label
        self.path = session_dir(root, "faults", label, 1, is_simulated=True)
        self._pid = 0
        self.key, self.port = "", 0

    def start(self) -> None:
        """Begin or go on with the session, and wait until its address is known."""
        read, write = os.pipe()
        self._pid = os.fork()
        if self._pid == 0:
            status = 1
            try:
                os.close(read)
                self._serve(write)
                status = 0
            except Exception:  # of the forked process: told here, and by its status
                traceback.print_exc()
            finally:
                os._exit(status)
        os.close(write)
        with os.fdopen(read) as told:
            base, _, self.key = told.readline().strip().partition("/#")
        self.port = int(base.rpartition(":")[2])

    def kill(self) -> None:
        """Kill the process."""
        os.kill(self._pid, signal.SIGKILL)
        os.waitpid(self._pid, 0)

    def wait(self) -> None:
        """Wait until it has ended by itself.

        Raises:
            RecordingError: it ended with an error, which it has printed.
        """
        _, status = os.waitpid(self._pid, 0)
        if status != 0:
            raise RecordingError(f"the server of {self._label} ended with an error, printed above")

    def _serve(self, write: int) -> None:
        def tell(address: str) -> None:
            os.write(write, f"{address}\n".encode())

        study = find_study(str(self._root / "faults.py"))
        request = Request(
            study=study, experiment=study.experiment({}), config=lab(self._root),
            participant_label=self._label, participant_index=0, group="", session=1, seed=1,
            clock=SystemClock(), operator=UnattendedOperator(),
            page=PageAddress(0, tell),
        )  # fmt: skip
        if self.path.exists():
            perform_rest(request, self.path)
        else:
            perform_new(request)


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


def one_session(
    root: Path, label: str, found: Found, limits: tuple[int, int], rng: np.random.Generator
) -> None:
    """Perform one session with faults, and look through its recording."""
    server = Server(root, label)
    server.start()
    told = told_by(server, "/api/hello", {"tab": "t", "at_ms": 0.0, "about": {}})
    sent: dict[int, str] = {}
    acknowledged = 0
    while told["step"]["kind"] != "end":
        n, content, option = told["ack"] + 1, {}, ""
        if told["step"]["kind"] == "watch":
            option = str(rng.integers(1, 10))
            given = {"option": option, "at_ms": float(n), "by": "keys"}
            content = {"shown_ms": float(n), "answers": {"answer": given}}
        sent[n] = option
        event = {"n": n, "kind": "reply", "at_ms": float(n), "step": told["number"],
                 "reply": content}  # fmt: skip
        body = {"tab": "t", "events": [event]}
        if rng.random() < 1 / FAULT_EVERY and found.kills < limits[0]:
            where = int(rng.integers(3))
            if where:
                told_by(server, "/api/events", body, reads=False)
            if where == 2:
                SystemClock().sleep_until_ns(
                    SystemClock().now_ns() + round(rng.uniform(0, MAX_WRITING_S) * 1e9)
                )
            server.kill()
            found.kills += 1
            watch = StopWatch()
            server.start()
            told = told_by(server, "/api/events", body)
            found.resumes_s.append(watch.elapsed_s())
        else:
            if rng.random() < 1 / FAULT_EVERY and found.cuts < limits[1]:
                told_by(server, "/api/events", body, reads=False)
                found.cuts += 1
            told = told_by(server, "/api/events", body)
        acknowledged = told["ack"]
    server.wait()
    recording = Recording(server.path)
    events = recording.events()
    kept: dict[int, list[str]] = {}
    for payload in events.loc[events["name"] == "page_event", "payload"]:
        if payload.get("kind") == "reply":
            answer = payload["reply"].get("answers", {}).get("answer", {}).get("option", "")
            kept.setdefault(payload["n"], []).append(answer)
    found.sessions += 1
    found.acknowledged += acknowledged
    found.lost += sum(sent[n] not in kept.get(n, []) for n in range(1, acknowledged + 1))
    found.twice += sum(len(answers) > 1 for answers in kept.values())
    rows = recording.trials()
    told_rows = [str(a) for a in rows["answer"]]
    whole = recording.status == "complete" and told_rows == [o for o in sent.values() if o]
    found.not_whole += not whole


def main(arguments: list[str]) -> int:
    """Print what was lost."""
    parser = argparse.ArgumentParser(prog="benchmarks.page_faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=200, help="kills of the server")
    parser.add_argument("--cuts", type=int, default=50, help="cuts of the network")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    found, rng = Found(), np.random.default_rng(1)
    with tempfile.TemporaryDirectory(prefix="page_faults") as folder:
        (Path(folder) / "faults.py").write_text(STUDY, encoding="utf-8")
        while found.kills < options.kills or found.cuts < options.cuts:
            one_session(Path(folder), f"S{found.sessions + 1:03d}", found,
                        (options.kills, options.cuts), rng)  # fmt: skip
    slowest_s = max(found.resumes_s, default=0.0)
    if options.json:
        print(json.dumps(asdict(found), indent=2))
    else:
        print(f"{found.kills} kills of the server, {found.cuts} cuts, {found.sessions} sessions")
        print(
            f"{found.acknowledged} replies acknowledged, {found.lost} lost (limit 0), "
            f"{found.twice} recorded twice (limit 0)"
        )
        print(f"{found.not_whole} sessions not whole (limit 0)")
        print(
            f"from the kill to the next step: median {np.median(found.resumes_s or [0]):.2f} s, "
            f"slowest {slowest_s:.2f} s (limit {MAX_RESUME_S:g})"
        )
    return 1 if found.lost or found.twice or found.not_whole else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
