"""The desk's side of the link: find the session that goes on, hear of it, and command it."""

import asyncio
import contextlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from cli.desk.link import LOCAL, line_of, meeting_folder, meeting_name
from protocol.operator import Command

LOOK_AGAIN_S: Final = 0.5
HELLO_S: Final = 5.0
"""For so long a session may keep silent before another is looked for."""
MAX_LINE_BYTES: Final = 1 << 20


class SessionWatch:
    """Own the connection to the session that records under a data root, when there is one.

    `about` and `status` are what it said, `number` counts changes; `ended` is the session that
    ended last while this desk looked on.
    """

    def __init__(self, data_root: Path) -> None:
        self._name = meeting_name(data_root)
        self._writer: asyncio.StreamWriter | None = None
        self._changed = asyncio.Condition()
        self.about: Mapping[str, Any] | None = None
        self.status: Mapping[str, Any] | None = None
        self.ended: Mapping[str, Any] | None = None
        self.number = 0

    async def run(self) -> None:
        """Follow one session after the other, until cancelled."""
        while True:
            for meeting in sorted(meeting_folder().glob(f"{self._name}-*.json")):
                await self._follow(meeting)
            await asyncio.sleep(LOOK_AGAIN_S)

    async def wait(self, number: int, timeout_s: float) -> None:
        """Wait until something has changed since `number`, but no longer than so long."""
        async with self._changed:
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(
                    self._changed.wait_for(lambda: self.number != number), timeout_s
                )

    async def wake(self) -> None:
        """End everybody's waiting, though nothing has changed."""
        await self._note(self.about, self.status)

    async def tell(self, command: Command) -> bool:
        """Send a command; tell whether a session was there to take it."""
        if self._writer is None:
            return False
        try:
            self._writer.write(line_of({"action": command.action, "text": command.text}))
            await self._writer.drain()
        except OSError:
            return False
        return True

    async def _follow(self, meeting: Path) -> None:
        """Hear a session to its end; one that is no longer there is forgotten."""
        try:
            how = json.loads(meeting.read_text("utf-8"))
            reader, writer = await asyncio.open_connection(
                LOCAL, int(how["port"]), limit=MAX_LINE_BYTES
            )
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError):
            meeting.unlink(missing_ok=True)  # of a process that was killed
            return
        try:
            writer.write(str(how["token"]).encode() + b"\n")
            about = _about(await asyncio.wait_for(reader.readline(), HELLO_S))
            if about is None:
                meeting.unlink(missing_ok=True)  # another program has that port now
                return
            self._writer = writer
            await self._note(about=about, status=None)
            while line := await reader.readline():
                await self._note(about=self.about, status=json.loads(line))
        except TimeoutError:
            return  # a busy session, or another program that waits to be spoken to
        except (OSError, ValueError):
            return  # it has ended, or is no session
        finally:
            self._writer = None
            writer.close()
            if self.about is not None:
                self.ended = self.about
                await self._note(about=None, status=None)

    async def _note(
        self, about: Mapping[str, Any] | None, status: Mapping[str, Any] | None
    ) -> None:
        async with self._changed:
            self.about, self.status = about, status
            self.number += 1
            self._changed.notify_all()


def _about(line: bytes) -> Mapping[str, Any] | None:
    """Return what a session says of itself first; None from whoever is no session."""
    try:
        found = json.loads(line)
    except ValueError:
        return None
    return found if isinstance(found, Mapping) else None
