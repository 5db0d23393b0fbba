"""What answers over HTTP: a target per endpoint of pages and desk, seeded with what pages post."""

import asyncio
import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from aiohttp import StreamReader, web
from aiohttp.base_protocol import BaseProtocol
from aiohttp.test_utils import make_mocked_request

from benchmarks.cross_site import Everybody
from benchmarks.fuzz.damage import json_or_bytes
from benchmarks.fuzz.target import Target
from tests.faults.sessions import lab
from tests.running.page.pages import TAB, Page, begin_session
from visavis.cli.desk.server import DeskServer
from visavis.running.page.server import KEY, LocalServer, PageServer, PageSession

STEPS: Final = 6
"""Steps of a session whose replies are samples."""
ANSWERED: Final = (200, 400, 403, 409, 413, 415)
BOARD_KEY: Final = "board"


class Posted:
    """Own a served page and a desk; hand them bodies as their server would."""

    def __init__(self, root: Path) -> None:
        self._loop = asyncio.new_event_loop()
        self._root, self._stack, self._number = root, ExitStack(), 0
        self.pages = PageServer(reception=Everybody(BOARD_KEY))
        self.desk = DeskServer(lab(root))
        self._page = self._begin()
        self._session = PageSession(self._page.desk, {})
        self.pages.add(self._session)
        self.replies = self._replies()

    def answer(self, path: str, data: bytes) -> tuple[int, object]:
        """Post a body; return status and JSON of the answer; a session that is over is replaced."""
        if self._session.over.is_set() or self._session.failures:
            self._session = PageSession(self._begin().desk, {})
            self.pages.add(self._session)
        server: LocalServer = self.pages
        key = BOARD_KEY if path == "/api/board" else self._session.desk.key
        if path in ("/api/command", "/api/v1/command"):
            server, key = self.desk._server, self.desk.key  # noqa: SLF001  # no socket between
        return self._loop.run_until_complete(self._posted(server, path, key, data))

    def close(self) -> None:
        """Close the sessions, and the loop they were answered in."""
        self._stack.close()
        self._loop.close()

    async def _posted(
        self, server: LocalServer, path: str, key: str, data: bytes
    ) -> tuple[int, object]:
        body = StreamReader(BaseProtocol(self._loop), 2**20, loop=self._loop)
        body.feed_data(data)
        body.feed_eof()
        headers = {KEY: key, "Content-Type": "application/json", "Host": "127.0.0.1"}
        app = server._app  # noqa: SLF001  # as above
        request = make_mocked_request(
            "POST", path, headers, payload=body, app=app, client_max_size=2**20
        )
        match = await app.router.resolve(request)
        response = await server._guard(request, match.handler)  # noqa: SLF001  # as above
        assert isinstance(response, web.Response)
        failures = self._session.failures
        if failures:
            raise RuntimeError("the session failed") from failures[0]
        text = response.text or "null"
        return response.status, json.loads(text)

    def _begin(self) -> Page:
        self._number += 1
        page, _ = self._stack.enter_context(
            begin_session(self._root / "data", f"S{self._number:05d}")
        )
        return page

    def _replies(self) -> tuple[bytes, ...]:
        """Return the bodies of the first steps of a session, which answers them itself."""
        page, bodies = self._begin(), []
        for _ in range(STEPS):
            bodies.append(json.dumps({"tab": TAB, "events": [page.event()]}).encode())
            page.answer()
        return tuple(bodies)


def is_answered(result: object) -> bool:
    """Tell whether an answer is one that a page understands."""
    assert isinstance(result, tuple)
    return result[0] in ANSWERED and isinstance(result[1], dict)


@contextmanager
def endpoints(root: Path) -> Iterator[tuple[Target, ...]]:
    """Give a target per endpoint; their sessions are closed at the end."""
    posted = Posted(root)
    try:
        yield _targets(posted)
    finally:
        posted.close()


def _targets(posted: Posted) -> tuple[Target, ...]:

    def target(path: str, *samples: bytes) -> Target:
        return Target(
            f"http {path}",
            samples,
            lambda data: posted.answer(path, data),
            is_sound=is_answered,
            change=json_or_bytes,
            share_01=0.1,
        )

    about = {"user_agent": "page", "screen": [1280, 800], "language": "en"}
    hello = {"tab": TAB, "takes_over": True, "before": "", "at_ms": 1.0, "about": about}
    come = {"parameters": {"PROLIFIC_PID": "5f0a1b2c3d4e5f6a7b8c9d0e"}, "before": ""}
    command = {"action": "note", "text": "sneezed", "code": "", "which": ""}
    leave = {"key": posted._session.desk.key, "tab": TAB}  # noqa: SLF001  # as above
    with_clock = [
        json.dumps({**json.loads(b), "sent_ms": 5.0, "wall_ms": 1.8e12}).encode()
        for b in posted.replies[:2]
    ]
    return (
        target("/api/hello", json.dumps(hello).encode()),
        target("/api/events", *posted.replies, *with_clock),
        target("/api/leave", json.dumps(leave).encode()),
        target("/api/arrive", json.dumps(come).encode()),
        target("/api/board", b"{}"),
        target("/api/command", json.dumps(command).encode()),
    )
