"""The study whose pages are broken into, its server in a process of its own, and what is found."""

import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tests.faults.sessions import lab
from visavis.lab.clock import SystemClock
from visavis.lab.errors import RecordingError
from visavis.protocol.session.operator import UnattendedOperator
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.sessions.session_request import PageAddress, Request, SessionPerson
from visavis.study.experiment import StudyExperiment

NAME: Final = "faults"
TRIALS: Final = 24
OPTIONS: Final = 9
STUDY: Final = f"""
from visavis import Factor, Rating, Study

study = Study("{NAME}", factors=[Factor("place", list(range({TRIALS})))], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.ask(Rating("answer", 1, {OPTIONS}))
"""
FAULT_EVERY: Final = 3
"""Faults come with one reply in so many."""


@dataclass
class Found:
    """What came of one kind of fault."""

    kind: str
    faults: int = 0
    sessions: int = 0
    acknowledged: int = 0
    lost: int = 0
    twice: int = 0
    asked_again: int = 0
    """Answers that were given as the fault came, and had to be given once more."""
    not_whole: int = 0
    resumes_s: list[float] = field(default_factory=list)
    """From when what was killed is begun again to the step where it was."""

    @property
    def is_bad(self) -> bool:
        """Whether anything was lost, or not taken as it should be."""
        return bool(self.lost or self.twice or self.not_whole)

    def look_through(self, answers: Mapping[int, str], kept: Mapping[int, list[str]]) -> None:
        """Count the answers that were acknowledged, by reply, and that are not in what was kept."""
        self.sessions += 1
        self.acknowledged += len(answers)
        self.lost += sum(answer not in kept.get(n, []) for n, answer in answers.items())
        self.twice += sum(len(given) > 1 for given in kept.values())


def write_study(root: Path) -> None:
    """Write the study's file."""
    (root / f"{NAME}.py").write_text(STUDY, encoding="utf-8")


def session_path(root: Path, label: str) -> Path:
    """Return where somebody's session lies."""
    return session_dir(root, NAME, label, 1, is_simulated=True)


def request_of(root: Path, label: str = "", page: PageAddress | None = None) -> Request:
    """Return what somebody's session is performed from."""
    study = find_study(str(root / f"{NAME}.py"))
    experiment = study.experiment({})
    assert isinstance(study, OpenedStudy)
    assert isinstance(experiment, StudyExperiment)
    return Request(
        study=study,
        experiment=experiment,
        config=lab(root),
        person=SessionPerson(label, 0),
        seed=1,
        clock=SystemClock(),
        operator=UnattendedOperator(),
        page=page,
        on="browser",
    )


def kept_replies(path: Path) -> dict[int, list[str]]:
    """Return a recording's answers by the number of their reply: one each, where all is well."""
    events = Recording(path).events()
    kept: dict[int, list[str]] = {}
    for payload in events.loc[events["name"] == "page_event", "payload"]:
        if payload.get("kind") == "reply":
            answer = payload["reply"].get("answers", {}).get("answer", {}).get("option", "")
            kept.setdefault(payload["n"], []).append(answer)
    return kept


class Server:
    """Own the process that serves a session; it may be killed and begun anew at its address."""

    def __init__(self, root: Path, label: str) -> None:
        self._root, self._label = root, label
        self.path = session_path(root, label)
        self._process: subprocess.Popen[str] | None = None
        self.address = ""

    @property
    def key(self) -> str:
        """The key of the address."""
        return self.address.partition("/#")[2]

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self.address.partition("/#")[0].rpartition(":")[2])

    def start(self) -> None:
        """Begin or go on with the session, and wait until its address is known.

        Raises:
            RecordingError: it ended with an error, which it has printed.
        """
        self._process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.page_faults.serving", str(self._root), self._label],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().strip()
        if not self.address:
            self.wait()

    def kill(self) -> None:
        """Kill the process."""
        if self._process is None or self._process.poll() is not None:
            return
        self._process.send_signal(signal.SIGKILL)
        self._process.communicate()

    def wait(self) -> None:
        """Wait until it has ended by itself.

        Raises:
            RecordingError: it ended with an error, which it has printed.
        """
        assert self._process is not None
        self._process.communicate()
        if self._process.returncode != 0:
            raise RecordingError(f"the server of {self._label} ended with an error, printed above")
