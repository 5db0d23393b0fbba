"""A page that six digits open: who has them, who guesses, and what lies beside the page."""

import asyncio
import re
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, TypeVar

import aiohttp

from visavis.lab.clock import SimClock
from visavis.running.page.behind_code import POLICY, PageBehindCode
from visavis.running.page.opening_code import MAX_WRONG, OpeningCode
from visavis.running.page.server import HEADERS, OWN_HOSTS

CODE = "123456"
TRIAL = "a b_trials/000_T01.js"
Result = TypeVar("Result")


def serve(root: Path, act: Callable[[aiohttp.ClientSession], Awaitable[Result]]) -> Result:
    """Serve a page with a trial beside it and a file that is none of it; act on it."""
    files = [root / name for name in ("a b.html", TRIAL, "other.txt")]
    for file in files:
        file.parent.mkdir(exist_ok=True)
        file.write_text(file.name, "utf-8")

    async def whole() -> Result:
        code = OpeningCode(CODE)
        server = PageBehindCode(files[0], [files[1]], code, SimClock(), OWN_HOSTS)
        await server.start()
        try:
            async with aiohttp.ClientSession(f"http://127.0.0.1:{server.port}") as http:
                return await act(http)
        finally:
            await server.stop()

    return asyncio.run(whole())


async def open_by(http: aiohttp.ClientSession, digits: str) -> Any:
    """Return what the server answers to a code."""
    async with http.post("/api/open", json={"code": digits}) as response:
        return await response.json()


async def content(http: aiohttp.ClientSession, path: str) -> str | int:
    """Return a file's text, or the status that refuses it."""
    async with http.get(path) as response:
        return await response.text() if response.status == 200 else response.status


def test_the_code_leads_to_the_page_and_to_what_lies_beside_it_alone(tmp_path: Path) -> None:
    async def act(http: aiohttp.ClientSession) -> tuple[str, list[str | int]]:
        page = (await open_by(http, CODE))["page"]
        folder = page.rpartition("/")[0]
        names = ("a%20b.html", TRIAL, "other.txt", "../other.txt", "a b_trials/../other.txt")
        files = [await content(http, f"{folder}/{name}") for name in names]
        strange = [await content(http, f"/{key}/a%20b.html") for key in ("key", folder[1:] + "x")]
        return page, [*files, *strange]

    page, contents = serve(tmp_path, act)
    assert re.fullmatch(r"/[\w-]{32}/a%20b\.html", page)
    assert ["a b.html", "000_T01.js", 404, 404, 404, 404, 404] == contents


def test_who_guesses_the_code_is_told_to_wait_though_it_be_right(tmp_path: Path) -> None:
    async def act(http: aiohttp.ClientSession) -> list[Any]:
        wrong = [await open_by(http, f"{n:06d}") for n in range(int(MAX_WRONG))]
        return [*wrong, await open_by(http, CODE)]

    *wrong, right = serve(tmp_path, act)
    assert all("This is not the code" in answer["refused"] for answer in wrong)
    assert "Too many wrong codes" in right["refused"]


def test_a_page_runs_its_own_code_and_asks_nobody_else(tmp_path: Path) -> None:
    async def act(http: aiohttp.ClientSession) -> list[dict[str, str]]:
        page = (await open_by(http, CODE))["page"]
        headers = []
        for path in ("/", page):
            async with http.get(path) as response:
                headers.append({name: response.headers[name] for name in HEADERS})
        return headers

    first, page = serve(tmp_path, act)
    assert HEADERS == first
    assert HEADERS | {"Content-Security-Policy": POLICY} == page
    assert "default-src 'none'" in POLICY
    assert "connect-src" not in POLICY
