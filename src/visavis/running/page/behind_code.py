"""A page of files that opens by six digits alone: a recorded session seen again in a headset."""

import hmac
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import Final
from urllib.parse import quote

from aiohttp import web

from visavis.lab.clock import Clock
from visavis.running.page.opening_code import MISSING, TOO_MANY, WRONG, OpeningCode
from visavis.running.page.rate_limit import visitor_address
from visavis.running.page.server import SITE, LocalServer, body_of, text_of
from visavis.running.page.steps import PageError

CODE_FILES: Final = {
    "/": "code.html",
    "/code.js": "code.js",
    "/wire.js": "wire.js",
    "/page.css": "page.css",
}
WORDS: Final = {
    MISSING: "Type the six digits.",
    WRONG: "This is not the code. Please look again.",
    TOO_MANY: "Too many wrong codes were typed. Please wait a minute, and type the code again.",
}
POLICY: Final = (
    "default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; media-src blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
"""Of a page that has its code in it, and asks nobody else for anything."""


class PageBehindCode(LocalServer):
    """Own the server of a page and of the files that it loads from beside it.

    Who types the code is led to an address that nobody can guess. It holds as long as the server
    does.
    """

    def __init__(
        self,
        page: Path,
        beside: Iterable[Path],
        code: OpeningCode,
        clock: Clock,
        hosts: tuple[str, ...],
    ) -> None:
        self._code, self._clock = code, clock
        self._key = secrets.token_urlsafe(24)
        self._page = page.name
        self._content = {file.relative_to(page.parent).as_posix(): file for file in (page, *beside)}
        posts, gets = {"/api/open": self._open}, {"/{key}/{name:.+}": self._file_of_page}
        super().__init__(SITE, CODE_FILES, posts, hosts, gets=gets)

    @property
    def page_path(self) -> str:
        """The path of the page's address, for whoever needs no code."""
        return f"/{self._key}/{quote(self._page)}"

    async def _open(self, request: web.Request) -> web.StreamResponse:
        digits = text_of(await body_of(request), "code", is_needed=False)
        address = visitor_address(request.remote or "", request.headers)
        refusal = self._code.refusal(digits, address, self._clock.now_ns())
        if refusal:
            raise PageError(WORDS[refusal])
        return web.json_response({"page": self.page_path})

    async def _file_of_page(self, request: web.Request) -> web.StreamResponse:
        key, file = request.match_info["key"], self._content.get(request.match_info["name"])
        is_key = hmac.compare_digest(key.encode(errors="replace"), self._key.encode())
        if file is None or not is_key:
            raise web.HTTPNotFound
        return web.FileResponse(file, headers={"Content-Security-Policy": POLICY})
