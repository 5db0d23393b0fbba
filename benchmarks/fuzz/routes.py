"""What answers a GET over HTTP: a target per server, given the bytes of whole requests.

The servers of pages and desk read them from a pair of sockets, so that path, query, headers and
cookies go the way of a browser's. An answer is sound if it is one that these servers give: what
they serve, whole or a part of it, or a refusal that names no folder of this computer.
"""

import asyncio
import json
import logging
import re
import socket
from collections.abc import Callable, Coroutine, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.cross_site import Everybody
from benchmarks.fuzz.damage import ONE_TO_THREE, WORDS, damaged
from benchmarks.fuzz.target import Target
from tests.faults.sessions import lab
from tests.running.page.pages import begin_session
from visavis.cli.desk.server import FILES as DESK_FILES
from visavis.cli.desk.server import SITE as DESK_SITE
from visavis.cli.desk.server import DeskServer
from visavis.running.page.server import (
    BOARD_FILES,
    DRAWN_FILM_FILES,
    FILES,
    HEADSET_FILES,
    KEY,
    LIVE_FILES,
    LOG,
    SITE,
    LocalServer,
    PageServer,
    PageSession,
)

QUIET_TURNS: Final = 30
"""Turns of the loop without a byte after which nothing more comes: nothing waits for a thread."""
MAX_TURNS: Final = 20_000
WHOLE: Final = (200, 206)
REFUSED: Final = (100, 304, 400, 403, 404, 405, 412, 413, 415, 416, 417)
STATUS: Final = re.compile(rb"HTTP/\d\.\d (\d{3})[^\r\n]*\r\n")  # of the version asked for
LENGTH: Final = re.compile(rb"(?im)^content-length: *(\d+)\r?$")
IN_CHUNKS: Final = re.compile(rb"(?im)^transfer-encoding: *chunked\r?$")
CHUNK: Final = re.compile(rb"([0-9a-f]+)\r\n")
PATHS: Final = (
    b"..",
    b"../",
    b"%2e%2e%2f",
    b"%5c",
    b"//",
    b"\\",
    b"%00",
    b"%c0%ae",
    b"%",
    b"%zz",
    b"?",
    b"#",
    b";",
    b"*",
    b"http://127.0.0.1/",
    b"//other.example/",
    b"?a=1&a=2",
    b"?=&&",
    b"\xc3\xa4",
    b"/" * 300,
    b"?" + b"a=b&" * 3000,
    b"%0d%0aSet-Cookie:a=b",
    b"films",
    b"assets",
    b"server.py",
    b"/etc/passwd",
)
"""What is put into a path."""
HEADERS: Final = (
    b"Range: bytes=-0",
    b"Range: bytes=5-2",
    b"Range: bytes=0-0,2-3,1-",
    b"Range: items=0-5",
    b"Range: bytes=99999999999999999999-",
    b"Range: bytes=-99999999999999999999",
    b"Range: \xff",
    b"If-Range: x",
    b"If-None-Match: *",
    b'If-None-Match: W/"x", "',
    b'If-Match: "x"',
    b"If-Modified-Since: Thu, 01 Jan 99999 00:00:00 GMT",
    b"If-Modified-Since: -1",
    b"If-Unmodified-Since: Thu, 01 Jan 1970 00:00:00 GMT",
    b'Cookie: a="; b=c; =; ;',
    b"Cookie: \x01",
    b"Cookie: " + b"a=b; " * 1500,
    b"Cookie: $Version=1; __Host-a=b",
    b"Host: other.example",
    b"Host: [::1",
    b"Host: 127.0.0.1:99999999",
    b"Host:",
    b"X-Visavis-Key: \xff\xfe",
    b"X-Visavis-Key: ../x",
    b"Accept-Encoding: gzip, br;q=x, *",
    b"Content-Length: 5",
    b"Content-Length: -1",
    b"Content-Length: 99999999999999999999",
    b"Transfer-Encoding: chunked",
    b"Transfer-Encoding: gzip, chunked",
    b"Expect: 100-continue",
    b"Expect: x",
    b"Connection: close",
    b"Upgrade: websocket\r\nConnection: Upgrade",
    b"X-Forwarded-For: ::1%eth0, \xff",
    b"Origin: null",
    b"Sec-Fetch-Site: cross-site",
    b"Content-Type: text/html; charset=foo",
    b" folded",
    b": x",
)
"""Lines that are put between the others."""
METHODS: Final = (b"HEAD", b"OPTIONS", b"POST", b"TRACE", b"CONNECT", b"PUT", b"get", b"PRI")


class _AtOnce(ThreadPoolExecutor):
    """Does at once what the loop would give to a thread, so that nothing goes on beside it."""

    def submit(self, act: Callable[..., Any], /, *args: Any, **named: Any) -> "Future[Any]":
        """Do it; return what it did."""
        future: Future[Any] = Future()
        try:
            future.set_result(act(*args, **named))
        except BaseException as error:  # whoever waits gets it
            future.set_exception(error)
        return future


class _Errors(logging.Handler):
    """Collects what the server would print for its operator."""

    def __init__(self) -> None:
        super().__init__()
        self.problems: list[BaseException] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Take the error of a record."""
        error = record.exc_info[1] if record.exc_info else None
        self.problems.append(error or RuntimeError(record.getMessage()))

    def of_loop(self, _: asyncio.AbstractEventLoop, context: Mapping[str, Any]) -> None:
        """Take an error that nobody waited for."""
        self.problems.append(context.get("exception") or RuntimeError(context["message"]))


@dataclass(frozen=True)
class Answer:
    """One answer: its status, its head and what followed."""

    status: int
    head: bytes
    body: bytes


class Asked:
    """Own a server that listens to nobody; hand it the bytes of requests."""

    def __init__(self, server: LocalServer) -> None:
        self._server, self._errors = server, _Errors()
        self._loop = asyncio.new_event_loop()
        self._loop.set_default_executor(_AtOnce())
        self._loop.set_exception_handler(self._errors.of_loop)
        self._loop.set_task_factory(self._task)
        self._tasks: list[asyncio.Task[Any]] = []
        self._protocols = self._loop.run_until_complete(server.make_ready())

    def answers(self, data: bytes) -> tuple[Answer, ...]:
        """Send the bytes of a connection; return what is answered before nothing more comes.

        Raises:
            Exception: what the server would have printed, or the loop.
        """
        self._tasks.clear()
        self._errors.problems.clear()
        LOG.addHandler(self._errors)
        answer_bytes = self._loop.run_until_complete(self._sent(data))
        LOG.removeHandler(self._errors)
        for error in (*self._errors.problems, *_failures(self._tasks)):
            raise error
        return answers_in(answer_bytes)

    def close(self) -> None:
        """Stop the server, and the loop it answered in."""
        self._loop.run_until_complete(self._server.stop())
        self._loop.close()

    def _task(
        self,
        loop: asyncio.AbstractEventLoop,
        act: Coroutine[Any, Any, Any] | Generator[Any, None, Any],
        /,
        **named: Any,
    ) -> "asyncio.Task[Any]":
        task = asyncio.Task(act, loop=loop, **named)
        self._tasks.append(task)
        return task

    async def _sent(self, data: bytes) -> bytes:
        here, there = socket.socketpair()
        with here:
            here.setblocking(False)
            await self._loop.connect_accepted_socket(self._protocols, there)
            answer_bytes, quiet, unsent = b"", 0, data
            for _ in range(MAX_TURNS):
                await asyncio.sleep(0)
                quiet += 1
                try:
                    if unsent:
                        unsent, quiet = unsent[here.send(unsent) :], 0
                    piece = here.recv(1 << 16)
                except BlockingIOError:
                    piece = None
                except ConnectionError:  # it was closed before all was sent
                    break
                if piece == b"":
                    break
                if piece:
                    answer_bytes, quiet = answer_bytes + piece, 0
                if quiet >= QUIET_TURNS:
                    break
            else:
                raise RuntimeError(f"no end of an answer after {len(answer_bytes)} bytes")
        for _ in range(QUIET_TURNS):  # the server notices that the connection is gone
            await asyncio.sleep(0)
        return answer_bytes


def _failures(tasks: Sequence["asyncio.Task[Any]"]) -> list[BaseException]:
    """Return why tasks ended early, which nobody else asks before they are collected."""
    ended = (task.exception() for task in tasks if task.done() and not task.cancelled())
    return [error for error in ended if error and not isinstance(error, ConnectionError)]


def answers_in(answer_bytes: bytes) -> tuple[Answer, ...]:
    """Return the answers that a connection brought; a second one follows the length of the first.

    Raises:
        ValueError: they are no answers.
    """
    answers = []
    while answer_bytes:
        head, mark, rest = answer_bytes.partition(b"\r\n\r\n")
        status = STATUS.match(head + b"\r\n")
        if status is None or not mark:
            raise ValueError(f"no answer: {answer_bytes[:80]!r}")
        length = LENGTH.search(head)
        if STATUS.match(rest):  # of HEAD there is the head alone
            body, answer_bytes = b"", rest
        elif IN_CHUNKS.search(head):
            body, answer_bytes = _of_chunks(rest)
        else:
            n = 0 if length is None else int(length[1])
            body, answer_bytes = rest[:n], rest[n:]
        answers.append(Answer(int(status[1]), head, body))
    return tuple(answers)


def _of_chunks(rest: bytes) -> tuple[bytes, bytes]:
    """Return what chunks hold, and what follows them."""
    body = b""
    while rest:
        size = CHUNK.match(rest)
        if size is None:
            raise ValueError(f"no chunk: {rest[:80]!r}")
        begin, n = size.end(), int(size[1], 16)
        body, rest = body + rest[begin : begin + n], rest[begin + n + 2 :]
        if n == 0:
            break
    return body, rest


def asked_again(data: bytes, other: bytes, drawn: Iterator[int]) -> bytes:
    """Return the bytes of a request with one to three things done to it."""
    for _ in range(ONE_TO_THREE[next(drawn) % 5]):
        kind = next(drawn) % 6
        lines = data.split(b"\r\n")
        method, _, rest = lines[0].partition(b" ")
        path, _, version = rest.rpartition(b" ")
        if kind == 0:
            data = damaged(data, other, drawn)
        elif kind <= 2:
            at, piece = next(drawn) % (len(path) + 1), PATHS[next(drawn) % len(PATHS)]
            lines[0] = b" ".join((method, path[:at] + piece + path[at:], version))
            data = b"\r\n".join(lines)
        elif kind == 3:
            lines.insert(1 + next(drawn) % len(lines), HEADERS[next(drawn) % len(HEADERS)])
            data = b"\r\n".join(lines)
        elif kind == 4:
            at, word = next(drawn) % len(lines), WORDS[next(drawn) % len(WORDS)]
            lines[at] = lines[at].partition(b":")[0] + b": " + word
            data = b"\r\n".join(lines)
        else:
            lines[0] = b" ".join((METHODS[next(drawn) % len(METHODS)], path, version))
            data = b"\r\n".join(lines)
    return data


def request_of(path: str, *headers: str) -> bytes:
    """Return the bytes of a request as a browser sends it."""
    usual = (
        "Host: 127.0.0.1",
        "Accept: */*",
        "Accept-Encoding: gzip",
        "Sec-Fetch-Site: same-origin",
    )
    return "\r\n".join((f"GET {path} HTTP/1.1", *usual, *headers, "", "")).encode()


def is_served(known: Sequence[bytes], root: Path) -> Callable[[object], bool]:
    """Return what tells whether answers hold what is served, whole or in part, or a refusal."""
    contents, folders = frozenset(known), (str(root).encode(), str(SITE.parent).encode())

    def is_sound(answers: object) -> bool:
        assert isinstance(answers, tuple)
        return all(map(_is_one, answers))

    def _is_one(answer: Answer) -> bool:
        if any(folder in answer.head + answer.body for folder in folders):
            return False
        if answer.status == 200:
            return answer.body in contents or not answer.body  # of HEAD there is the head alone
        if answer.status == 206:
            return any(answer.body in content for content in contents)
        return answer.status in REFUSED

    return is_sound


@contextmanager
def routes(root: Path) -> Iterator[tuple[Target, ...]]:
    """Give a target per server; they end with it."""
    film, asset = bytes(range(256)) * 9, b"\x00asset\xff" * 40
    root.mkdir(parents=True, exist_ok=True)
    (root / "film.webm").write_bytes(film)
    desk = DeskServer(lab(root))
    with ExitStack() as stack:
        page, _ = stack.enter_context(begin_session(root / "data"))
        pages = PageServer(reception=Everybody("board"))
        pages.add(PageSession(page.desk, {}, {"f" * 64: root / "film.webm"}, {"a" * 64: asset}))
        served = FILES | LIVE_FILES | DRAWN_FILM_FILES | HEADSET_FILES | BOARD_FILES
        key = f"{KEY}: {page.desk.key}"
        old = "If-Modified-Since: Thu, 01 Jan 2026 00:00:00 GMT"
        yield (
            _target(
                stack,
                "http GET pages",
                pages,
                (
                    request_of("/?participant=07&lang=en", "Cookie: a=b; c=d"),
                    request_of("/page.js", 'If-None-Match: "1-2"', old),
                    request_of(f"/films/{'f' * 64}", key, "Range: bytes=3-900"),
                    request_of(f"/films/{'f' * 64}", key),
                    request_of(f"/assets/{'a' * 64}", key, "Cookie: a=b"),
                    request_of("/board"),
                ),
                is_served((film, asset, *_contents(SITE, served)), root),
            ),
            _target(
                stack,
                "http GET desk",
                desk._server,  # noqa: SLF001  # no port between
                (
                    request_of("/"),
                    request_of("/desk.js", "Range: bytes=5-"),
                    request_of("/api/v1/sessions", f"{KEY}: {desk.key}"),
                ),
                is_served(
                    (json.dumps({"sessions": []}).encode(), *_contents(DESK_SITE, DESK_FILES)), root
                ),
            ),
        )


def _target(
    stack: ExitStack,
    name: str,
    server: LocalServer,
    samples: tuple[bytes, ...],
    is_sound: Callable[[object], bool],
) -> Target:
    asked = Asked(server)
    stack.callback(asked.close)
    return Target(name, samples, asked.answers, is_sound=is_sound, change=asked_again, share_01=0.1)


def _contents(site: Path, files: Mapping[str, str]) -> tuple[bytes, ...]:
    return tuple((site / name).read_bytes() for name in files.values())
