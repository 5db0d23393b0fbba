"""The keyboard of this computer, as the participant's window hears it.

The window reports a press when the system does, and stamps it with the session clock. The
system adds the keyboard's own delay (USB polling, debouncing: 2 to 15 ms, different for every
keyboard), which only a measurement with a sensor shows.
"""

import threading
from collections import deque
from collections.abc import Iterable, Mapping, Sequence

from visavis.devices.byte_links import ByteLink, Chunk
from visavis.devices.drivers.buttons.device import ButtonDevice, Press
from visavis.devices.drivers.buttons.spec import KEYBOARD, KEYS
from visavis.lab.clock import NS_PER_S, Clock

MAX_LINE = 64
DOWN, UP = b"+", b"-"


class KeyLink:
    """The keys of the window as bytes: one line per press ("+space") or release ("-space")."""

    kind = "keyboard"
    is_simulated = False

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._chunks: deque[Chunk] = deque()
        self._something = threading.Event()

    def put(self, key: str, is_down: bool) -> None:
        """Take a press or release, now."""
        line = (DOWN if is_down else UP) + key.encode() + b"\n"
        self._chunks.append(Chunk(self._clock.now_ns(), line))
        self._something.set()

    def open(self, deadline_s: float) -> None:
        """Forget what was heard before."""
        self._chunks.clear()

    def write(self, data: bytes) -> int:
        """Do nothing: a keyboard takes no messages."""
        return self._clock.now_ns()

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return what was heard; see `ByteLink`."""
        if not self._chunks and timeout_s > 0:
            if self._clock.is_virtual:
                self._clock.sleep_until_ns(self._clock.now_ns() + round(timeout_s * NS_PER_S))
            else:
                self._something.wait(timeout_s)
        self._something.clear()
        chunks = []
        while self._chunks:
            chunks.append(self._chunks.popleft())
        return chunks

    def close(self) -> None:
        """Do nothing: the window is not ours."""


class Keyboard(ButtonDevice):
    """Follow the `ResponseInput` contract over the keys of a window; `hear` takes them.

    A key that repeats while it is held counts as pressed once. Keys with other names ("key 94", of
    layouts with more) are reported and left out.
    """

    def __init__(self, role: str, link: ByteLink, clock: Clock, *, keys: Mapping[str, str]) -> None:
        self._rest = b""
        self._unreadable_count = 0
        super().__init__(role, link, clock, KEYBOARD, buttons=KEYS, keys=keys)

    def hear(self, key: str, is_down: bool) -> None:
        """Take a press or release from the participant's window, now."""
        if isinstance(self._link, KeyLink):
            self._link.put(key, is_down)

    @property
    def unreadable_count(self) -> int:
        """How many lines could not be read."""
        return self._unreadable_count

    def _fresh(self) -> None:
        self._rest, self._unreadable_count = b"", 0

    def _read(self, data: bytes) -> Iterable[Press]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE:
            self._rest = b""
            self._unreadable_count += 1
        for line in lines:
            name = line[1:].decode("utf-8", "replace")
            if line[:1] in (DOWN, UP) and 0 < len(name) <= MAX_LINE:
                yield Press(name, float(line[:1] == DOWN))
            elif line:
                self._unreadable_count += 1
