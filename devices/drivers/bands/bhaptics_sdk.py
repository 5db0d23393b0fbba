"""Carry calls to bHaptics' SDK2 for Python, which speaks to the Player, as a `ByteLink`.

The SDK is one for the process: bands of one laboratory share its connection. It proves to the
Player who calls by application id and key, which is why its own package is used. It goes on
numbering frames when the Player is gone (seen with 0.2.0), so the Player's port is looked at.
"""

import asyncio
import json
import socket
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from visavis.devices.byte_links import Chunk
from visavis.devices.drivers.bands.bhaptics_sdk_codec import DEVICES, PLAY, STOP, answer
from visavis.devices.libraries import BHAPTICS_SDK
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound, DeviceTimeout

PLAYER = ("127.0.0.1", 15882)
"""Where a Player of SDK2 listens; the package dials nothing else."""
TELL_EVERY_NS = NS_PER_S // 2
LOOK_EVERY_NS = NS_PER_S
CALL_S = 1.0
LOOK_S = 0.2


class PlayerSession:
    """The process's one connection to a Player, in a thread of its own; counts who uses it."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._users = 0
        self._application = ("", "")
        self._library: Any = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def join(self, app_id: str, api_key: str, deadline_s: float, remedy: str) -> None:
        """Connect, or share the connection; raises DeviceNotFound when nobody answers."""
        with self._lock:
            if self._users and self._application != (app_id, api_key):
                raise DeviceError(
                    "the bHaptics SDK speaks for one application at a time",
                    remedy="give every bHaptics unit the same app_id and api_key_file",
                )
            if not self._users:
                self._library = BHAPTICS_SDK.imported()
                self._begin_thread()
                self._application = (app_id, api_key)
                try:
                    is_there = self.call(
                        "registry_and_initialize", app_id, api_key, "", within_s=deadline_s
                    )
                    if not is_there:
                        raise DeviceNotFound("no bHaptics Player answers", remedy=remedy)
                except DeviceError:
                    self._end_thread()
                    raise
            self._users += 1

    def leave(self) -> None:
        """Give the connection up; the last one closes it."""
        with self._lock:
            self._users -= 1
            if self._users == 0:
                try:
                    self.call("close")
                finally:
                    self._end_thread()

    def call(self, name: str, *arguments: object, within_s: float = CALL_S) -> Any:
        """Call a function of the SDK and wait for what it returns; raises DeviceTimeout."""
        loop, library = self._loop, self._library
        if loop is None:
            raise DeviceDisconnected("the connection to the bHaptics Player is closed")

        async def awaited() -> Any:
            return await getattr(library, name)(*arguments)

        future = asyncio.run_coroutine_threadsafe(awaited(), loop)
        try:
            return future.result(max(0.05, within_s))
        except TimeoutError as cause:
            future.cancel()
            raise DeviceTimeout(f"the bHaptics SDK does not return from {name}") from cause

    def _begin_thread(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_forever, name="bhaptics-sdk", daemon=True
        )
        self._thread.start()

    def _end_thread(self) -> None:
        loop, self._loop = self._loop, None
        thread, self._thread = self._thread, None
        if loop is not None and thread is not None:
            loop.call_soon_threadsafe(loop.stop)
            thread.join()
            loop.close()


THE_SESSION = PlayerSession()


class BhapticsSdkLink:
    """One `write` is one call, one chunk one answer; a frame ends the frame before it.

    The application's key is read from its file when the link is opened.
    """

    kind = "bHaptics SDK2"

    def __init__(
        self,
        app_id: str,
        api_key_file: str,
        clock: Clock,
        *,
        remedy: str,
        session: PlayerSession = THE_SESSION,
        player: tuple[str, int] = PLAYER,
        is_simulated: bool = False,
    ) -> None:
        self.is_simulated = is_simulated
        self._app_id = app_id
        self._api_key_file = api_key_file
        self._clock = clock
        self._remedy = remedy
        self._session = session
        self._player = player
        self._is_open = False
        self._writing = threading.RLock()
        self._chunks: list[Chunk] = []
        self._last_request = -1
        self._tell_ns = self._look_ns = 0

    def open(self, deadline_s: float) -> None:
        """Connect to the Player, or share the connection."""
        self.close()
        api_key = self._api_key()
        self._look()
        self._session.join(self._app_id, api_key, deadline_s, self._remedy)
        self._is_open = True
        self._last_request = -1
        self._chunks = []
        self._tell_ns = self._look_ns = self._clock.now_ns()

    def write(self, data: bytes) -> int:
        """Make one call; see `ByteLink`."""
        if not self._is_open:
            raise DeviceDisconnected("the connection is closed", remedy=self._remedy)
        request = json.loads(data)
        name, arguments = str(request["call"]), tuple(request["arguments"])
        with self._writing:
            if name == STOP:
                self._stop_last()
            elif name == DEVICES:
                self._tell()
            else:
                result = self._session.call(name, *arguments)
                sent_ns = self._clock.now_ns()
                if name == PLAY:
                    self._stop_last()
                    self._last_request = int(result)
                self._chunks.append(Chunk(sent_ns, answer(name, result)))
                return sent_ns
        return self._clock.now_ns()

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return answers; twice a second the units, once a second a look at the Player's port."""
        if not self._is_open:
            raise DeviceDisconnected("the connection is closed", remedy=self._remedy)
        with self._writing:
            is_idle = not self._chunks
        now_ns = self._clock.now_ns()
        if timeout_s > 0 and is_idle:
            until_ns = min(now_ns + round(timeout_s * NS_PER_S), self._tell_ns + TELL_EVERY_NS)
            self._clock.sleep_until_ns(until_ns)
            now_ns = self._clock.now_ns()
        if now_ns - self._look_ns >= LOOK_EVERY_NS:
            self._look_ns = now_ns
            try:
                self._look()
            except DeviceNotFound as cause:
                raise DeviceDisconnected(str(cause), remedy=self._remedy) from cause
        with self._writing:
            if now_ns - self._tell_ns >= TELL_EVERY_NS:
                self._tell()
            chunks, self._chunks = self._chunks, []
        return chunks

    def close(self) -> None:
        """Leave the connection; idempotent."""
        if self._is_open:
            self._is_open = False
            self._session.leave()

    def _api_key(self) -> str:
        if not (self._app_id and self._api_key_file):
            raise DeviceError(
                "bHaptics' SDK needs an application's app_id, and api_key_file, the text file with "
                "its key",
                remedy="make an application at developer.bhaptics.com and give both",
            )
        try:
            return Path(self._api_key_file).expanduser().read_text("utf-8").strip()
        except (OSError, ValueError) as cause:
            raise DeviceError(
                f"the key of the bHaptics application cannot be read from {self._api_key_file} "
                f"({cause})",
                remedy="write it there, on one line",
            ) from cause

    def _stop_last(self) -> None:
        request, self._last_request = self._last_request, -1
        if request >= 0:
            self._session.call(STOP, request)

    def _tell(self) -> None:
        text = self._session.call(DEVICES)
        self._tell_ns = self._clock.now_ns()
        try:
            units = json.loads(text)
        except ValueError:
            units = text
        self._chunks.append(Chunk(self._tell_ns, answer(DEVICES, units)))

    def _look(self) -> None:
        try:
            socket.create_connection(self._player, LOOK_S).close()
        except OSError as cause:
            raise DeviceNotFound(
                f"no bHaptics Player answers at port {self._player[1]} of this computer",
                remedy=self._remedy,
            ) from cause
