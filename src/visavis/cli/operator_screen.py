"""The operator's screen and keys while a session runs."""

import importlib
import math
import os
import select
import sys
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from visavis.cli.app import verbatim
from visavis.devices.contracts import Health
from visavis.lab.clock import NS_PER_S
from visavis.lab.config import INCIDENTS
from visavis.protocol.session.operator import KEYS, Action, Command, SessionStatus
from visavis.protocol.session.states import SessionState
from visavis.running.sessions.device_setup import ESSENTIAL_ROLES

STATUS_PERIOD_NS = NS_PER_S // 4
KEY_LINE = (
    "[b]space[/b] go on  [b]P[/b]ause  [b]R[/b]epeat  [b]S[/b]kip  re[b]C[/b]alibrate  "
    "[b]N[/b]ote  [b]F[/b]lag  [b]W[/b]hy  [b]X[/b] silence haptics  [b]Esc[/b] end"
)
NEEDS_TEXT = {
    Action.SKIP: "Reason for skipping",
    Action.NOTE: "Note",
    Action.REASON: "Reason for the last flag or pause",
}
NEEDS_REASON = (Action.SKIP, Action.REASON)
"""A code may be chosen for these before words are added."""
MAY_HAVE_REASON = {Action.FLAG: "Flagged", Action.PAUSE: "Pausing"}
DIGITS = frozenset("0123456789")
LATE_MS = 1000.0


class KeyReader:
    """Put the terminal in single-key mode while open; a no-op when stdin is not a terminal."""

    def __init__(self) -> None:
        self._saved_mode: list[Any] | None = None
        self._active = sys.stdin.isatty()

    def __enter__(self) -> "KeyReader":
        if self._active and os.name == "posix":
            termios, tty = importlib.import_module("termios"), importlib.import_module("tty")
            self._saved_mode = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._saved_mode is not None:
            termios = importlib.import_module("termios")
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._saved_mode)
            self._saved_mode = None

    def keys(self) -> str:
        """Return the keys pressed since the last call; arrow and function keys are left out."""
        if not self._active:
            return ""
        if os.name == "nt":
            return self._windows_keys()
        if not select.select([sys.stdin], [], [], 0)[0]:
            return ""
        text = os.read(sys.stdin.fileno(), 1024).decode(errors="ignore")
        return "" if len(text) > 1 and text.startswith("\x1b[") else text

    @staticmethod
    def _windows_keys() -> str:
        msvcrt = importlib.import_module("msvcrt")
        keys = ""
        while msvcrt.kbhit():
            key = msvcrt.getwch()
            if key in ("\x00", "\xe0"):
                msvcrt.getwch()
            else:
                keys += key
        return keys


class KeyInterpreter:
    """Turn keys into commands; a skip, note or reason collects its text, Escape asks first.

    `incidents` are the reasons that may be given, by code; digits choose among them where a reason
    is asked for, and nowhere else: they are the participant's answers.
    """

    def __init__(self, incidents: Mapping[str, str] = INCIDENTS) -> None:
        self._incidents = dict(incidents)
        self._collecting: Action | None = None
        self._text = self._code = ""
        self._explainable_action: Action | None = None
        self._asking_to_end = False

    @property
    def entry_line(self) -> str:
        """What the operator is typing or is being asked, or an empty string."""
        if self._asking_to_end:
            return "End the session? Finished trials are kept.  y ends, any other key goes on"
        if self._collecting is not None:
            prompt = f"{NEEDS_TEXT[self._collecting]} (Enter ends, Esc forgets): "
            if self._collecting not in NEEDS_REASON:
                return f"{prompt}{self._text}▏"
            if self._code:
                return f"{prompt}{self._incidents[self._code]}; note: {self._text}▏"
            choices = "   ".join(
                f"{number} {words}" for number, words in enumerate(self._incidents.values(), 1)
            )
            return f"{prompt}{self._text}▏" + ("" if self._text else f"\n{choices}")
        if self._explainable_action is not None:
            return f"{MAY_HAVE_REASON[self._explainable_action]}. W says why"
        return ""

    def feed(self, keys: str) -> list[Command]:
        """Return the commands these keys complete."""
        commands: list[Command] = []
        for key in keys:
            if self._asking_to_end:
                self._asking_to_end = False
                if key.lower() == "y":
                    commands.append(Command(Action.ABORT))
            elif self._collecting is not None:
                commands += self._collect(key)
            else:
                commands += self._begin(key)
        return commands

    def _begin(self, key: str) -> list[Command]:
        self._explainable_action = None
        if key in DIGITS:
            return [Command(Action.ANSWER, key)]
        action = KEYS.get(key.lower())
        if action is None:
            return []
        if action in MAY_HAVE_REASON:
            self._explainable_action = action
        if action is Action.ABORT:
            self._asking_to_end = True
            return []
        if action in NEEDS_TEXT:
            self._collecting = action
            self._text = self._code = ""
            return []
        return [Command(action)]

    def _collect(self, key: str) -> list[Command]:
        assert self._collecting is not None  # noqa: S101 - only called while collecting
        if key in "\r\n":
            command = Command(self._collecting, self._text.strip(), self._code)
            self._collecting = None
            is_empty = command.action is Action.REASON and not command.why
            return [] if is_empty else [command]
        if self._collecting in NEEDS_REASON and not (self._text or self._code) and key in DIGITS:
            self._code = dict(enumerate(self._incidents, 1)).get(int(key), "")
            return []
        if key == "\x1b":
            self._collecting = None
        elif key in "\x7f\b":
            self._text = self._text[:-1]
        elif key.isprintable():
            self._text += key
        return []


class TerminalOperator:
    """Show the session in the terminal and read the operator's keys.

    `confirm_waits` False goes through prompts without a key (rehearsals with simulated
    participants); keys work all the same.
    """

    status_period_ns = STATUS_PERIOD_NS

    def __init__(
        self,
        console: Console,
        *,
        is_simulated: bool,
        confirm_waits: bool,
        incidents: Mapping[str, str] = INCIDENTS,
    ) -> None:
        self._console = console
        self._is_simulated = is_simulated
        self._confirm_waits = confirm_waits
        self._keys = KeyReader()
        self._interpreter = KeyInterpreter(incidents)
        self._live: Live | None = None
        self.abort_requested = False
        self.is_suspended = False
        self._last_line = ""

    def __enter__(self) -> "TerminalOperator":
        self._keys.__enter__()
        if self._console.is_terminal:
            self._live = Live(
                console=self._console, screen=True, auto_refresh=False, transient=True
            )
            self._live.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.__exit__(kind, error, trace)
            self._live = None
        self._keys.__exit__(kind, error, trace)

    def suspend(self) -> None:
        """Give the terminal back for typed questions."""
        self.is_suspended = True
        self.__exit__(None, None, None)

    def poll(self) -> Sequence[Command]:
        """Return the commands completed since the last frame."""
        if self.abort_requested:
            self.abort_requested = False
            return (Command(Action.ABORT, "interrupt signal"),)
        keys = self._keys.keys()
        return self._interpreter.feed(keys) if keys else ()

    def show(self, status: SessionStatus) -> None:
        """Redraw the screen; where there is no terminal, say in a line what has changed."""
        if self._live is not None:
            self._live.update(
                render(status, self._interpreter.entry_line, is_simulated=self._is_simulated),
                refresh=True,
            )
        elif not self._console.is_terminal and (line := status_line(status)) not in (
            "",
            self._last_line,
        ):
            self._last_line = line
            self._console.print(line, markup=False, highlight=False, soft_wrap=True)

    def waits_for_advance(self, prompt: str) -> bool:
        """Wait for the space bar unless this is a rehearsal."""
        return self._confirm_waits


def status_line(status: SessionStatus) -> str:
    """Return a line on what the session is doing; "" in the moments between trials."""
    if status.state in (SessionState.IDLE, SessionState.INTERTRIAL) and not status.prompt:
        return ""
    what = f"trial {status.trial_id}" if status.state is SessionState.TRIAL else status.state.value
    progress = f"{status.trials.done_count} of {status.trials.planned_count} done"
    waits = f"; waiting for you (space): {' '.join(status.prompt.split())}" if status.prompt else ""
    blocking = "".join(
        f"; {f.role}: {f.message} → {f.remedy}" for f in status.faults if f.severity == "blocking"
    )
    return f"{what}, {progress}{waits}{blocking}"


def render(status: SessionStatus, entry_line: str, *, is_simulated: bool) -> Panel:
    """Return the whole screen for a status."""
    parts: list[RenderableType] = [
        _headline(status),
        _progress(status),
        _streams(status.health),
        _calibration(status),
        _faults(status),
    ]
    if status.messages:
        parts.append(Text("\n".join(f"· {m}" for m in status.messages), style="dim"))
    if status.waiting:
        way_on = "space goes on without it" if status.can_go_on and not status.prompt else None
        parts.append(Panel(Text(status.waiting), title=way_on, style="bold red"))
    if status.prompt:
        parts.append(Panel(Text(status.prompt), title="waiting for you: space", style="bold cyan"))
    if entry_line:
        parts.append(Panel(Text(entry_line), style="bold yellow"))
    title = "VISAVIS" + ("  ·  SIMULATED, not a participant" if is_simulated else "")
    return Panel(
        Group(*parts),
        title=title,
        subtitle=KEY_LINE,
        border_style="magenta" if is_simulated else "green",
    )


def _headline(status: SessionStatus) -> Group:
    grid = Table.grid(expand=True, padding=(0, 2))
    for _ in range(4):
        grid.add_column(ratio=1)
    left = "–" if status.trial_left_s is None else f"{math.ceil(status.trial_left_s)} s"
    grid.add_row(
        f"participant  [b]{verbatim(status.participant)}[/b]",
        f"[b]{status.state.value.upper()}[/b]",
        f"block  [b]{status.block or '–'}[/b]",
        f"trial  [b]{status.trial_id or '–'}[/b]",
    )
    grid.add_row(
        f"done  {status.trials.done_count}/{status.trials.planned_count}"
        + (f", {status.trials.skipped_count} skipped" if status.trials.skipped_count else ""),
        f"trial ends in  [b]{left}[/b]",
        f"session left  ~{status.trials.left_s / 60:.0f} min",
    )
    condition = status.condition or ("(hidden)" if status.trial_id else "–")
    return Group(grid, Text(f"condition  {condition}"))


def _progress(status: SessionStatus) -> Table:
    grid = Table.grid(expand=True)  # a bar alone ends no line
    grid.add_column(ratio=1)
    grid.add_row(
        ProgressBar(
            total=max(status.trials.planned_count, 1),
            completed=status.trials.done_count + status.trials.skipped_count,
        )
    )
    return grid


def needs_look(role: str, health: Health) -> bool:
    """Tell whether a device that every trial needs has delivered nothing, or nothing of late."""
    age_ms = health.last_sample_age_ms
    is_late = not health.received or (age_ms is not None and age_ms > LATE_MS)
    return is_late and role in ESSENTIAL_ROLES


def losses_of(health: Mapping[str, Health]) -> str:
    """Return what streams have missed so far ("headset: 3 gaps, longest 222 ms"), or ""."""
    losses = []
    for role, h in health.items():
        parts = []
        if h.gaps:
            plural = "s" if h.gaps > 1 else ""
            parts.append(f"{h.gaps} gap{plural}, longest {h.longest_gap_ms:.0f} ms")
        if h.dropped:
            parts.append(f"{h.dropped} lost")
        if parts:
            losses.append(f"{role.replace('_', ' ')}: {', '.join(parts)}")
    return "; ".join(losses)


def _streams(health: dict[str, Health]) -> Table:
    table = Table(expand=True, box=None, pad_edge=False)
    for name in ("stream", "rate", "gaps", "longest gap", "last sample", "lost", "clock"):
        table.add_column(name, justify="left" if name == "stream" else "right")
    for role, h in health.items():
        age = "–" if h.last_sample_age_ms is None else f"{h.last_sample_age_ms:.0f} ms"
        clock = "–" if h.clock_offset_ms is None else f"{h.clock_drift_ppm or 0:+.0f} ppm"
        if not h.received:
            table.add_row(role, "nothing yet", style="red" if needs_look(role, h) else "dim")
            continue
        style = "red" if needs_look(role, h) else ""
        nominal_text = f" of {h.nominal_rate_hz:g}" if h.nominal_rate_hz else ""
        rate = f"{h.rate_hz:.1f}{nominal_text} Hz"
        table.add_row(
            role,
            rate,
            str(h.gaps),
            f"{h.longest_gap_ms:.0f} ms",
            age,
            str(h.dropped),
            clock,
            style=style,
        )
    return table


def _calibration(status: SessionStatus) -> Text:
    if status.calibration.accuracy_deg is None and not status.calibration.is_planned:
        return Text("calibration  not needed", style="dim")
    if status.calibration.accuracy_deg is None:
        return Text("calibration  none yet", style="yellow")
    age = (status.calibration.age_s or 0) / 60
    text = (
        f"calibration  accuracy {status.calibration.accuracy_deg:.2f}°  "
        f"precision {status.calibration.precision_deg or float('nan'):.2f}°  {age:.0f} min old"
    )
    return Text(text, style="green" if status.calibration.accuracy_deg <= 1.5 else "red")


def _faults(status: SessionStatus) -> Text:
    if not status.faults:
        losses = losses_of(status.health)
        if losses:
            return Text(f"no fault now, but {losses}", style="yellow")
        return Text("no faults", style="green")
    text = Text()
    for fault in status.faults:
        style = "bold red" if fault.severity == "blocking" else "yellow"
        text.append(f"{fault.role}: {fault.message} → {fault.remedy}\n", style=style)
    return text
