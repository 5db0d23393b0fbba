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

from cli.desk.link import MAX_TEXT
from cli.desk.people import Verdicts, people_today
from cli.desk.watch import SessionWatch
from cli.doctor.report import FILE_NAME, examine
from lab.clock import SystemClock
from lab.config import LabConfig
from lab.errors import LabError
from protocol.operator import Action, Command
from visavis.page.errors import PageError
from visavis.page.server import KEY, LocalServer, body_of
from visavis.sessions.rig import is_simulated

SITE: Final = Path(__file__).parent / "site"
FILES: Final = {"/": "desk.html", "/desk.js": "desk.js", "/desk.css": "desk.css"}
MAX_WAIT_S: Final = 5.0


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
        }
        self._server = LocalServer(SITE, FILES, posts)

    async def start(self, port: int = 0) -> str:
        """Begin to listen; return the page's address. Raises DeviceError: the port is taken."""
        await self._server.start(port=port)
        return self._server.address(self.key)

    async def run(self) -> None:
        """Follow the lab's sessions until cancelled."""
        try:
            await self._watch.run()
        finally:
            await self._watch.wake()  # pages that wait for news are answered, not waited for
            await self._server.stop()

    # ---- what the page asks ------------------------------------------------------------------

    async def _live(self, request: web.Request) -> web.StreamResponse:
        """Answer once something is new: the session, or that there is none."""
        body = await self._body(request)
        after = body.get("after")
        if isinstance(after, int):
            await self._watch.wait(after, MAX_WAIT_S)
        watch = self._watch
        return web.json_response(
            {
                "number": watch.number,
                "session": watch.about,
                "status": watch.status,
                "ended": None if watch.ended is None else watch.ended["path"],
            }
        )

    async def _today(self, request: web.Request) -> web.StreamResponse:
        """Say whose lab it is, who takes part today, and what the doctor found last."""
        await self._body(request)
        running = str(self._watch.about["path"]) if self._watch.about else ""
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
                found = await asyncio.to_thread(_noted_with, Path(running["path"]))
                self._doctor = found or self._doctor
            else:
                with contextlib.suppress(LabError):
                    self._doctor = await asyncio.to_thread(_examined, self._lab)
        return web.json_response({"doctor": self._doctor})

    async def _command(self, request: web.Request) -> web.StreamResponse:
        body = await self._body(request)
        text = body.get("text", "")
        try:
            action = Action(body.get("action", ""))
        except ValueError as error:
            raise PageError("there is no such command") from error
        if not isinstance(text, str) or len(text) > MAX_TEXT:
            raise PageError(f"a note has at most {MAX_TEXT} characters")
        if not await self._watch.tell(Command(action, text)):
            return web.json_response({"refused": "no session goes on"}, status=409)
        return web.json_response({})

    async def _body(self, request: web.Request) -> Mapping[str, Any]:
        if not hmac.compare_digest(request.headers.get(KEY, "").encode(), self.key.encode()):
            raise PageError("this address is of another desk; open the one the terminal shows")
        return await body_of(request)


def _examined(lab: LabConfig) -> dict[str, Any]:
    report = examine(lab, SystemClock())
    return _at_a_glance([asdict(f) for f in report.findings], report.made_wall_iso)


def _noted_with(session: Path) -> dict[str, Any] | None:
    """Return what the doctor noted as a session's devices were opened."""
    notes = sorted(session.glob(f"part-*/{FILE_NAME}"))
    if not notes:
        return None
    try:
        noted = json.loads(notes[-1].read_text("utf-8"))
        return _at_a_glance(noted["findings"], noted["made_wall_iso"])
    except (OSError, ValueError, KeyError):
        return None  # it is being written


def _at_a_glance(findings: list[dict[str, Any]], made_wall_iso: str) -> dict[str, Any]:
    count = {
        level: sum(f["level"] == level for f in findings) for level in ("missing", "warning", "ok")
    }
    return {"made_wall_iso": made_wall_iso, "count": count, "findings": findings}
