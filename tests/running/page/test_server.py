"""The server tells nobody else anything, and serves sessions to whoever has their key."""

import asyncio
import re
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from tests.running.page.pages import Page, begun
from visavis.running.page.server import KEY, SITE, PageServer, PageSession

MAX_PAGE_BYTES = 300_000


def served(
    root: Path, ask: Callable[[aiohttp.ClientSession, Page, PageServer], Awaitable[Any]]
) -> Any:
    """Serve a session, and ask."""

    async def asked() -> Any:
        with begun(root) as (page, _):
            server = PageServer()
            await server.start()
            try:
                server.add(PageSession(page.desk, {"words": {}}))
                async with aiohttp.ClientSession(f"http://127.0.0.1:{server.port}") as http:
                    return await ask(http, page, server)
            finally:
                await server.stop()

    return asyncio.run(asked())


def test_the_whole_page_is_small_and_asks_nobody_else() -> None:
    files = [p for p in SITE.rglob("*") if p.is_file()]
    assert MAX_PAGE_BYTES > sum(f.stat().st_size for f in files)
    assert [] == [
        f.name for f in files if re.search(rb"(https?:)?//[a-z0-9.]+\.[a-z]{2,}", f.read_bytes())
    ]


def test_without_the_key_nothing_is_told(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> list[int]:
        found = []
        for path, body in (
            ("/api/hello", {"tab": "x"}),
            ("/api/events", {"tab": "x"}),
            ("/api/leave", {"tab": "x", "key": "other"}),
        ):
            async with http.post(path, json=body, headers={KEY: "other"}) as response:
                found.append(response.status)
        async with http.get("/films/anything") as response:
            found.append(response.status)
        return found

    assert [400] * 4 == served(tmp_path, ask)


def test_under_another_name_it_does_not_answer(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> int:
        async with http.get("/", headers={"Host": "elsewhere.example"}) as response:
            return response.status

    assert 403 == served(tmp_path, ask)


def test_pages_may_load_from_nobody_but_their_server(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> str:
        async with http.get("/") as response:
            assert 200 == response.status
            return response.headers["Content-Security-Policy"]

    policy = served(tmp_path, ask)
    assert "default-src 'none'" in policy
    assert "http" not in policy


def test_steps_and_acknowledgements_come_back_over_http(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> list[Any]:
        http.headers[KEY] = "key"
        found = []
        asked: list[dict[str, Any]] = [
            {"tab": "one", "events": [page.event()]},
            {"tab": "two", "events": []},
            {"tab": "one", "events": [{"n": 9}]},
            {"tab": "one", "events": "none"},
        ]
        for body in asked:
            async with http.post("/api/events", json=body) as response:
                found.append((response.status, (await response.json()).get("ack")))
        for data in (b"no json", b"[" * 100_000):
            async with http.post("/api/events", data=data) as response:
                found.append((response.status, None))
        return found

    assert [(200, 1), (409, None), *[(400, None)] * 4] == served(tmp_path, ask)


def test_a_recording_that_fails_is_told_and_nothing_is_acknowledged(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> dict[str, Any]:
        http.headers[KEY] = "key"
        sent = page.event()
        page.desk.recorder.close("aborted")
        async with http.post("/api/events", json={"tab": "one", "events": [sent]}) as response:
            told: dict[str, Any] = await response.json()
            return told

    assert -1 == served(tmp_path, ask)["ack"]


def test_a_session_that_is_over_already_is_not_waited_for(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> bool:
        page.desk.take("one", [{**page.event(), "reply": {"agreed": False}}])
        session = PageSession(page.desk, {})
        server.add(session)
        return session.over.is_set()

    assert served(tmp_path, ask)


def test_a_port_that_is_taken_is_told_with_the_way_out(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> None:
        other = PageServer()
        with pytest.raises(Exception, match=f"cannot listen at 127.0.0.1:{server.port}"):
            await other.start(port=server.port)

    served(tmp_path, ask)
