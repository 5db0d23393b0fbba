"""LabRecorder is started and stopped with a session, in the words its own source takes."""

import re
import socket
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from tests.faults.sessions import ScriptedOperator, lab, request
from visavis.cli.lab_companion import LabCompanion
from visavis.cli.lab_recorder import LabRecorder
from visavis.lab.clock import SystemClock
from visavis.lab.config import Sync
from visavis.lab.errors import DeviceError, DeviceNotFound, SessionAborted
from visavis.protocol.session.operator import Action, Command
from visavis.protocol.session.states import SessionState
from visavis.running.sessions.perform import perform_new

OPTION = re.compile(r"{(?P<option>\w+?):(?P<value>[^}]*)}")
"""How LabRecorder reads what follows `filename` (`rcsUpdateFilename` in its mainwindow.cpp)."""


@dataclass
class Remote:
    """What LabRecorder's remote control does with lines: trims, acts, answers OK to each."""

    port: int = 0
    heard: list[str] = field(default_factory=list)
    named: dict[str, str] = field(default_factory=dict)
    answers: bool = True

    def take(self, line: bytes) -> None:
        command = line.decode().strip()
        self.heard.append(command.split(" ")[0])
        if "filename" in command:
            self.named |= {m["option"]: m["value"] for m in OPTION.finditer(command)}


@pytest.fixture
def remote() -> Iterator[Remote]:
    listening = socket.create_server(("127.0.0.1", 0))
    made = Remote(listening.getsockname()[1])

    def serve() -> None:
        client, _ = listening.accept()
        with client, client.makefile("rwb") as lines:
            for line in lines:
                made.take(line)
                if not made.answers:
                    return
                lines.write(b"OK")
                lines.flush()

    thread = threading.Thread(target=serve)
    thread.start()
    yield made
    listening.close()
    thread.join()


def test_it_finds_streams_is_named_for_the_session_and_records(remote: Remote) -> None:
    recorder = LabRecorder(f"127.0.0.1:{remote.port}")
    recorder.start(study="stare", participant="07K", session=2, part=1)
    assert ["update", "filename", "start"] == remote.heard
    expected = {"participant": "07K", "session": "002", "task": "stare", "run": "1"}
    assert expected == remote.named
    assert "" == recorder.stop()
    assert "stop" == remote.heard[-1]


def test_one_that_is_not_there_is_told_with_the_remedy() -> None:
    with socket.create_server(("127.0.0.1", 0)) as once:
        port = once.getsockname()[1]
    with pytest.raises(DeviceNotFound, match=f"127.0.0.1:{port}.*tick EnableRCS"):
        LabRecorder(f"127.0.0.1:{port}")
    with pytest.raises(DeviceNotFound, match="LabRecorder does not answer"):
        LabRecorder("127.0.0.1:port")


def test_one_that_goes_away_is_told_and_stopped_once(remote: Remote) -> None:
    recorder = LabRecorder(f"127.0.0.1:{remote.port}")
    remote.answers = False
    with pytest.raises(DeviceError, match="did not take 'update'"):
        recorder.start(study="stare", participant="07K", session=1, part=1)
    assert "" == recorder.stop()


def test_a_session_starts_and_stops_it_however_it_ends(remote: Remote, tmp_path: Path) -> None:
    sync = Sync(lab_recorder=f"127.0.0.1:{remote.port}")
    config = lab(tmp_path).model_copy(update={"sync": sync})
    ending = ScriptedOperator((SessionState.INSTRUCTING, 1, 1, Command(Action.ABORT)))
    made = replace(request(config, ending), clock=SystemClock(), companion=LabCompanion())
    with pytest.raises(SessionAborted):
        perform_new(made)
    assert ["update", "filename", "start", "stop"] == remote.heard
