"""A served study whose server is killed goes on at the same step, for whoever was at it."""

import json
import os
import signal
import subprocess
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from tests.commands import COMMANDS, RunningCommand
from visavis.recording.reader import Recording
from visavis.running.page.server import KEY

STUDY = """
from visavis import Factor, Rating, Study

study = Study("many", factors=[Factor("place", [1, 2, 3, 4])], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.ask(Rating("answer", 1, 9))
"""
COMMAND = ["-c", "from visavis.cli.main import main; main()"]


def start_server(root: Path, port: str = "0") -> tuple[RunningCommand, str]:
    """Begin a server; return it with its address."""
    server = COMMANDS.start(
        *[*COMMAND, "serve", "./many.py", "--port", port, "--devices", "sim"],
        cwd=root,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert server.stdout is not None
    for line in server.stdout:
        if "/board#" in line:
            return server, line.strip().partition("/board#")[0]
    raise AssertionError("the server told no address")


def post(base: str, path: str, body: dict[str, Any], key: str = "") -> dict[str, Any]:
    request = urllib.request.Request(  # noqa: S310  # an address of this computer
        f"{base}{path}", json.dumps(body).encode(), {KEY: key, "Content-Type": "application/json"}
    )
    with urllib.request.urlopen(request) as response:  # noqa: S310  # as above
        state: dict[str, Any] = json.load(response)
    return state


def answer_steps(base: str, key: str, steps: int) -> dict[str, Any]:
    """Answer so many steps; return what the page is told then."""
    state = post(base, "/api/hello", {"tab": "t", "at_ms": 0.0, "about": {}}, key)
    for _ in range(steps):
        step = state["step"]
        if step["kind"] == "end":
            break
        given = {"option": "5", "at_ms": 0.0, "by": "keys"}
        reply = (
            {
                "shown_ms": 0.0,
                "off_ms": 0.0,
                "hidden_ms": 0.0,
                "films": {},
                "answers": {q["name"]: given for q in step["questions"]},
            }
            if step["kind"] == "watch"
            else {}
        )
        event = {
            "n": state["ack"] + 1,
            "kind": "reply",
            "at_ms": 0.0,
            "step": state["number"],
            "reply": reply,
        }
        state = post(base, "/api/events", {"tab": "t", "events": [event]}, key)
    return state


def test_a_killed_server_goes_on_at_the_same_step(tmp_path: Path) -> None:
    (tmp_path / "many.py").write_text(STUDY, encoding="utf-8")
    assert 0 == COMMANDS.run(*COMMAND, "init", cwd=tmp_path).returncode
    server, base = start_server(tmp_path)
    try:
        key = post(base, "/api/arrive", {"parameters": {}})["key"]
        before = answer_steps(base, key, 3)
    finally:
        server.kill()
        server.communicate()
    server, base = start_server(tmp_path, base.rpartition(":")[2])
    try:
        assert before == {k: v for k, v in answer_steps(base, key, 0).items() if k in before}
        assert {"kind": "end", "outcome": "done"} == answer_steps(base, key, 99)["step"]
    finally:
        server.send_signal(signal.SIGINT)
        server.communicate(timeout=60)
    assert 0 == server.returncode
    (path,) = tmp_path.glob("**/ses-001")
    recording = Recording(path)
    assert "complete" == recording.status
    assert ["5"] * 4 == [str(int(v)) for v in recording.trials()["answer"]]
    assert "server restarted" in ";".join(recording.trials()["flags"].dropna())


def test_who_began_goes_on_where_a_study_now_needs_what_no_page_has_and_nobody_new_is_let_in(
    tmp_path: Path,
) -> None:
    (tmp_path / "many.py").write_text(STUDY, encoding="utf-8")
    assert 0 == COMMANDS.run(*COMMAND, "init", cwd=tmp_path).returncode
    server, base = start_server(tmp_path)
    try:
        key = post(base, "/api/arrive", {"parameters": {}})["key"]
        answer_steps(base, key, 3)
    finally:
        server.kill()
        server.communicate()
    (tmp_path / "many.py").write_text(STUDY.replace("uses=()", 'needs=["eye_tracker"]'), "utf-8")
    server, base = start_server(tmp_path)
    try:
        assert "failed" == post(base, "/api/arrive", {"parameters": {}})["refused"]
        assert {"kind": "end", "outcome": "done"} == answer_steps(base, key, 99)["step"]
    finally:
        server.send_signal(signal.SIGINT)
        server.communicate(timeout=60)
    (path,) = tmp_path.glob("**/ses-001")
    assert "complete" == Recording(path).status


@pytest.mark.parametrize(
    ("given", "refusal"),
    [(("--host", "0.0.0.0"), "--public"), (("--public", "https://a.example/x"), "root")],  # noqa: S104  # refused
)
def test_an_address_at_which_nobody_could_come_is_refused(
    tmp_path: Path, given: tuple[str, str], refusal: str
) -> None:
    (tmp_path / "many.py").write_text(STUDY, "utf-8")
    arguments = ["serve", "./many.py", "--devices", "sim", *given]
    process = COMMANDS.run(*COMMAND, *arguments, cwd=tmp_path, timeout=60)
    assert 0 != process.returncode
    assert refusal in process.stdout + process.stderr
