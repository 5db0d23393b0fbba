"""Serve pages of sessions over HTTP: static files, films, and the wire of numbered events."""

import asyncio
import hmac
import logging
import ssl
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

from aiohttp import web, web_response
from aiohttp.http_exceptions import HttpProcessingError
from aiohttp.http_parser import RawRequestMessage
from aiohttp.web_protocol import ERROR

from visavis.lab.errors import DeviceError, RecordingError
from visavis.lab.plain_files import parse_json, with_whole_characters
from visavis.recording.page_clock import MAX_POSTS
from visavis.running.page.desk import PageDesk, Post
from visavis.running.page.rate_limit import visitor_address
from visavis.running.page.steps import (
    BadEventError,
    CannotGoOnError,
    OpenElsewhereError,
    PageError,
    count,
    number,
    unix_ms,
)
from visavis.running.page.streams import POST_BYTES

SITE: Final = Path(__file__).parent / "site"
FILES: Final = {
    "/": "index.html",
    "/page.js": "page.js",
    "/store.js": "store.js",
    "/film.js": "film.js",
    "/flat.js": "flat.js",
    "/dots.js": "dots.js",
    "/panorama.js": "panorama.js",
    "/sound.js": "sound.js",
    "/loading.js": "loading.js",
    "/wire.js": "wire.js",
    "/page.css": "page.css",
}
LIVE_FILES: Final = {
    "/live.js": "live.js",
    "/blend.js": "blend.js",
    "/glb.js": "glb.js",
    "/painting.js": "painting.js",
}
"""What pages with live figures load besides."""
DRAWN_FILM_FILES: Final = {"/drawn_film.js": "drawn_film.js"}
"""What pages that draw films load besides those."""
HEADSET_FILES: Final = {
    "/headset.js": "headset.js",
    "/headset_board.js": "headset_board.js",
    "/headset_space.js": "headset_space.js",
    "/streams.js": "streams.js",
}
"""What pages that enter a headset load besides."""
BOARD_FILES: Final = {"/board": "board.html", "/board.js": "board.js"}
KEY: Final = "X-Visavis-Key"
MAX_REQUEST_BYTES: Final = 1 << 20
MAX_PARAMETERS: Final = 20
SHUTDOWN_S: Final = 5.0
"""How long the server waits for films in transfer when it stops."""
LOCAL: Final = "127.0.0.1"
OWN_HOSTS: Final = (LOCAL, "localhost")
HEADERS: Final = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "connect-src 'self'; media-src blob:; img-src data: blob:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
    "Server": "Visavis",
}
"""Nothing is loaded from third parties, and nothing is sent to them."""
# Answers to broken HTTP are aiohttp's own, which names its version there.
web_response.SERVER_SOFTWARE = HEADERS["Server"]  # type: ignore[attr-defined]  # not public


class _WithoutPeers(logging.Filter):
    """Passes what failed in a request, without the address of whoever sent it; no broken HTTP."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Tell whether a record is printed; its message becomes one without an address."""
        error = record.exc_info[1] if record.exc_info else None
        record.msg, record.args = "a request failed", ()
        return not isinstance(error, HttpProcessingError)


LOG: Final = logging.getLogger("visavis.pages")
LOG.addFilter(_WithoutPeers())

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class StrangerError(Exception):
    """A request that is refused before anything reads it, with the status to answer."""

    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status = status


@dataclass(frozen=True, eq=False)
class PageSession:
    """A session that is being served: its desk, the page's first information, and its lock."""

    desk: PageDesk
    about: Mapping[str, Any]
    films: Mapping[str, Path] = field(default_factory=dict)
    assets: Mapping[str, bytes] = field(default_factory=dict)
    """Files of live figures, by name."""
    lock: asyncio.Lock = field(default_factory=asyncio.Lock)
    over: asyncio.Event = field(default_factory=asyncio.Event)
    closed: asyncio.Event = field(default_factory=asyncio.Event)
    """Set once the recording is closed: the page is told its end, and nothing is written."""
    failures: list[Exception] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class EndedSession:
    """A session that was over before this server began: its page is told how it ended."""

    outcome: str
    about: Mapping[str, Any]

    def state(self) -> dict[str, Any]:
        """Return the final state for the page."""
        return {"ack": 0, "number": 0, "step": {"kind": "end", "outcome": self.outcome}}


class Reception(Protocol):
    """Opens sessions for people who have none yet, and for those whose session is not open."""

    board_key: str

    async def arrive(
        self, parameters: Mapping[str, str], before: str = "", address: str = "", code: str = ""
    ) -> Mapping[str, Any]:
        """Return the key of a session for a person who arrives, or why there is none.

        `before` is the key that their browser remembers, "" where it remembers none; `address` is
        where the request came from, "" where nobody knows, and is kept nowhere; `code` is what
        they typed of the code that opens sessions, where there is one.
        """
        ...

    async def session_of(self, key: str, new_tab: str = "") -> PageSession | EndedSession | None:
        """Return the session of a key, continued where it was left.

        `new_tab` is a page that says hello.
        """
        ...

    async def board(self) -> Mapping[str, Any]:
        """Return what the researcher's page shows."""
        ...


class LocalServer:
    """Own a server of this computer's pages: the files of a site, and handlers of requests.

    `files` maps paths to files of the folder `site`; `posts` and `gets` map paths to handlers.
    `hosts` are the host names it accepts, so that no other site's page can send requests here.
    No address of a visitor is stored or logged; how often one arrives is in memory alone.
    """

    def __init__(
        self,
        site: Path,
        files: Mapping[str, str],
        posts: Mapping[str, Handler],
        hosts: tuple[str, ...] = OWN_HOSTS,
        gets: Mapping[str, Handler] | None = None,
    ) -> None:
        self._hosts = hosts
        self._site = site
        self._files = files
        self._app = web.Application(client_max_size=MAX_REQUEST_BYTES, middlewares=[self._guard])
        for path in files:
            self._app.router.add_get(path, self._file)
        for path, answer in posts.items():
            self._app.router.add_post(path, answer)
        for path, answer in (gets or {}).items():
            self._app.router.add_get(path, answer)
        self._runner = web.AppRunner(
            self._app, access_log=None, logger=LOG, shutdown_timeout=SHUTDOWN_S
        )
        self.port = 0

    async def start(
        self, host: str = LOCAL, port: int = 0, tls: ssl.SSLContext | None = None
    ) -> None:
        """Begin to listen; port 0 takes a free one, `tls` makes it https.

        Raises:
            DeviceError: the port is taken.
        """
        await self.make_ready()
        try:
            await web.TCPSite(self._runner, host, port, ssl_context=tls).start()
        except OSError as error:
            await self._runner.cleanup()
            raise DeviceError(
                f"cannot listen at {host}:{port} ({error.strerror or error})",
                role="page",
                remedy="end what uses it, or give another one with --port",
            ) from error
        self.port = int(self._runner.addresses[0][1])

    async def make_ready(self) -> web.Server:
        """Make ready what answers connections, and return it; nobody can reach it yet."""
        await self._runner.setup()
        server = self._runner.server
        assert server is not None  # noqa: S101  # it is made there
        as_read = server.request_factory

        def request(message: RawRequestMessage, *more: Any) -> web.BaseRequest:
            return as_read(message if _can_be_handled(message) else ERROR, *more)

        server.request_factory = request
        return server

    async def stop(self) -> None:
        """Stop listening."""
        await self._runner.cleanup()

    def address(self, key: str) -> str:
        """Return the address of a page; its key is a URL fragment, which no log contains."""
        return f"http://{LOCAL}:{self.port}/#{key}"

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            self._refuse_strangers(request)
            response = await handler(request)
        except web.HTTPRequestEntityTooLarge:
            why = f"a post has at most {MAX_REQUEST_BYTES} bytes; send {POST_BYTES} at once"
            response = _refusal(413, why, max_bytes=POST_BYTES)
        except web.HTTPClientError as answer:  # no such path or method
            response = _refusal(answer.status, answer.reason)
        except StrangerError as error:
            response = _refusal(error.status, str(error))
        except OpenElsewhereError as error:
            response = _refusal(409, str(error))
        except BadEventError as error:
            response = _refusal(400, str(error), event=error.n)
        except PageError as error:
            response = _refusal(400, str(error))
        except CannotGoOnError as error:
            response = _refusal(500, str(error))
        except (ValueError, OverflowError, RecursionError):
            response = _refusal(400, "that is not JSON")
        except web.HTTPException:  # not modified, or another part of a film
            raise
        except ConnectionError:  # of whoever sent it: nobody hears the answer
            response = _refusal(400, "the connection was lost")
        except Exception:
            LOG.exception("a request failed")
            response = _refusal(500, "it failed")
        if not response.prepared:
            for name, value in HEADERS.items():
                response.headers.setdefault(name, value)
        return response

    def _refuse_strangers(self, request: web.Request) -> None:
        """Refuse broken requests, other host names, and what pages of other sites send here.

        A page can post to any address without asking, but only as a form or as plain text, and
        browsers say where it comes from. Programs say neither; they have JSON or the key.

        Raises:
            StrangerError: it is one of these.
        """
        if request.method == ERROR.method:
            raise StrangerError(400, "that is no request")
        try:  # what files are answered with reads them too, where nothing of ours hears of an error
            _ = request.if_modified_since, request.if_unmodified_since, request.if_range
        except OverflowError as error:
            raise StrangerError(400, "no clock shows the time in its headers") from error
        if request.host.partition(":")[0] not in self._hosts:
            raise StrangerError(403, "this address is not served")
        if request.method in ("GET", "HEAD", "OPTIONS"):
            return
        if request.headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none"):
            raise StrangerError(403, "pages of other sites send nothing here")
        origin = request.headers.get("Origin", "")
        if origin and origin.partition("://")[2] != request.host:
            host = origin.partition("://")[2].partition(":")[0]
            if host not in self._hosts or host in OWN_HOSTS:  # behind a proxy, names may differ
                raise StrangerError(403, "pages of other sites send nothing here")
        if request.content_type != "application/json" and KEY not in request.headers:
            raise StrangerError(415, "a request is JSON, and says so")

    async def _file(self, request: web.Request) -> web.StreamResponse:
        return web.FileResponse(self._site / self._files[request.path])


class PageServer(LocalServer):
    """Own the server of participants' pages.

    Sessions are added by their keys, or received by a `reception`.
    """

    def __init__(
        self, hosts: tuple[str, ...] = OWN_HOSTS, reception: Reception | None = None
    ) -> None:
        self._reception = reception
        self._sessions: dict[str, PageSession] = {}
        files = FILES | LIVE_FILES | DRAWN_FILM_FILES | HEADSET_FILES
        posts: dict[str, Handler] = {
            "/api/hello": self._hello,
            "/api/events": self._events,
            "/api/leave": self._leave,
        }
        if reception is not None:
            files |= BOARD_FILES
            posts |= {"/api/arrive": self._arrive, "/api/board": self._board}
        super().__init__(SITE, files, posts, hosts)
        self._app.router.add_get("/films/{name}", self._film)
        self._app.router.add_get("/assets/{name}", self._asset)

    def add(self, session: PageSession) -> None:
        """Serve a session; mark one that is over already, so that nobody waits for it."""
        self._sessions[session.desk.key] = session
        if session.desk.is_over:
            session.over.set()

    def address_of(self, session: PageSession) -> str:
        """Return the address of a session's page."""
        return self.address(session.desk.key)

    # ---- within ------------------------------------------------------------------------------

    async def _film(self, request: web.Request) -> web.StreamResponse:
        session = await self._of(request.headers.get(KEY, ""))
        if isinstance(session, EndedSession):
            raise PageError("the session is over")
        path = session.films.get(request.match_info["name"])
        if path is None:
            raise PageError("there is no such film")
        return web.FileResponse(path, headers={"Content-Type": "video/webm"})

    async def _asset(self, request: web.Request) -> web.StreamResponse:
        session = await self._of(request.headers.get(KEY, ""))
        if isinstance(session, EndedSession):
            raise PageError("the session is over")
        data = session.assets.get(request.match_info["name"])
        if data is None:
            raise PageError("there is no such file")
        return web.Response(body=data, content_type="application/octet-stream")

    async def _hello(self, request: web.Request) -> web.StreamResponse:
        body = await body_of(request)
        tab = text_of(body, "tab")
        session = await self._of(request.headers.get(KEY, ""), tab)
        if isinstance(session, EndedSession):
            return web.json_response({**session.about, **session.state()})
        about = body.get("about")
        at_ms = number(body.get("at_ms", 0.0), "at_ms")

        def hello() -> None:
            session.desk.hello(
                tab,
                before=text_of(body, "before", is_needed=False),
                takes_over=body.get("takes_over") is True,
                about=about if isinstance(about, dict) else {},
                at_ms=at_ms,
            )

        message = {**session.about, **await self._act(session, hello)}
        if session.desk.headset_streams:
            message["streams"] = session.desk.next_rows
        return web.json_response(message)

    async def _events(self, request: web.Request) -> web.StreamResponse:
        session = await self._of(request.headers.get(KEY, ""))
        if isinstance(session, EndedSession):
            return web.json_response(session.state())
        in_ns = session.desk.clock.now_ns()  # before the body, which may take long
        body = await body_of(request)
        tab = text_of(body, "tab")
        events = body.get("events", [])
        if not isinstance(events, list):
            raise PageError("events are a list")
        post = _post_of(body, in_ns)
        message = await self._act(session, lambda: session.desk.take(tab, events, post))
        response = web.json_response(message)
        if post is not None:
            session.desk.note_answer(tab, post)
        return response

    async def _arrive(self, request: web.Request) -> web.StreamResponse:
        body = await body_of(request)
        content = body.get("parameters", body.get("told", {}))  # `told`: a page loaded before 0.3
        before = text_of(body, "before", is_needed=False)
        if not isinstance(content, Mapping) or len(content) > MAX_PARAMETERS:
            raise PageError(f"parameters are at most {MAX_PARAMETERS} short texts")
        assert self._reception is not None  # noqa: S101  # the route exists only with it
        parameters = {str(name): text_of(content, str(name), is_needed=False) for name in content}
        address = visitor_address(request.remote or "", request.headers)
        code = text_of(body, "code", is_needed=False)
        return web.json_response(await self._reception.arrive(parameters, before, address, code))

    async def _board(self, request: web.Request) -> web.StreamResponse:
        assert self._reception is not None  # noqa: S101  # as above
        key, board_key = request.headers.get(KEY, ""), self._reception.board_key
        if not hmac.compare_digest(key.encode(errors="replace"), board_key.encode()):
            raise PageError("this address shows no board; take the one that was printed")
        return web.json_response(await self._reception.board())

    async def _leave(self, request: web.Request) -> web.StreamResponse:
        body = await body_of(request)
        session, tab = await self._of(text_of(body, "key")), text_of(body, "tab")
        if isinstance(session, PageSession):
            session.desk.leave(tab)
        return web.json_response({})

    async def _act(self, session: PageSession, act: Callable[[], bool | None]) -> dict[str, Any]:
        """Act, wait until everything is on the disk, and return the state for the page.

        If `act` returns False, it wrote nothing and there is no wait.
        """

        def whole() -> dict[str, Any]:
            if session.failures:  # its last state is in memory alone
                raise session.failures[0]
            if session.closed.is_set():
                return session.desk.state()
            if act() is not False:
                session.desk.recorder.checkpoint()
            return session.desk.state()

        async with session.lock:
            try:
                if session.desk.clock.is_virtual:
                    message = whole()
                else:
                    message = await asyncio.to_thread(whole)
            except (PageError, OpenElsewhereError):
                raise
            except Exception as error:
                if error not in session.failures:
                    session.failures.append(error)
                session.over.set()
                reason = (
                    "the recording failed" if isinstance(error, RecordingError) else "it failed"
                )
                return {"failed": reason, "ack": -1}
            if session.desk.is_over:
                session.over.set()
            return message

    async def _of(self, key: str, new_tab: str = "") -> PageSession | EndedSession:
        session: PageSession | EndedSession | None = self._sessions.get(key)
        if session is None and self._reception is not None:
            session = await self._reception.session_of(key, new_tab)
        if session is None:
            raise PageError("this address leads to no session; ask for a new one")
        return session


def _post_of(body: Mapping[str, Any], in_ns: int) -> Post | None:
    """Return when a post left its page and when earlier answers came there; None if untold.

    Raises:
        PageError: what it says are no times.
    """
    if body.get("sent_ms") is None or body.get("wall_ms") is None:
        return None
    out_ms, wall_ms = number(body["sent_ms"], "sent_ms"), unix_ms(body["wall_ms"], "wall_ms")
    answers = body.get("heard", [])
    if not isinstance(answers, list) or len(answers) > MAX_POSTS:
        raise PageError(f"heard is a list of at most {MAX_POSTS} answers")
    if any(not isinstance(pair, list) or len(pair) != 2 for pair in answers):
        raise PageError("heard are pairs of a post and when its answer came")
    pairs = tuple((count(n, "heard"), number(at_ms, "heard")) for n, at_ms in answers)
    of_page = body.get("post")
    return Post(out_ms, wall_ms, None if of_page is None else count(of_page, "post"), in_ns, pairs)


def _can_be_handled(message: RawRequestMessage) -> bool:
    """Tell whether aiohttp comes as far as our handlers with what it has read.

    It needs a URL, which `CONNECT` to nobody has not, and answers with the text of an expectation.
    """
    return message.url is not None and message.headers.get("Expect", "").isascii()


def _refusal(status: int, why: str, **more: int) -> web.Response:
    return web.json_response({"refused": why, **more}, status=status)


async def body_of(request: web.Request) -> Mapping[str, Any]:
    """Return the posted object; raises PageError if it is not an object."""
    try:
        body = await request.json(loads=parse_json)
    except LookupError as error:
        raise PageError(f"nobody knows the encoding {request.charset}") from error
    if not isinstance(body, Mapping):
        raise PageError("a request is an object")
    whole: Mapping[str, Any] = with_whole_characters(body)
    return whole


def text_of(body: Mapping[str, Any], name: str, *, is_needed: bool = True) -> str:
    """Return a short text from a posted object; raises PageError if it is not one."""
    text = body.get(name, "")
    if not isinstance(text, str) or len(text) > 200 or (is_needed and not text):
        raise PageError(f"{name} is a short text")
    return text
