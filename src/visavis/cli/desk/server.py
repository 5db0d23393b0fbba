"""Serve the desk's page: the session that goes on, today's people, and what the doctor says."""

import asyncio
import contextlib
import hmac
import json
import secrets
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from aiohttp import web

from visavis.cli.desk.link import MAX_TEXT
from visavis.cli.desk.people import Verdicts, people_today
from visavis.cli.desk.watch import SessionWatch
from visavis.cli.doctor.report import FILE_NAME, examine
from visavis.lab.clock import SystemClock
from visavis.lab.config import LabConfig
from visavis.lab.errors import DeviceError, LabError
from visavis.protocol.session.operator import Action, Command
from visavis.running.page.server import KEY, LOCAL, LocalServer, body_of
from visavis.running.page.steps import PageError
from visavis.running.sessions.device_setup import is_simulated

SITE: Final = Path(__file__).parent / "site"
FILES: Final = {"/": "desk.html", "/desk.js": "desk.js", "/desk.css": "desk.css"}
MAX_WAIT_S: Final = 5.0
REMOTE: Final = {b"start": Action.ADVANCE, b"stop": Action.ABORT}
"""Effects of LabRecorder's remote commands on a session; its other commands change nothing."""
HTTP: Final = b" HTTP/"


class DeskServer:
    """Own the desk of a lab; its key is the secret in the page's address."""

    def __init__(self, lab: LabConfig) -> None:
        self._lab = lab
        self.key = secrets.token_urlsafe(24)
        self._watch = SessionWatch(lab.data_root)
        self._verdicts = Verdicts()
        self._doctor: Mapping[str, Any] | None = None
        self._examining = asyncio.Lock()
        self._listing = asyncio.Lock()
        posts = {
            "/api/live": self._live,
            "/api/today": self._today,
            "/api/doctor": self._look,
            "/api/command": self._command,
            "/api/v1/command": self._command,
        }
        gets = {"/api/v1/sessions": self._sessions}
        self._server = LocalServer(SITE, FILES, posts, gets=gets)
        self._remote: asyncio.Server | None = None

    async def start(self, port: int = 0) -> str:
        """Begin to listen; return the page's address. Raises DeviceError: the port is taken."""
        await self._server.start(port=port)
        return self._server.address(self.key)

    async def listen_as_lab_recorder(self, port: int) -> int:
        """Take LabRecorder's remote commands on this computer; return the port.

        `start` goes on where the first session waits, `stop` ends it, resumable. The protocol has
        no key, so every program on this computer may send commands.

        Raises:
            DeviceError: the port is taken.
        """
        try:
            self._remote = await asyncio.start_server(self._take_remote_commands, LOCAL, port)
        except OSError as error:
            raise DeviceError(
                f"cannot listen at {LOCAL}:{port} ({error.strerror or error})",
                role="desk",
                remedy="LabRecorder itself may have it; give another one with --rcs",
            ) from error
        return int(self._remote.sockets[0].getsockname()[1])

    async def run(self) -> None:
        """Follow the lab's sessions until cancelled."""
        try:
            await self._watch.run()
        finally:
            if self._remote is not None:
                self._remote.close()
            await self._watch.wake()  # pages that wait for news are answered, not waited for
            await self._server.stop()

    # ---- what the page asks ------------------------------------------------------------------

    async def _live(self, request: web.Request) -> web.StreamResponse:
        """Answer once something is new: the session, or that there is none."""
        body = await self._body(request)
        after, which = body.get("after"), body.get("which")
        if isinstance(after, int):
            await self._watch.wait(after, MAX_WAIT_S)
        watch = self._watch
        session = watch.of(which if isinstance(which, str) else "")
        return web.json_response(
            {
                "number": watch.number,
                "which": next((name for name, one in watch.live.items() if one is session), ""),
                "session": None if session is None else session.about,
                "status": None if session is None else session.status,
                "seen": None if session is None else session.last_view,
                "sessions": _session_choices(watch),
                "ended": None if watch.last_ended is None else watch.last_ended["path"],
            }
        )

    async def _sessions(self, request: web.Request) -> web.StreamResponse:
        """Answer another program: the sessions that go on, each with its status."""
        self._require_key(request)
        return web.json_response(
            {
                "sessions": [
                    {"which": name, "about": one.about, "status": one.status}
                    for name, one in self._watch.live.items()
                ]
            }
        )

    async def _today(self, request: web.Request) -> web.StreamResponse:
        """Say whose lab it is, who takes part today, and what the doctor found last."""
        await self._body(request)
        running = {str(one.about["path"]) for one in self._watch.live.values()}
        async with self._listing:  # one at a time: verdicts take the computer's time
            studies = await asyncio.to_thread(people_today, self._lab, self._verdicts, running)
        return web.json_response(
            {
                "lab": self._lab.lab,
                "configuration": str(self._lab.path),
                "is_simulated": is_simulated(self._lab),
                "studies": studies,
                "doctor": self._doctor,
            }
        )

    async def _look(self, request: web.Request) -> web.StreamResponse:
        """Let the doctor look; devices of a session that goes on are left to it."""
        await self._body(request)
        async with self._examining:
            running = self._watch.about
            if running is not None:
                findings = await asyncio.to_thread(_doctor_notes_of, Path(running["path"]))
                self._doctor = findings or self._doctor
            else:
                with contextlib.suppress(LabError):
                    self._doctor = await asyncio.to_thread(_run_doctor, self._lab)
        return web.json_response({"doctor": self._doctor})

    async def _command(self, request: web.Request) -> web.StreamResponse:
        body = await self._body(request)
        text, code, which = (body.get(name, "") for name in ("text", "code", "which"))
        try:
            action = Action(body.get("action", ""))
        except ValueError as error:
            choices = ", ".join(action.value for action in Action)
            raise PageError(f"there is no such command; there are {choices}") from error
        if not isinstance(text, str) or len(text) > MAX_TEXT:
            raise PageError(f"a note has at most {MAX_TEXT} characters")
        if not isinstance(code, str) or not isinstance(which, str):
            raise PageError("code and which are short texts")
        live = self._watch.live.get(which) if which else self._watch.of()
        if live is not None and action not in live.about["commands"]:
            commands = (
                ", ".join(live.about["commands"]) or "nothing from the desk; its own page does"
            )
            raise PageError(f"this session takes no {action.value}; it takes {commands}")
        if live is not None and code and code not in live.about["incidents"]:
            choices = ", ".join(live.about["incidents"])
            raise PageError(f"there is no reason {code[:40]!r}; there are {choices}")
        if not await self._watch.tell(Command(action, text, code), which):
            return web.json_response({"refused": "no session goes on"}, status=409)
        return web.json_response({})

    async def _take_remote_commands(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Serve a program that speaks LabRecorder's protocol; answer lines as LabRecorder does."""
        try:
            while line := await reader.readline():
                if HTTP in line:
                    return  # any page of any site may post here, and its body would be obeyed
                action = REMOTE.get(line.strip())
                if action is not None:
                    await self._watch.tell(Command(action))
                writer.write(b"OK")
                await writer.drain()
        except (OSError, ValueError):
            return  # it has gone, or is no such program
        finally:
            writer.close()

    async def _body(self, request: web.Request) -> Mapping[str, Any]:
        self._require_key(request)
        return await body_of(request)

    def _require_key(self, request: web.Request) -> None:
        if not hmac.compare_digest(request.headers.get(KEY, "").encode(), self.key.encode()):
            raise PageError("this address is of another desk; open the one the terminal shows")


def _session_choices(watch: SessionWatch) -> list[dict[str, Any]]:
    """Return the sessions that go on, as choices for a page."""
    return [
        {"which": name, **{k: one.about[k] for k in ("study", "participant", "session")}}
        for name, one in watch.live.items()
    ]


def _run_doctor(lab: LabConfig) -> dict[str, Any]:
    report = examine(lab, SystemClock())
    return _at_a_glance([asdict(f) for f in report.findings], report.made_wall_iso)


def _doctor_notes_of(session: Path) -> dict[str, Any] | None:
    """Return what the doctor noted as a session's devices were opened."""
    notes = sorted(session.glob(f"part-*/{FILE_NAME}"))
    if not notes:
        return None
    try:
        report = json.loads(notes[-1].read_text("utf-8"))
        return _at_a_glance(report["findings"], report["made_wall_iso"])
    except (OSError, ValueError, KeyError):
        return None  # it is being written


def _at_a_glance(findings: list[dict[str, Any]], made_wall_iso: str) -> dict[str, Any]:
    count = {
        level: sum(f["level"] == level for f in findings) for level in ("missing", "warning", "ok")
    }
    return {"made_wall_iso": made_wall_iso, "count": count, "findings": findings}
