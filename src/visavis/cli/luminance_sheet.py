"""Measure a screen's luminances: greys that fill it, what a photometer says of each, and a fit."""

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pandas as pd
import typer
from rich.table import Table

from visavis.cli.app import console, errors, verbatim
from visavis.lab.config import Screen
from visavis.lab.errors import DeviceError, UsageError
from visavis.lab.luminance import GREY, GUNS, WHITE, LuminanceTable
from visavis.recording.csv_file import csv_text, write_csv
from visavis.recording.durable import replace_file

Rgb: TypeAlias = tuple[int, int, int]
Step: TypeAlias = tuple[str, int]
"""A gun, or grey, and the level at which its luminance is measured."""
Asker: TypeAlias = Callable[[Rgb, str], str]
"""Asks something while a colour fills the screen, and returns what was typed."""
LOOKS_S = 0.05
"""How often the window takes the system's events while somebody types."""


@contextmanager
def full_field(screen: Screen) -> Iterator[Asker]:
    """Open the participant's window, and yield what fills it with a colour while it asks.

    Raises:
        StageError: there is no such monitor, or it has other pixels.
    """
    # late: graphics libraries, which a table in a file does without
    from visavis.stage.window import Window

    window = Window(
        "Visavis: luminances",
        (screen.width_px, screen.height_px),
        monitor=screen.monitor if screen.fullscreen else None,
    )

    def fill(rgb: Rgb) -> None:
        window.context.screen.use()
        red, green, blue = (value / WHITE for value in rgb)
        window.context.clear(red, green, blue)
        window.present()

    def ask(rgb: Rgb, prompt: str) -> str:
        fill(rgb)
        answers: queue.Queue[str | EOFError] = queue.Queue()
        # The window has to take events meanwhile, or the system greys it.
        threading.Thread(target=_read, args=(prompt, answers), daemon=True).start()
        while answers.empty():
            if window.closed:
                raise DeviceError(
                    "the window was closed", role="screen", remedy="give the command again"
                )
            window.attend(LOOKS_S)
            fill(rgb)
        answer = answers.get()
        if isinstance(answer, EOFError):
            raise answer
        return answer

    try:
        yield ask
    finally:
        window.close()


def _read(prompt: str, answers: "queue.Queue[str | EOFError]") -> None:
    try:
        answers.put(console.input(prompt))
    except EOFError as error:
        answers.put(error)


@dataclass(frozen=True)
class Draft:
    """Luminances of a screen as far as somebody typed them, in a file, so that they can go on.

    Its entries are those of the first steps, None where a level was left out.
    """

    path: Path
    screen: str

    def write(self, steps: Sequence[Step], entries: Sequence[float | None]) -> None:
        """Write entries in place of earlier ones; without any there is no file."""
        if not entries:
            self.path.unlink(missing_ok=True)
            return
        rows = [(*step, entry) for step, entry in zip(steps, entries, strict=False)]
        table = pd.DataFrame(rows, columns=["gun", "level", "cd_m2"])
        replace_file(self.path, csv_text(table.assign(screen=self.screen)).encode())

    def read(self, steps: Sequence[Step]) -> list[float | None]:
        """Return the entries of the first of these steps; none where there is no file.

        Raises:
            UsageError: they are of other steps or another screen, or the file is damaged.
        """
        if not self.path.exists():
            return []
        try:
            table = pd.read_csv(self.path)
            own = list(zip(table["gun"], table["level"], strict=True)) == [*steps[: len(table)]]
            own = own and set(table["screen"]) <= {self.screen}
            entries = [None if np.isnan(e) else float(e) for e in table["cd_m2"]]
        except (ValueError, KeyError, TypeError) as error:
            raise UsageError(
                f"{self.path}, where measuring stopped, is damaged ({error}); delete it to measure "
                "anew"
            ) from error
        if not own:
            raise UsageError(
                f"{self.path} holds {len(entries)} luminances of other levels, guns or of another "
                "screen than are asked for; give --levels and --guns as before to go on from "
                "them, or delete it to measure anew"
            )
        return entries


def measured_steps(level_count: int, *, guns: bool) -> list[Step]:
    """Return what is measured: rising levels of grey, and of each gun by itself."""
    levels = [int(level) for level in np.rint(np.linspace(0, WHITE, level_count))]
    return [(gun, level) for gun in (GREY, *(GUNS if guns else ())) for level in levels]


def measure(
    ask: Asker,
    steps: Sequence[Step],
    entries: Sequence[float | None] = (),
    note: Callable[[Sequence[float | None]], None] = lambda entries: None,
) -> list[tuple[str, int, float]]:
    """Return gun, level and luminance of steps, as somebody types them after earlier `entries`.

    What is no number, or not more than that of the level before, is asked again. `b` goes back to
    the level before; nothing leaves a level out, but not the first and the last. `note` gets all
    entries after each.
    """
    entries = list(entries)
    while len(entries) < len(steps):
        gun, level = steps[len(entries)]
        rgb = tuple(level if gun in (GREY, own) else 0 for own in GUNS)
        prompt = f"{gun} {level} ({len(entries) + 1} of {len(steps)}), cd/m² > "
        answer = ask((rgb[0], rgb[1], rgb[2]), prompt).strip()
        if answer == "b":
            del entries[-1:]
        elif not answer and 0 < level < WHITE:
            entries.append(None)
        else:
            lower = [
                e for (of, _), e in zip(steps, entries, strict=False) if of == gun and e is not None
            ]
            cd_m2 = _number(answer, lower[-1] if lower else -1.0)
            if cd_m2 is None:
                continue
            entries.append(cd_m2)
        note(entries)
    pairs = zip(steps, entries, strict=True)
    return [(gun, level, cd_m2) for (gun, level), cd_m2 in pairs if cd_m2 is not None]


def _number(answer: str, before: float) -> float | None:
    """Return a typed luminance (cd/m²); None, and say why, where it is none or does not rise."""
    try:
        cd_m2 = float(answer.replace(",", "."))
    except ValueError:
        cd_m2 = np.nan
    if not 0.0 <= cd_m2 < np.inf:
        console.print("[yellow]a number of cd/m², or b for the level before[/]")
        return None
    if cd_m2 <= before:
        console.print(
            f"[yellow]not more than {before:g} of the level before: enter it again, nothing to "
            "leave this level out, or b for the level before[/]"
        )
        return None
    return cd_m2


def typed_luminances(
    screen: Screen, draft: Draft, level_count: int, *, guns: bool
) -> list[tuple[str, int, float]]:
    """Return gun, level and luminance of greys on a screen, as somebody types them.

    Everything typed is in the draft at once; what is there from before is offered to go on from.

    Raises:
        UsageError: the draft is of other steps or another screen, or damaged.
        DeviceError: the window was closed.
        StageError: see `full_field`.
    """
    steps = measured_steps(level_count, guns=guns)
    entries = draft.read(steps)
    if entries:
        question = f"{draft.path} holds the first {len(entries)} of {len(steps)}; go on from there?"
        entries = entries if typer.confirm(question, default=True, err=True) else []
    try:
        with full_field(screen) as ask:
            return measure(ask, steps, entries, partial(draft.write, steps))
    except (DeviceError, EOFError, KeyboardInterrupt):
        if draft.path.exists():
            errors.print(
                f"what was typed stands in {verbatim(draft.path)}; the same command goes on there",
                soft_wrap=True,
                highlight=False,
            )
        raise


def write_table(rows: Sequence[tuple[str, int, float]], screen: str, path: Path) -> None:
    """Write luminances with the screen that they were measured on."""
    table = pd.DataFrame(rows, columns=["gun", "level", "cd_m2"])
    write_csv(table.assign(screen=screen), path)


def print_fit(table: LuminanceTable) -> None:
    """Print least and greatest luminance, gamma and residuals of everything measured."""
    sheet = Table(box=None, pad_edge=False)
    for name in ("gun", "levels", "least", "greatest", "gamma", "rms off", "most off"):
        sheet.add_column(name, justify="left" if name == "gun" else "right")
    for curve in table.curves:
        fit = curve.fit
        sheet.add_row(
            curve.gun,
            str(len(curve.levels)),
            f"{curve.cd_m2[0]:.3g} cd/m²",
            f"{curve.cd_m2[-1]:.4g} cd/m²",
            f"{fit.gamma:.2f}",
            f"{fit.rms_cd_m2:.2g} cd/m²",
            f"{fit.largest_cd_m2:.2g} cd/m² at {fit.worst_level}",
        )
    console.print(sheet)
    console.print(verbatim(table.summary), soft_wrap=True)
