"""Debian's own Firefox, driven by WebDriver BiDi (W3C), which it speaks without another program."""

import json
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from visavis.lab.clock import StopWatch, SystemClock

ANSWER_S = 120.0
POLL_S = 0.05
CLICK_S = 10.0
MAX_MESSAGE_BYTES = 1 << 26
WRONG = ("exception", "error")


def program() -> str | None:
    """Return where Firefox is; None where there is none."""
    return shutil.which("firefox-esr") or shutil.which("firefox")


class Firefox:
    """One window of a Firefox: what a person would do in it."""

    def __init__(self, wire: ClientConnection) -> None:
        self._wire, self._id = wire, 0
        self.version = self.send("session.new", {"capabilities": {}})["capabilities"][
            "browserVersion"
        ]
        tree = self.send("browsingContext.getTree", {})
        self._context = tree["contexts"][0]["context"]

    def send(self, method: str, given: dict[str, Any]) -> Any:
        """Send a command and return its result."""
        self._id += 1
        self._wire.send(json.dumps({"id": self._id, "method": method, "params": given}))
        while True:
            told = json.loads(self._wire.recv(timeout=ANSWER_S))
            if told.get("id") == self._id:
                assert "success" == told["type"], told
                return told["result"]

    def size(self, width_px: int, height_px: int) -> None:
        """Make the page so large."""
        size = {"width": width_px, "height": height_px}
        self.send("browsingContext.setViewport", {"context": self._context, "viewport": size})

    def goto(self, address: str) -> None:
        """Open an address."""
        given = {"context": self._context, "url": address, "wait": "complete"}
        self.send("browsingContext.navigate", given)

    def reload(self) -> None:
        """Load the page again."""
        self.send("browsingContext.reload", {"context": self._context, "wait": "complete"})

    def evaluate(self, code: str) -> Any:
        """Return what code gives in the page, as JSON can hold it."""
        told = self.send(
            "script.evaluate",
            {
                "expression": f"Promise.resolve({code}).then((v) => JSON.stringify(v ?? null))",
                "target": {"context": self._context},
                "awaitPromise": True,
            },
        )
        assert told["type"] not in WRONG, told
        return json.loads(told["result"]["value"])

    def click(self, selector: str) -> None:
        """Click in the middle of the first element, with the mouse, once it is there."""
        watch, clock = StopWatch(), SystemClock()
        while not self.click_if_there(selector):
            assert watch.elapsed_s() < CLICK_S, f"no {selector}"
            clock.sleep_until_ns(clock.now_ns() + round(POLL_S * 1e9))

    def click_if_there(self, selector: str) -> bool:
        """Click in the middle of the first element; return False where there is none (any more)."""
        middle = self.evaluate(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)});"
            "if (!e) return null;"
            "e.scrollIntoView({block: 'center', behavior: 'instant'});"
            "const r = e.getBoundingClientRect();"
            "return [Math.round(r.x + r.width / 2), Math.round(r.y + r.height / 2)]; })()"
        )
        if middle is None:
            return False
        moves = [
            {"type": "pointerMove", "x": middle[0], "y": middle[1]},
            {"type": "pointerDown", "button": 0},
            {"type": "pointerUp", "button": 0},
        ]
        self._act({"type": "pointer", "id": "mouse", "actions": moves})
        return True

    def press(self, keys: str) -> None:
        """Press one key after another."""
        moves = [{"type": kind, "value": k} for k in keys for kind in ("keyDown", "keyUp")]
        self._act({"type": "key", "id": "keyboard", "actions": moves})

    def wait_for(self, condition: str, limit_s: float) -> None:
        """Wait until code gives true in the page."""
        watch, clock = StopWatch(), SystemClock()
        while not self.evaluate(condition):
            said = self.evaluate("document.body.innerText")
            assert watch.elapsed_s() < limit_s, f"{condition} is not so: {said}"
            clock.sleep_until_ns(clock.now_ns() + round(POLL_S * 1e9))

    def _act(self, source: dict[str, Any]) -> None:
        self.send("input.performActions", {"context": self._context, "actions": [source]})


@contextmanager
def firefox(profile: Path, *, draws: bool = False) -> Iterator[Firefox]:
    """Begin a Firefox without a window and with nothing remembered; end it.

    One that `draws` WebGL needs a screen, and is given one that nobody sees.
    """
    found = program()
    assert found is not None
    process = subprocess.Popen(
        [
            *(["xvfb-run", "-a", found] if draws else [found, "--headless"]),
            "--no-remote",
            "--profile",
            str(profile),
            "--remote-debugging-port",
            "0",
            "about:blank",
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"HOME": str(profile)},
    )
    try:
        assert process.stderr is not None
        for line in process.stderr:
            at = re.search(r"BiDi listening on (ws://\S+)", line)
            if at:
                break
        else:
            raise AssertionError("Firefox told no address")
        with connect(f"{at[1]}/session", max_size=MAX_MESSAGE_BYTES) as wire:
            yield Firefox(wire)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
