"""The desk's side of the link: find running sessions, read their status, send commands."""

import asyncio
import contextlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from visavis.cli.desk.link import LOCAL, line_of, meeting_folder, meeting_name
from visavis.protocol.session.operator import Command

LOOK_AGAIN_S: Final = 0.5
HELLO_S: Final = 5.0
"""How long a session may be silent before it is looked for again."""
MAX_LINE_BYTES: Final = 1 << 20


@dataclass(eq=False)
class LiveSession:
    """A session that goes on: its description of itself, its status, and the connection."""

    about: Mapping[str, Any]
    writer: asyncio.StreamWriter
    status: Mapping[str, Any] | None = None
    last_view: Mapping[str, Any] | None = None
    """The last picture of what the participant saw; None where none came."""


class SessionWatch:
    """Own the connections to the sessions that record under a data root.

    `live` are those that go on, by a name of their own, in the order in which they were met;
    `number` counts changes; `last_ended` is the session that ended last while this desk looked on.
    """

    def __init__(self, data_root: Path) -> None:
        self._name = meeting_name(data_root)
        self._changed = asyncio.Condition()
        self._followers: dict[Path, asyncio.Task[None]] = {}
        self.live: dict[str, LiveSession] = {}
        self.last_ended: Mapping[str, Any] | None = None
        self.number = 0

    @property
    def about(self) -> Mapping[str, Any] | None:
        """Description of the first session met; None while none goes on."""
        session = self.of()
        return None if session is None else session.about

    @property
    def status(self) -> Mapping[str, Any] | None:
        """Status of the first session met; None while none goes on."""
        session = self.of()
        return None if session is None else session.status

    def of(self, which: str = "") -> LiveSession | None:
        """Return a session by its name, the first where it has ended or none is named."""
        return self.live.get(which) or next(iter(self.live.values()), None)

    async def run(self) -> None:
        """Follow the sessions until cancelled."""
        try:
            while True:
                for meeting in sorted(meeting_folder().glob(f"{self._name}-*.json")):
                    if meeting not in self._followers:
                        self._followers[meeting] = asyncio.create_task(self._follow(meeting))
                for meeting in [m for m, following in self._followers.items() if following.done()]:
                    del self._followers[meeting]
                await asyncio.sleep(LOOK_AGAIN_S)
        finally:
            following_all = list(self._followers.values())
            for following in following_all:
                following.cancel()
            await asyncio.gather(*following_all, return_exceptions=True)

    async def wait(self, number: int, timeout_s: float) -> None:
        """Wait until something has changed since `number`, or until the timeout."""
        async with self._changed:
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(
                    self._changed.wait_for(lambda: self.number != number), timeout_s
                )

    async def wake(self) -> None:
        """End every wait, although nothing has changed."""
        async with self._changed:
            self.number += 1
            self._changed.notify_all()

    async def tell(self, command: Command, which: str = "") -> bool:
        """Send a command to a session (by default the first); return whether it was there.

        A session that has ended takes no command, and no other takes it instead.
        """
        session = self.live.get(which) if which else self.of()
        if session is None:
            return False
        try:
            message = {"action": command.action, "text": command.text, "code": command.code}
            session.writer.write(line_of(message))
            await session.writer.drain()
        except OSError:
            return False
        return True

    async def _follow(self, meeting: Path) -> None:
        """Read a session's messages to its end; forget one that is no longer there."""
        try:
            how = json.loads(meeting.read_text("utf-8"))
            reader, writer = await asyncio.open_connection(
                LOCAL, int(how["port"]), limit=MAX_LINE_BYTES
            )
        except (ConnectionRefusedError, ValueError, KeyError, TypeError, OverflowError):
            meeting.unlink(missing_ok=True)  # of a process that was killed
            return
        except OSError:
            return  # it has just ended, or this computer is short of something: looked for again
        session: LiveSession | None = None
        try:
            writer.write(str(how["token"]).encode() + b"\n")
            about = _about(await asyncio.wait_for(reader.readline(), HELLO_S))
            if about is None:
                meeting.unlink(missing_ok=True)  # another program has that port now
                return
            session = self.live[meeting.stem] = LiveSession(about, writer)
            await self.wake()
            while line := await reader.readline():
                message = json.loads(line)
                if "seen" in message:
                    session.last_view = message["seen"]
                else:
                    session.status = message
                await self.wake()
        except TimeoutError:
            return  # a busy session, or another program that waits to be spoken to
        except (OSError, ValueError):
            return  # it has ended, or is not a session
        finally:
            writer.close()
            if session is not None:
                del self.live[meeting.stem]
                self.last_ended = session.about
                await self.wake()


def _about(line: bytes) -> Mapping[str, Any] | None:
    """Return a session's description of itself; None from other programs."""
    try:
        message = json.loads(line)
    except ValueError:
        return None
    return message if isinstance(message, Mapping) else None
