"""The session's side of the desk: send its status, take commands, outside the frame loop."""

import asyncio
import contextlib
import hashlib
import hmac
import json
import math
import os
import secrets
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import platformdirs

from visavis.analysis.gaze.aoi import DEFAULT_PAD_DEG
from visavis.cli.desk.scene_view import LastGaze, above, from_head, jpeg_of
from visavis.cli.notifier import NOTIFIER
from visavis.cli.operator_screen import losses_of, needs_look
from visavis.devices.contracts import Health
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.config import INCIDENTS
from visavis.protocol.session.operator import Action, Command, Operator, SessionStatus
from visavis.recording.durable import replace_secret
from visavis.stage.contracts import Glance

LOCAL: Final = "127.0.0.1"
STATUS_PERIOD_NS: Final = 125 * NS_PER_MS
PERIOD_S: Final = STATUS_PERIOD_NS / NS_PER_S
MAX_LINE_BYTES: Final = 1 << 16
MAX_TEXT: Final = 500
PATIENCE_S: Final = 5.0
FORGOTTEN_S: Final = 7 * 86400.0
ACTIONS: Final = tuple(action for action in Action if action is not Action.ANSWER)
"""What a desk can ask for: the same that the keys of the terminal do."""


@dataclass(frozen=True)
class About:
    """What a session tells a desk about itself, once.

    `path` is its folder, `commands` what it takes, `pad_deg` by how much areas of interest are
    wider than heads. While it `is_blind` no picture of what the participant sees leaves it.
    """

    study: str
    participant: str
    session: int
    path: str
    is_simulated: bool
    is_blind: bool
    commands: tuple[str, ...] = ACTIONS
    incidents: Mapping[str, str] = field(default_factory=lambda: dict(INCIDENTS))
    """Reasons that may be given, by code."""
    pad_deg: float = DEFAULT_PAD_DEG


def meeting_folder() -> Path:
    """Return the folder in which sessions of this user write how to reach them."""
    return platformdirs.user_cache_path("visavis", appauthor=False) / "sessions"


def meeting_name(data_root: Path) -> str:
    """Return the prefix of the files of sessions that record under a data root."""
    return hashlib.sha256(str(data_root.resolve()).encode()).hexdigest()[:16]


class SessionLink:
    """An operator who is also reached from the desk; the person at the terminal stays in charge.

    It follows `visavis.protocol.session.operator.Operator`. In the frame loop it only keeps the
    newest status; a thread of its own sends it to the desk. Where nothing can listen, the session
    goes on without a desk, and the terminal says why.
    """

    def __init__(self, operator: Operator, about: About, data_root: Path) -> None:
        self._operator = operator
        self._about = about
        self._name = meeting_name(data_root)
        own_ns = operator.status_period_ns
        self._every = max(1, round(own_ns / STATUS_PERIOD_NS)) if own_ns else 0
        self._status_number = 0
        self._token = secrets.token_urlsafe(24)
        self._commands: deque[Command] = deque()
        self._latest: tuple[int, SessionStatus, LastGaze] | None = None
        self._looking = LastGaze()
        self._latest_glance: tuple[int, SessionStatus, LastGaze, Glance] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._over: asyncio.Event | None = None
        self._listens = threading.Event()
        self._meeting: Path | None = None
        self._problem: OSError | None = None
        self._desks: dict[asyncio.Task[Any], asyncio.StreamWriter] = {}
        self._thread = threading.Thread(target=self._listen, name="desk", daemon=True)

    @property
    def status_period_ns(self) -> int:
        """How often a status is wanted."""
        return STATUS_PERIOD_NS

    def __enter__(self) -> Self:
        jpeg_of(np.zeros((1, 1, 3), np.uint8))  # what writes them is loaded now, not in a trial
        self._thread.start()
        self._listens.wait(PATIENCE_S)
        if self._problem is not None:
            NOTIFIER.warn(
                f"no desk can find this session ({self._problem}); it goes on at this terminal. "
                f"For a desk, see that {meeting_folder()} can be written, and resume the session"
            )
        return self

    def __exit__(self, *exception: object) -> None:
        if self._meeting is not None:
            self._meeting.unlink(missing_ok=True)
        if self._loop is not None and self._over is not None:
            with contextlib.suppress(RuntimeError):  # it has ended already
                self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join(PATIENCE_S)

    # ---- what the session asks ---------------------------------------------------------------

    def poll(self) -> Sequence[Command]:
        """Return what was asked for at the terminal and at the desk since the last frame."""
        own = self._operator.poll()
        if not self._commands:
            return own
        commands = [*own]
        while self._commands:
            commands.append(self._commands.popleft())
        return commands

    def show(self, status: SessionStatus) -> None:
        """Keep the status for the desk, and show it at the terminal as often as that wants."""
        self._status_number += 1
        self._looking = self._looking.after(status, self._about.pad_deg)
        self._latest = (self._status_number, status, self._looking)
        glance = status.glance() if self._desks and not self._about.is_blind else None
        if glance is not None:
            self._latest_glance = (self._status_number, status, self._looking, glance)
        if self._every and self._status_number % self._every == 0:
            self._operator.show(status)

    def waits_for_advance(self, prompt: str) -> bool:
        """Wait where the operator at the terminal does."""
        return self._operator.waits_for_advance(prompt)

    # ---- outside the frame loop --------------------------------------------------------------

    def _listen(self) -> None:
        try:
            asyncio.run(self._serve())
        except OSError as problem:  # then there is no desk
            self._problem = problem
        self._listens.set()

    async def _serve(self) -> None:
        self._loop, self._over = asyncio.get_running_loop(), asyncio.Event()
        server = await asyncio.start_server(self._visit, LOCAL, 0, limit=MAX_LINE_BYTES)
        try:
            self._meeting = _write_meeting(
                self._name, {"port": server.sockets[0].getsockname()[1], "token": self._token}
            )
            self._listens.set()
            await self._over.wait()
        finally:
            server.close()
        for writer in self._desks.values():
            writer.close()
        if self._desks:  # each ends as its line is cut
            await asyncio.wait(self._desks, timeout=PATIENCE_S)

    async def _visit(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        sending: asyncio.Task[None] | None = None
        own = asyncio.current_task()
        assert own is not None  # noqa: S101 - it runs in one
        self._desks[own] = writer
        try:
            first_line = await asyncio.wait_for(reader.readline(), PATIENCE_S)
            if not hmac.compare_digest(first_line.strip(), self._token.encode()):
                return
            writer.write(line_of(asdict(self._about)))
            sending = asyncio.create_task(self._send(writer))
            while line := await reader.readline():
                command = command_of(line, self._about.commands, self._about.incidents)
                if command is not None:
                    self._commands.append(command)
        except (TimeoutError, OSError, ValueError):
            return  # it has gone, or is not a desk
        finally:
            if sending is not None:
                sending.cancel()
            del self._desks[own]
            writer.close()

    async def _send(self, writer: asyncio.StreamWriter) -> None:
        sent_number = sent_seen = 0
        while True:
            latest = self._latest
            if latest is not None and latest[0] != sent_number:
                sent_number = latest[0]
                writer.write(line_of(status_message(*latest)))
                await writer.drain()
            latest_view = self._latest_glance
            if latest_view is not None and latest_view[0] != sent_seen:
                sent_seen = latest_view[0]
                writer.write(line_of({"seen": from_head(*latest_view[1:])}))
                await writer.drain()
            await asyncio.sleep(PERIOD_S)


def line_of(content: Mapping[str, Any]) -> bytes:
    """Return a message between session and desk: JSON in one line."""
    return json.dumps(_finite(content), ensure_ascii=False).encode() + b"\n"


def command_of(
    line: bytes, allowed: Sequence[str], incidents: Mapping[str, str] = INCIDENTS
) -> Command | None:
    """Return the command in a desk's message; None where it is not allowed."""
    try:
        message = json.loads(line)
        action, text = Action(message["action"]), message.get("text", "")
        code = message.get("code", "")
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    if action not in allowed or not isinstance(text, str) or not isinstance(code, str):
        return None
    if code and code not in incidents:
        return None
    plain = "".join(c for c in text[:MAX_TEXT] if c.isprintable()).strip()
    return Command(action, plain, code)


def status_message(number: int, status: SessionStatus, looking: LastGaze) -> dict[str, Any]:
    """Return a status as a message to a desk; NaN and unknown values are None."""
    return {
        "number": number,
        "state": status.state.value,
        "trial_id": status.trial_id,
        "trials_done": status.trials.done_count,
        "trials_skipped": status.trials.skipped_count,
        "trials_planned": status.trials.planned_count,
        "block": status.block,
        "condition": status.condition,
        "trial_left_s": status.trial_left_s,
        "session_left_s": status.trials.left_s,
        "streams": [_stream(role, health) for role, health in status.health.items()],
        "losses": losses_of(status.health),
        "accuracy_deg": status.calibration.accuracy_deg,
        "precision_deg": status.calibration.precision_deg,
        "calibration_age_s": status.calibration.age_s,
        "is_calibrated_first": status.calibration.is_planned,
        "faults": [asdict(fault) for fault in status.faults],
        "flags": list(status.flags),
        "prompt": status.prompt,
        "waiting": status.waiting,
        "can_go_on": status.can_go_on,
        "messages": list(status.messages),
        "contacts": [asdict(contact) for contact in status.contacts],
        "contacts_begun": status.contacts_begun,
        "above": above(status, looking),
        "from_head": from_head(status, looking),
    }


def _stream(role: str, health: Health) -> dict[str, Any]:
    return {
        "role": role,
        "received": health.received,
        "rate_hz": health.rate_hz,
        "nominal_rate_hz": health.nominal_rate_hz or None,
        "gaps": health.gaps,
        "longest_gap_ms": health.longest_gap_ms,
        "last_sample_age_ms": health.last_sample_age_ms,
        "dropped": health.dropped,
        "battery_01": health.battery_01,
        "needs_look": needs_look(role, health),
    }


def _finite(value: Any) -> Any:
    """Return a value with None in place of numbers that JSON does not have."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: _finite(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return value


def _write_meeting(name: str, content: Mapping[str, Any]) -> Path:
    """Write how the session is reached, readable only for its owner; return the file."""
    folder = meeting_folder()
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    path = folder / f"{name}-{os.getpid()}-{content['port']}.json"
    # A desk takes an unfinished file for one of a killed session, and deletes it.
    replace_secret(path, json.dumps(content).encode())
    now_s = path.stat().st_mtime
    for left in folder.iterdir():  # left by killed sessions that no desk looked for
        with contextlib.suppress(OSError):
            if now_s - left.stat().st_mtime > FORGOTTEN_S:
                left.unlink()
    return path
