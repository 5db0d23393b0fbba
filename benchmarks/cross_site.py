"""Let pages of other sites send everything a browser can send, and count what is let in.

python -m benchmarks.cross_site [--browsers chromium firefox] [--json]

A served study, the desk and its port for LabRecorder's commands run in this process. A browser
opens a page of another site (localhost), of another port of this computer, and one without an
origin (a sandboxed frame), which send to every endpoint: each method, content type and mode of
`fetch`, forms of each encoding, beacons, WebSockets and event sources. `sent` counts what arrived,
`let_in` what anything but the refusal answered of what may change something, `read` the answers
that the page could read, `commands` those that reached the desk's sessions. `own` is what the
study's own page sent, by the same browser, and was answered: 1, or this would prove nothing.
"""

import argparse
import asyncio
import http.server
import json
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from aiohttp import web

from tests.faults.sessions import lab
from tests.firefox import firefox
from tests.firefox import program as firefox_program
from visavis.cli.desk.server import DeskServer
from visavis.running.page.server import LOCAL, LocalServer, PageServer

BROWSERS: Final = ("chromium", "firefox")
PAGE_PATHS: Final = (
    *(f"/api/{name}" for name in ("arrive", "hello", "events", "leave", "board")),
    *("/", "/films/x", "/assets/x", "/board"),
)
DESK_PATHS: Final = (
    *(f"/api/{name}" for name in ("live", "today", "doctor", "command", "v1/command")),
    "/api/v1/sessions",
)
RCS_PATHS: Final = ("/", "/%0Astop%0A")
SAFE: Final = ("GET", "HEAD", "OPTIONS")
REFUSED: Final = (403, 404, 405, 413, 415)
ATTACK: Final = """
async ([base, path]) => {
  const methods = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"];
  const types = ["text/plain", "application/x-www-form-urlencoded", "application/json",
                 "multipart/form-data; boundary=x", "application/json; charset=utf-16", ""];
  const content = {tab: "t", key: "key", action: "abort", parameters: {}, events: []};
  const body = "\\nstop\\n" + JSON.stringify(content) + "\\nstop\\n";
  // Only what is posted is read. Else it matters whether a browser asks before it sends.
  const typesOf = (method) => method === "POST" ? types : ["text/plain", "application/json"];
  let read = 0;
  const ask = async (method, type, mode) => {
    const headers = type ? {"Content-Type": type} : {};
    const given = {method, mode, credentials: "include", headers, redirect: "follow"};
    if (!["GET", "HEAD"].includes(method)) given.body = body;
    try {
      const answer = await fetch(base + path, given);
      if (answer.type !== "opaque") read += 1;
    } catch (error) { /* the browser or the server refused */ }
  };
  const ends = ["no-cors", "cors"].flatMap((mode) => methods.flatMap(
    (method) => typesOf(method).map((type) => ask(method, type, mode))));
  for (const type of types)
    try {
      navigator.sendBeacon(base + path, new Blob([body], {type}));
    } catch (error) { /* as above */ }
  // A frame that stays keeps its process; a form that gets knows one encoding.
  for (const [i, [method, encoding]] of [...types.slice(0, 2).concat("multipart/form-data").map(
       (encoding) => ["post", encoding]), ["get", types[1]]].entries()) {
    const frame = document.getElementsByName("f" + i)[0] ?? document.createElement("iframe");
    frame.name = "f" + i;
    const form = Object.assign(document.createElement("form"),
                               {action: base + path, method, target: frame.name});
    form.enctype = encoding;
    const said = {name: "\\nstop\\n", value: body};
    form.append(Object.assign(document.createElement("input"), said));
    document.body.append(...(frame.isConnected ? [] : [frame]), form);
    ends.push(new Promise((done) => { frame.onload = done; setTimeout(done, 1500); }));
    form.submit();
    form.remove();
  }
  for (const kind of [EventSource, WebSocket])
    try {
      const wire = new kind((kind === WebSocket ? base.replace("http", "ws") : base) + path);
      ends.push(new Promise((done) => { wire.onerror = done; setTimeout(done, 1500);
                                        wire.onopen = () => { read += 1; done(); };
                                        wire.onmessage = () => { read += 1; done(); };
      }).then(() => wire.close()));
    } catch (error) { /* as above */ }
  await Promise.all(ends);
  return read;
}
"""
OWN: Final = """
fetch("/api/arrive", {method: "POST", headers: {"Content-Type": "application/json"},
                      body: '{"parameters": {}}'}).then((answer) => answer.status)
"""
SANDBOX: Final = """<!doctype html><iframe sandbox="allow-scripts allow-forms" srcdoc="<script>
addEventListener('message', async (event) => {
  const attack = (0, eval)('(' + event.data.code + ')');
  parent.postMessage(await attack(event.data.given), '*');
});</script>"></iframe>"""
INSIDE: Final = """
new Promise((done) => {
  addEventListener("message", (event) => done(event.data), {once: true});
  document.querySelector("iframe").contentWindow.postMessage(%s, "*");
})
"""

Evaluate = Callable[[str], Any]
"""Returns what code gives in the page that is open."""


@dataclass
class Outcome:
    """What a browser's pages of other sites did."""

    sent: int = 0
    let_in: int = 0
    read: int = 0
    commands: int = 0
    own: int = 0
    where: list[str] = field(default_factory=list)

    @property
    def is_clean(self) -> bool:
        """Tell whether nothing was let in, and the study's own page was."""
        return not (self.let_in or self.read or self.commands) and self.own == 1


class Everybody:
    """A reception that lets in whoever gets to it, and counts them."""

    def __init__(self, board_key: str = "board") -> None:
        self.board_key = board_key
        self.arrivals = 0

    async def arrive(
        self, parameters: Mapping[str, str], before: str = "", address: str = "", code: str = ""
    ) -> Mapping[str, Any]:
        """Let somebody in."""
        self.arrivals += 1
        return {"key": "key"}

    async def session_of(self, key: str, new_tab: str = "") -> None:
        """Return no session."""

    async def board(self) -> Mapping[str, Any]:
        """Return an empty board."""
        return {}


class Targets:
    """Own the servers in a thread of their own, and note what they answered to other sites."""

    def __init__(self, root: Path) -> None:
        self._lab = lab(root)
        self._loop = asyncio.new_event_loop()
        self._ready, self._end = threading.Event(), asyncio.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self.addresses: dict[str, tuple[str, ...]] = {}
        self.study = ""
        self.reception = Everybody()
        self.answers: list[tuple[str, str, str, int]] = []
        self.commands = 0

    def start(self) -> None:
        """Serve, and wait until it does."""
        self._thread.start()
        self._ready.wait()

    def stop(self) -> None:
        """End the servers."""
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()

    def _serve(self) -> None:
        self._loop.run_until_complete(self._all())

    async def _all(self) -> None:
        pages, desk = PageServer(reception=self.reception), DeskServer(self._lab)
        desk_pages = desk._server  # noqa: SLF001  # what is counted is within
        for one in (pages, desk_pages):
            self._note(one)
        watch = desk._watch  # noqa: SLF001  # as above
        watch.tell = self._command  # type: ignore[method-assign,assignment]  # counted, not obeyed
        await pages.start()
        self.study = f"http://{LOCAL}:{pages.port}"
        address = await desk.start()
        port = await desk.listen_as_lab_recorder(0)
        running = asyncio.create_task(desk.run())
        self.addresses = {
            self.study: PAGE_PATHS,
            address.partition("/#")[0]: DESK_PATHS,
            f"http://{LOCAL}:{port}": RCS_PATHS,
        }
        self._ready.set()
        await self._end.wait()
        running.cancel()
        await asyncio.wait([running])
        await pages.stop()

    async def _command(self, *_: object) -> bool:
        self.commands += 1
        return True

    def _note(self, server: LocalServer) -> None:
        async def note(request: web.Request, response: web.StreamResponse) -> None:
            site = request.headers.get("Sec-Fetch-Site", "")
            self.answers.append((request.method, request.path, site, response.status))

        server._app.on_response_prepare.append(note)  # noqa: SLF001  # as above


@contextmanager
def other_site() -> Iterator[int]:
    """Serve a page of somebody else's on this computer; give its port."""

    class Page(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            text = SANDBOX if self.path == "/sandbox" else "<!doctype html><p>a page"
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(text.encode())

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    server = http.server.ThreadingHTTPServer((LOCAL, 0), Page)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()


@contextmanager
def chromium(profile: Path) -> Iterator[tuple[Callable[[str], Any], Evaluate]]:
    """Begin a Chromium without a window; give how to open an address and run code there."""
    from playwright.sync_api import sync_playwright  # a test's package: --help needs none

    program = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as started:
        opened = started.chromium.launch(executable_path=program, args=["--no-sandbox"])
        page = opened.new_page()
        yield page.goto, page.evaluate
        opened.close()


@contextmanager
def gecko(profile: Path) -> Iterator[tuple[Callable[[str], Any], Evaluate]]:
    """Begin a Firefox without a window; give how to open an address and run code there."""
    profile.mkdir()
    with firefox(profile) as window:
        yield window.goto, window.evaluate


PROGRAMS: Final = {"chromium": chromium, "firefox": gecko}


def is_there(browser: str) -> bool:
    """Tell whether this computer has a browser."""
    if browser == "firefox":
        return firefox_program() is not None
    return bool(shutil.which("chromium") or shutil.which("chromium-browser"))


def attack(targets: Targets, goto: Callable[[str], Any], evaluate: Evaluate) -> Outcome:
    """Send everything from pages of other sites, then one thing from the study's own."""
    outcome = Outcome()
    with other_site() as port:
        for start in (
            f"http://localhost:{port}/",
            f"http://{LOCAL}:{port}/",
            f"http://localhost:{port}/sandbox",
        ):
            goto(start)
            for base, paths in targets.addresses.items():
                for path in paths:
                    given = [base, path]
                    code = f"({ATTACK})({json.dumps(given)})"
                    if start.endswith("sandbox"):
                        code = INSIDE % json.dumps({"code": ATTACK, "given": given})
                    read = int(evaluate(code))
                    outcome.read += read
                    if read:
                        outcome.where.append(f"read: {start} {base}{path}")
    outcome.sent = len(targets.answers)
    for method, path, site, status in targets.answers:
        if method not in SAFE and status not in REFUSED:
            outcome.let_in += 1
            outcome.where.append(f"let in: {method} {path} ({site}): {status}")
    outcome.let_in += targets.reception.arrivals
    outcome.commands = targets.commands
    goto(f"{targets.study}/board")
    outcome.own = int(evaluate(OWN) == 200) and targets.reception.arrivals
    return outcome


def measure(browser: str, root: Path) -> Outcome:
    """Attack with one browser; servers are begun anew."""
    targets = Targets(root / browser)
    targets.start()
    try:
        with PROGRAMS[browser](root / f"{browser}-profile") as (goto, evaluate):
            return attack(targets, goto, evaluate)
    finally:
        targets.stop()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row per browser; 1 if anything was let in."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--browsers", nargs="+", choices=BROWSERS, default=BROWSERS)
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    chosen = parser.parse_args(arguments)
    outcomes = {}
    with tempfile.TemporaryDirectory(prefix="cross-site-") as root:
        for browser in chosen.browsers:
            if not is_there(browser):
                print(f"there is no {browser} on this computer", file=sys.stderr)
                continue
            outcomes[browser] = measure(browser, Path(root))
    if chosen.json:
        print(json.dumps({name: asdict(outcome) for name, outcome in outcomes.items()}))
    else:
        print(f"{'':10}{'sent':>8}{'let in':>8}{'read':>8}{'commands':>10}{'own':>6}")
        for name, o in outcomes.items():
            print(f"{name:10}{o.sent:>8}{o.let_in:>8}{o.read:>8}{o.commands:>10}{o.own:>6}")
        for line in (line for o in outcomes.values() for line in o.where[:20]):
            print(line)
    return 0 if all(outcome.is_clean for outcome in outcomes.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
