"""Serve a study behind a reverse proxy to a crowd, kill server and proxy, set the clock back.

python -m benchmarks.unattended [--arrivals 500] [--within 60] [--minutes 30] [--think 6]
                                [--trials 300] [--kill-every 45] [--places 200] [--json]
                                [--keep DIR [--fill-disk]]

`visavis serve` runs in a process of its own behind nginx, as docs/pages.md has it. People come
within so many seconds, each from an address of this computer of their own (127.x.y.z), and ask
again where they are told to wait; each thinks some seconds before an answer. Every `--kill-every`
seconds, by turns, the server is killed (SIGKILL) and begun anew, nginx is killed and begun anew, or
the server's time of day is set back by an hour (monotonic time goes on). With `--fill-disk` the
file system of the kept folder, a small one made for this, is filled for some seconds in the fourth
turn; whoever then reads that their session failed loads the page again. At the end nobody answers
any more, the server is ended (SIGTERM), and what was acknowledged is looked for in the recordings.
`lost`, `twice` and `wrong` have to be 0: answers that were acknowledged and are not recorded,
recorded twice, or another than was given; `refused` counts answers but "wait" and "gone", `red`
sessions whose files `visavis check` finds damaged (of a disk that was full, after `visavis
recover`). With `--places` so many people stay, and the others read that it is full. Times of steps
are of those whose answer came at the first try. Without nginx people come to the server itself, and
the table says so.
"""

import argparse
import asyncio
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import aiohttp
import numpy as np

from benchmarks.page_crowd import STUDY
from benchmarks.page_faults.study import kept_replies
from visavis.lab.clock import StopWatch, SystemClock
from visavis.recording.reader import Recording
from visavis.recording.recovery import recover
from visavis.running.page.server import KEY, LOCAL
from visavis.running.sessions.folder_check import session_problems

SERVER: Final = """
from datetime import datetime, timedelta
from pathlib import Path

from visavis.lab import clock


class SetBack(datetime):
    @classmethod
    def now(cls, tz=None):
        return datetime.now(tz) - timedelta(hours=int(Path("hours_back").read_text() or 0))


clock.datetime = SetBack  # the one place that reads the time of day
from visavis.cli.main import main

main()
"""
ASK_AGAIN_S: Final = 3.0
"""A page that was told to wait, or got no answer, asks again after this."""
PATIENCE_S: Final = 60.0
FULL_S: Final = 8.0
"""For so long a disk stays full."""
MAX_FREE_BYTES: Final = 4 << 30
"""More is not filled: it is no file system made for this."""
NGINX: Final = """
daemon off; pid {root}/nginx.pid; error_log {root}/nginx.log crit; worker_processes 1;
events {{ worker_connections 4096; }}
http {{
  access_log off; client_body_temp_path {root}/body; proxy_temp_path {root}/proxy;
  fastcgi_temp_path {root}/f; uwsgi_temp_path {root}/u; scgi_temp_path {root}/s;
  server {{
    listen {local}:{front};
    client_max_body_size 1m;
    location / {{
      proxy_pass http://{local}:{back};
      proxy_set_header Host $http_host;
      proxy_set_header X-Forwarded-For $proxy_add_x_forwarded_for;
    }}
  }}
}}
"""


@dataclass
class Outcome:
    """What came of it; `lost`, `twice`, `wrong`, `refused` and `red` should be 0."""

    came: int = 0
    most_at_once: int = 0
    acknowledged: int = 0
    lost: int = 0
    twice: int = 0
    wrong: int = 0
    refused: int = 0
    red: int = 0
    asked_again: int = 0
    loaded_again: int = 0
    server_kills: int = 0
    proxy_kills: int = 0
    clock_set_back: int = 0
    disk_full: int = 0
    p50_ms: float = 0.0
    p99_ms: float = 0.0

    @property
    def is_clean(self) -> bool:
        """Tell whether nothing was lost, and nobody refused."""
        return not (self.lost or self.twice or self.wrong or self.refused or self.red)


def free_port() -> int:
    """Return a port that nothing listens at."""
    with socket.socket() as tried:
        tried.bind((LOCAL, 0))
        return int(tried.getsockname()[1])


class Site:
    """Own the server and the proxy before it; both may be killed and begun anew."""

    def __init__(self, root: Path, trials: int, places: int | None) -> None:
        self._root, self._places = root, places
        self._back, self._front = free_port(), free_port()
        self.has_proxy = shutil.which("nginx") is not None
        self._hours_back = 0
        self._write_hours()
        self._server: subprocess.Popen[bytes] | None = None
        self._proxy: subprocess.Popen[bytes] | None = None
        (root / "many.py").write_text(STUDY.format(trials=trials), "utf-8")
        config = NGINX.format(root=root, local=LOCAL, front=self._front, back=self._back)
        (root / "nginx.conf").write_text(config, "utf-8")
        self._visavis("init").wait()

    @property
    def base(self) -> str:
        """The address under which people come."""
        return f"http://{LOCAL}:{self._front if self.has_proxy else self._back}"

    def start(self) -> None:
        """Begin both."""
        self.start_server()
        if self.has_proxy:
            self.start_proxy()

    def start_server(self) -> None:
        """Begin the server at its address, or go on with it."""
        options = ["--port", str(self._back), "--devices", "sim"]
        if self._places is not None:
            options += ["--participants", str(self._places)]
        self._server = self._visavis("serve", "./many.py", *options)

    def start_proxy(self) -> None:
        """Begin nginx."""
        command = ["nginx", "-c", str(self._root / "nginx.conf"), "-p", str(self._root)]
        self._proxy = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)

    def kill_server(self) -> None:
        """Kill the server as a power cut would."""
        assert self._server is not None
        self._server.kill()
        self._server.wait()

    def kill_proxy(self) -> None:
        """Kill nginx and its workers."""
        assert self._proxy is not None
        with suppress(ProcessLookupError):
            os.killpg(self._proxy.pid, signal.SIGKILL)
        self._proxy.wait()

    def set_clock_back(self) -> None:
        """Set the server's time of day back by an hour, while it runs."""
        self._hours_back += 1
        self._write_hours()

    def fill_disk(self) -> None:
        """Fill the file system to its last byte."""
        with self._ballast.open("wb", buffering=0) as file, suppress(OSError):
            os.posix_fallocate(file.fileno(), 0, shutil.disk_usage(self._root).free)
            while file.write(bytes(1024)):
                pass

    def empty_disk(self) -> None:
        """Make room again."""
        self._ballast.unlink()

    @property
    def _ballast(self) -> Path:
        return self._root / "ballast"

    def _write_hours(self) -> None:
        new = self._root / "hours_back.new"
        new.write_text(str(self._hours_back), "utf-8")
        new.replace(self._root / "hours_back")

    def end(self) -> None:
        """End the server as a system does, by SIGKILL where it takes too long, and the proxy."""
        assert self._server is not None
        self._server.send_signal(signal.SIGTERM)
        try:
            self._server.wait(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            print(
                f"the server did not end within {PATIENCE_S:g} s, and was killed", file=sys.stderr
            )
            self.kill_server()
        if self._proxy is not None:
            self.kill_proxy()

    def _visavis(self, *arguments: str) -> "subprocess.Popen[bytes]":
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        command = [sys.executable, "-c", SERVER, *arguments]
        with (self._root / "server.log").open("ab") as log:
            return subprocess.Popen(
                command, cwd=self._root, env=environment, stdout=log, stderr=log
            )


@dataclass
class Crowd:
    """What everybody who comes shares: until when they answer, and what came of it."""

    base: str
    until_s: float
    think_s: float
    outcome: Outcome
    watch: StopWatch = field(default_factory=StopWatch)
    answers: dict[str, dict[int, str]] = field(default_factory=dict)
    """Acknowledged options by tab and number of the reply."""
    steps_ms: list[float] = field(default_factory=list)
    n_here: int = 0


async def answer_of(
    http: aiohttp.ClientSession, crowd: Crowd, path: str, body: Any, key: str = ""
) -> dict[str, Any] | None:
    """Post until there is an answer; None when the time is over."""
    tries = 0
    while crowd.watch.elapsed_s() < crowd.until_s or path == "/api/events":
        sent = StopWatch()
        try:
            async with http.post(path, json=body, headers={KEY: key}) as response:
                message = await response.json(content_type=None)
                is_asked_again = message.get("refused") in ("busy", "failed") or (
                    message.get("failed") and path != "/api/events"
                )
                if response.status == 200 and not is_asked_again:
                    if not tries and path == "/api/events":
                        crowd.steps_ms.append(1000 * sent.elapsed_s())
                    return dict(message)
                if response.status < 500 and not is_asked_again:
                    crowd.outcome.refused += 1
                    print(f"{path}: {response.status} {message}", file=sys.stderr)
                    return None
        except (aiohttp.ClientError, OSError, ValueError, TimeoutError):
            pass  # the server or the proxy is being begun anew
        tries += 1
        crowd.outcome.asked_again += 1
        if crowd.watch.elapsed_s() > crowd.until_s + PATIENCE_S:
            return None
        await asyncio.sleep(ASK_AGAIN_S)
    return None


async def person(number: int, at_s: float, crowd: Crowd, rng: np.random.Generator) -> None:
    """Come, and answer every step after a thought until the time is over."""
    await asyncio.sleep(at_s)
    tab = f"tab{number:05d}"
    given = crowd.answers[tab] = {}
    own_address = (f"127.{1 + number // 62500}.{number // 250 % 250}.{1 + number % 250}", 0)
    connector = aiohttp.TCPConnector(local_addr=own_address, limit=1)
    timeout = aiohttp.ClientTimeout(total=PATIENCE_S)
    async with aiohttp.ClientSession(crowd.base, connector=connector, timeout=timeout) as http:
        arrived = await answer_of(http, crowd, "/api/arrive", {"parameters": {}})
        if arrived is None or "key" not in arrived:
            return
        key, own = arrived["key"], StopWatch()
        crowd.outcome.came += 1
        crowd.n_here += 1
        crowd.outcome.most_at_once = max(crowd.outcome.most_at_once, crowd.n_here)
        hello = {"tab": tab, "at_ms": 0.0, "about": {}}
        message = await answer_of(http, crowd, "/api/hello", hello, key)
        while message is not None and message["step"]["kind"] != "end":
            await asyncio.sleep(rng.uniform(0.5, 1.5) * crowd.think_s)
            if crowd.watch.elapsed_s() > crowd.until_s:
                break
            at_ms, n, option = 1000 * own.elapsed_s(), message["ack"] + 1, ""
            reply: dict[str, Any] = {}
            if message["step"]["kind"] == "watch":
                option = str(rng.integers(1, 10))
                content = {"option": option, "at_ms": at_ms, "by": "keys"}
                times = {"shown_ms": at_ms, "off_ms": at_ms, "hidden_ms": 0.0, "films": {}}
                reply = {**times, "answers": {"answer": content}}
            event = {"n": n, "kind": "reply", "at_ms": at_ms, "step": message["number"]}
            body = {"tab": tab, "events": [{**event, "reply": reply}]}
            message = await answer_of(http, crowd, "/api/events", body, key)
            while message is not None and message.get("failed"):
                crowd.outcome.loaded_again += 1
                await asyncio.sleep(ASK_AGAIN_S)
                message = await answer_of(http, crowd, "/api/hello", hello, key)
                if message is not None and message["ack"] < n:  # what a page keeps, it sends again
                    message = await answer_of(http, crowd, "/api/events", body, key)
            if message is not None and message["ack"] >= n and option:
                given[n] = option
        crowd.n_here -= 1


async def faults(site: Site, crowd: Crowd, every_s: float, *, fills_disk: bool) -> None:
    """Kill, set the clock and fill the disk by turns, until shortly before the time is over."""
    turn = 0
    while crowd.watch.elapsed_s() + every_s < crowd.until_s:
        await asyncio.sleep(every_s)
        kind = turn % (4 if fills_disk else 3)
        turn += 1
        if kind == 0:
            await asyncio.to_thread(site.kill_server)
            site.start_server()
            crowd.outcome.server_kills += 1
        elif kind == 1 and site.has_proxy:
            await asyncio.to_thread(site.kill_proxy)
            site.start_proxy()
            crowd.outcome.proxy_kills += 1
        elif kind == 2:
            site.set_clock_back()
            crowd.outcome.clock_set_back += 1
        elif kind == 3:
            await asyncio.to_thread(site.fill_disk)
            crowd.outcome.disk_full += 1
            try:
                await asyncio.sleep(FULL_S)
            finally:
                site.empty_disk()


async def attend(site: Site, crowd: Crowd, options: argparse.Namespace) -> None:
    """Let everybody come while things break."""
    rngs = np.random.default_rng(1).spawn(options.arrivals + 1)
    times_s = np.sort(rngs[-1].uniform(0, options.within, options.arrivals)).tolist()
    breaking = asyncio.create_task(
        faults(site, crowd, options.kill_every, fills_disk=options.fill_disk)
    )
    people = zip(times_s, rngs[:-1], strict=True)
    await asyncio.gather(*(person(n, at, crowd, rng) for n, (at, rng) in enumerate(people)))
    breaking.cancel()
    await asyncio.wait([breaking])


def look_through(root: Path, crowd: Crowd) -> None:
    """Compare what was acknowledged with what was recorded."""
    outcome, recorded = crowd.outcome, {}
    for manifest in sorted(root.glob("**/ses-001/manifest.json")):
        session = manifest.parent
        if outcome.disk_full:  # it renews the copy of a manifest that found no room
            recover(session)
        outcome.red += bool(session_problems(session))
        events = Recording(session).events()
        own = events.loc[events["name"] == "page_event", "payload"]
        tabs = [str(payload["tab"]) for payload in own if payload.get("tab")]
        if tabs:
            recorded[tabs[0]] = kept_replies(session)
    for tab, given in crowd.answers.items():
        kept = recorded.get(tab, {})
        outcome.acknowledged += len(given)
        outcome.lost += sum(n not in kept for n in given)
        outcome.twice += sum(len(options) > 1 for options in kept.values())
        outcome.wrong += sum(n in kept and kept[n][0] != option for n, option in given.items())
    if crowd.steps_ms:
        p50, p99 = np.percentile(crowd.steps_ms, [50, 99])
        outcome.p50_ms, outcome.p99_ms = round(float(p50), 1), round(float(p99), 1)


def measure(root: Path, options: argparse.Namespace) -> tuple[Outcome, Site]:
    """Serve, let everybody come, and look through what was recorded."""
    site = Site(root, options.trials, options.places)
    crowd = Crowd(site.base, 60 * options.minutes, options.think, Outcome())
    site.start()
    try:
        wait_for(root)
        crowd.watch = StopWatch()
        asyncio.run(attend(site, crowd, options))
    finally:
        site.end()
    look_through(root, crowd)
    return crowd.outcome, site


def wait_for(root: Path) -> None:
    """Wait until the server has told its address.

    Raises:
        SystemExit: it did not within a minute.
    """
    watch, clock = StopWatch(), SystemClock()
    while not re.search(r"/board#", (root / "server.log").read_text("utf-8", "replace")):
        if watch.elapsed_s() > PATIENCE_S:
            raise SystemExit((root / "server.log").read_text("utf-8", "replace"))
        clock.sleep_until_ns(clock.now_ns() + 10**8)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 1 if anything was lost."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--arrivals", type=int, default=500)
    parser.add_argument("--within", type=float, default=60.0, help="seconds")
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--think", type=float, default=6.0, help="seconds before an answer")
    parser.add_argument("--trials", type=int, default=300)
    parser.add_argument("--kill-every", type=float, default=45.0, help="seconds")
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    parser.add_argument("--keep", type=Path, help="keep everything in this new folder")
    parser.add_argument("--places", type=int, help="of how many answers are wanted (else all)")
    parser.add_argument("--fill-disk", action="store_true", help="fill the kept folder's disk")
    options = parser.parse_args(arguments)
    if options.fill_disk and (
        options.keep is None or shutil.disk_usage(options.keep.parent).free > MAX_FREE_BYTES
    ):
        parser.error("--fill-disk: give --keep, a new folder on a file system of at most 4 GB")
    with tempfile.TemporaryDirectory(prefix="unattended-") as temporary:
        root = options.keep or Path(temporary)
        root.mkdir(exist_ok=True)
        outcome, site = measure(root, options)
    if options.json:
        print(json.dumps(asdict(outcome)))
    else:
        for name, value in asdict(outcome).items():
            print(f"{name:20} {value}")
        if not site.has_proxy:
            print("there is no nginx: no reverse proxy")
    return 0 if outcome.is_clean else 1


if __name__ == "__main__":
    sys.exit(main())
