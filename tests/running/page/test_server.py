"""The server tells nobody else anything, and serves sessions to whoever has their key."""

import asyncio
import json
import re
from collections.abc import Awaitable, Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from tests.running.page.pages import TAB, Page, begin_session
from visavis.cli import viewer
from visavis.lab.errors import RecordingError
from visavis.running.page.server import (
    HEADERS,
    KEY,
    LIVE_FILES,
    MAX_REQUEST_BYTES,
    SITE,
    PageServer,
    PageSession,
)
from visavis.running.page.streams import POST_BYTES

MAX_PAGE_BYTES = 300_000
MAX_FIGURE_BYTES = 60_000


def serve(
    root: Path, ask: Callable[[aiohttp.ClientSession, Page, PageServer], Awaitable[Any]]
) -> Any:
    """Serve a session, and ask."""

    async def act() -> Any:
        with begin_session(root) as (page, _):
            server = PageServer()
            await server.start()
            try:
                server.add(PageSession(page.desk, {"words": {}}))
                async with aiohttp.ClientSession(f"http://127.0.0.1:{server.port}") as http:
                    return await ask(http, page, server)
            finally:
                await server.stop()

    return asyncio.run(act())


def test_the_whole_page_is_small_and_asks_nobody_else() -> None:
    of_figures = {SITE / name for name in LIVE_FILES.values()}  # loaded where a study has some
    ours = [p for p in SITE.rglob("*") if p.is_file()]
    assert MAX_FIGURE_BYTES > sum(f.stat().st_size for f in of_figures)
    assert MAX_PAGE_BYTES > sum(f.stat().st_size for f in ours if f not in of_figures)
    assert [] == [
        f.name for f in ours if re.search(rb"(https?:)?//[a-z0-9.]+\.[a-z]{2,}", f.read_bytes())
    ]


def test_one_file_draws_scenes_on_all_pages_and_one_the_pictures_all_around() -> None:
    scripts = [*SITE.rglob("*.js"), *Path(viewer.__file__).parent.glob("*.js")]
    drawing = sorted(f.name for f in scripts if "createShader(" in f.read_text("utf-8"))
    assert ["painting.js", "panorama.js"] == drawing


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
        for path in ("/films/anything", "/assets/anything"):
            async with http.get(path) as response:
                found.append(response.status)
        return found

    assert [400] * 5 == serve(tmp_path, ask)


def test_under_another_name_it_does_not_answer(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> int:
        async with http.get("/", headers={"Host": "elsewhere.example"}) as response:
            return response.status

    assert 403 == serve(tmp_path, ask)


STRANGERS: dict[str, dict[str, str]] = {
    "another site, no questions asked": {
        "Content-Type": "text/plain",
        "Sec-Fetch-Site": "cross-site",
    },
    "another site, as JSON": {
        "Content-Type": "application/json",
        "Origin": "https://other.example",
    },
    "another server of this computer": {
        "Content-Type": "application/json",
        "Origin": "http://127.0.0.1:1",
    },
    "a sandboxed frame": {"Content-Type": "application/json", "Origin": "null"},
    "a form": {"Content-Type": "application/x-www-form-urlencoded"},
    "a plain text": {"Content-Type": "text/plain"},
}


@pytest.mark.parametrize("path", ["/api/hello", "/api/events", "/api/leave"])
@pytest.mark.parametrize("headers", STRANGERS.values(), ids=list(STRANGERS))
def test_a_page_of_another_site_cannot_post(
    tmp_path: Path, headers: dict[str, str], path: str
) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> int:
        body = json.dumps({"tab": "one", "key": "key", "events": [page.event()]})
        async with http.post(path, data=body, headers=headers) as response:
            return response.status

    assert serve(tmp_path, ask) in (403, 415)


def test_a_page_behind_a_proxy_may_post_under_the_name_it_is_served_under(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> int:
        server._hosts = (*server._hosts, "lab.example")
        headers = {"Origin": "https://lab.example", "Sec-Fetch-Site": "same-origin", KEY: "key"}
        body = {"tab": "one", "events": [page.event()]}
        async with http.post("/api/events", json=body, headers=headers) as response:
            return response.status

    assert 200 == serve(tmp_path, ask)


def test_every_refusal_is_json_under_the_same_headers(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> list[Any]:
        as_json = {"Content-Type": "application/json", KEY: "key"}
        other = {**as_json, "Content-Type": "application/json; charset=foo"}
        found: list[Any] = []
        for method, path, data, headers in (
            ("GET", "/nowhere", b"", {}),
            ("DELETE", "/api/hello", b"", as_json),
            ("POST", "/api/events", BytesIO(b"x" * (2 << 20)), as_json),
            ("POST", "/api/events", b"{}", other),
        ):
            async with http.request(method, path, data=data, headers=headers) as response:
                assert set(HEADERS.items()) <= set(response.headers.items())
                assert (await response.json())["refused"]
                found.append(response.status)
        return found

    assert [404, 405, 413, 400] == serve(tmp_path, ask)


def test_half_a_character_in_an_answer_loses_neither_it_nor_what_follows(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> list[int]:
        http.headers[KEY] = "key"
        resized = {"kind": "resize", "at_ms": 1.0, "view_px": "\ud83d"}
        events = [{**resized, "n": 1}, {**resized, "n": 2}]
        body = json.dumps({"tab": "one", "events": events}).encode()
        async with http.post(
            "/api/events", data=body, headers={"Content-Type": "application/json"}
        ) as response:
            return [response.status, (await response.json())["ack"]]

    assert [200, 2] == serve(tmp_path, ask)


def test_a_time_that_no_clock_shows_is_refused_before_it_is_recorded(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> list[int]:
        http.headers[KEY] = "key"
        found = []
        for at_ms in (1e308, 1.0):
            async with http.post("/api/hello", json={"tab": "one", "at_ms": at_ms}) as response:
                found.append(response.status)
        return found

    assert [400, 200] == serve(tmp_path, ask)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"at_ms": 9.9e14}, "at_ms is 990000000000000"),
        ({"kind": "unheard"}, "no event 'unheard'"),
        ({"kind": "moved", "names": [["x"]]}, "names are those"),
        ({"kind": "about", "about": 7}, "about is not an object"),
        ({"kind": "reply", "reply": {"agreed": 1}, "step": 1}, "neither given nor declined"),
        ({"kind": "reply", "reply": {"agreed": True}, "step": []}, "a reply to step []"),
    ],
)
def test_an_event_that_cannot_be_is_named_and_those_before_and_behind_it_are_taken(
    tmp_path: Path, change: dict[str, Any], text: str
) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> list[Any]:
        http.headers[KEY] = "key"
        resized = {"kind": "resize", "at_ms": 1.0}
        sent = [{**resized, "n": 1}, {**resized, "n": 2, **change}, {**resized, "n": 3}]
        body = {"tab": "one", "events": sent}
        async with http.post("/api/events", json=body) as response:
            refusal = await response.json()
        body["events"] = [{**resized, "n": n} for n in (1, 2)]  # as a page numbers them anew
        async with http.post("/api/events", json=body) as response:
            return [refusal["event"], refusal["refused"], (await response.json())["ack"]]

    event, refused, ack = serve(tmp_path, ask)
    assert (2, 2) == (event, ack)
    assert text in refused


def test_a_failure_of_ours_is_json_under_the_same_headers_and_prints_no_address(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> int:
        async def fail(key: str) -> None:
            raise KeyError(key)

        monkeypatch.setattr(server, "_of", fail)
        body = {"tab": "one", "events": []}
        async with http.post("/api/events", json=body, headers={KEY: "key"}) as response:
            assert set(HEADERS.items()) <= set(response.headers.items())
            assert "it failed" == (await response.json())["refused"]
            return response.status

    assert 500 == serve(tmp_path, ask)
    assert "127.0.0.1" not in caplog.text


def test_broken_http_prints_nobodys_address(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(b"GET / HTTP/9.9\r\nHost\x00: x\r\n\r\n")
        answer = await reader.read()
        writer.close()
        return answer

    answer: bytes = serve(tmp_path, ask)
    assert b" 400 " in answer.splitlines()[0]
    assert b"Server: Visavis\r\n" in answer
    assert "127.0.0.1" not in caplog.text + capsys.readouterr().err


def test_pages_may_load_from_nobody_but_their_server(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> str:
        async with http.get("/") as response:
            assert 200 == response.status
            return response.headers["Content-Security-Policy"]

    policy = serve(tmp_path, ask)
    assert "default-src 'none'" in policy
    assert "http" not in policy


def test_steps_and_acknowledgements_come_back_over_http(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> list[Any]:
        http.headers[KEY] = "key"
        found = []
        bodies: list[dict[str, Any]] = [
            {"tab": "one", "events": [page.event()]},
            {"tab": "two", "events": []},
            {"tab": "one", "events": [{"n": 9}]},
            {"tab": "one", "events": "none"},
        ]
        for body in bodies:
            async with http.post("/api/events", json=body) as response:
                found.append((response.status, (await response.json()).get("ack")))
        for data in (b"no json", b"[" * 100_000):
            async with http.post("/api/events", data=data) as response:
                found.append((response.status, None))
        return found

    assert [(200, 1), (409, None), *[(400, None)] * 4] == serve(tmp_path, ask)


def test_a_post_that_is_too_long_is_refused_as_json_with_how_much_is_taken(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> Any:
        http.headers[KEY] = "key"
        body = BytesIO(json.dumps({"tab": "one", "events": ["x" * MAX_REQUEST_BYTES]}).encode())
        async with http.post("/api/events", data=body) as response:
            return response.status, await response.json()

    status, answer = serve(tmp_path, ask)
    assert (413, POST_BYTES) == (status, answer["max_bytes"])
    assert f"at most {MAX_REQUEST_BYTES} bytes" in answer["refused"]


def test_a_recording_that_fails_is_told_and_nothing_is_acknowledged(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> dict[str, Any]:
        http.headers[KEY] = "key"
        sent = page.event()
        page.desk.recorder.close("aborted")
        async with http.post("/api/events", json={"tab": "one", "events": [sent]}) as response:
            state: dict[str, Any] = await response.json()
            return state

    assert -1 == serve(tmp_path, ask)["ack"]


def test_a_session_that_is_over_already_is_not_waited_for(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> bool:
        page.desk.take("one", [{**page.event(), "reply": {"agreed": False}}])
        session = PageSession(page.desk, {})
        server.add(session)
        return session.over.is_set()

    assert serve(tmp_path, ask)


def test_a_port_that_is_taken_is_told_with_the_way_out(tmp_path: Path) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> None:
        other = PageServer()
        with pytest.raises(Exception, match=f"cannot listen at 127.0.0.1:{server.port}"):
            await other.start(port=server.port)

    serve(tmp_path, ask)


@pytest.mark.parametrize("is_closed", [False, True])
def test_a_session_whose_recording_failed_acknowledges_nothing_more(
    is_closed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it took before it failed is in memory alone: the disk was full for a moment."""

    async def ask(
        http: aiohttp.ClientSession, page: Page, server: PageServer
    ) -> list[Mapping[str, Any]]:
        def fail() -> None:
            raise RecordingError("the disk is full")

        body = {"tab": TAB, "events": [page.event()]}
        checkpoint = page.desk.recorder.checkpoint
        replies = []
        for path, write in (
            ("/api/events", fail),
            ("/api/events", checkpoint),
            ("/api/hello", checkpoint),
        ):
            monkeypatch.setattr(page.desk.recorder, "checkpoint", write)
            async with http.post(path, json=body, headers={KEY: "key"}) as response:
                replies.append(await response.json())
            if is_closed:  # as its reception does meanwhile
                server._sessions["key"].closed.set()
        return replies

    failure = {"failed": "the recording failed", "ack": -1}
    assert [failure, failure, {"words": {}, **failure}] == serve(tmp_path, ask)


def test_a_connection_that_is_lost_in_the_middle_of_a_post_prints_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async def ask(http: aiohttp.ClientSession, page: Page, server: PageServer) -> None:
        _, writer = await asyncio.open_connection("127.0.0.1", server.port)
        head = f"POST /api/events HTTP/1.1\r\nHost: 127.0.0.1\r\n{KEY}: key\r\nContent-Length: 9"
        writer.write(f"{head}\r\n\r\n{{".encode())
        await writer.drain()
        async with http.post("/api/hello", json={"tab": TAB}, headers={KEY: "key"}) as response:
            assert 200 == response.status  # what came before has been read
        writer.transport.abort()

    serve(tmp_path, ask)  # waits for every handler
    assert "" == caplog.text
