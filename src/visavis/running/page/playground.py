"""A page on this computer alone with one live figure and its sliders, to play with; no session."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from aiohttp import web

from visavis.running.live_store import LiveStore
from visavis.running.page.server import LIVE_FILES, SITE, LocalServer
from visavis.study.live import Live, Slider

PLAY_FILES: Final = {
    "/": "play.html",
    "/play.js": "play.js",
    "/wire.js": "wire.js",
    "/page.css": "page.css",
    **LIVE_FILES,
}
NO_LIMIT_S: Final = 1e9


@dataclass(frozen=True, eq=False)
class Play:
    """What stands on the page: a figure, its sliders, and a command that writes what they make.

    `option` is the option of `command` that takes the sliders' values by their names.
    """

    live: Live
    sliders: Sequence[Slider]
    title: str
    command: str
    option: str


class Playground(LocalServer):
    """Own the server of a page to play with."""

    def __init__(self, play: Play) -> None:
        store = LiveStore((play.live,))
        self._step: Mapping[str, Any] = {
            "title": play.title,
            "command": play.command,
            "option": play.option,
            "live": store.describe(play.live),
            "until": None,
            "is_blind": False,
            "limit_s": NO_LIMIT_S,
            "questions": [
                {"name": s.name, "low": s.low, "high": s.high, "step": s.step, "start": s.start}
                for s in play.sliders
            ],
        }
        self._assets = store.assets
        gets = {"/figure": self._figure, "/assets/{name}": self._asset}
        super().__init__(SITE, PLAY_FILES, {}, gets=gets)

    async def _figure(self, _request: web.Request) -> web.StreamResponse:
        return web.json_response(self._step)

    async def _asset(self, request: web.Request) -> web.StreamResponse:
        content = self._assets.get(request.match_info["name"])
        if content is None:
            raise web.HTTPNotFound
        return web.Response(body=content, content_type="application/octet-stream")
