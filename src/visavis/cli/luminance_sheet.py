"""Measure a screen's luminances: greys that fill it, what a photometer says of each, and a fit."""

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pandas as pd
from rich.table import Table

from visavis.cli.app import console, verbatim
from visavis.lab.config import Screen
from visavis.lab.errors import DeviceError
from visavis.lab.luminance import GREY, GUNS, WHITE, LuminanceTable
from visavis.recording.csv_file import write_csv

Rgb: TypeAlias = tuple[int, int, int]
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
                    "the window was closed", role="screen", remedy="measure once more"
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


def measure(ask: Asker, level_count: int, *, guns: bool) -> list[tuple[str, int, float]]:
    """Return gun, level and luminance of rising levels, as somebody types them.

    What is no number, or not more than that of the level before, is asked again. `b` goes back to
    the level before; nothing leaves a level out, but not the first and the last.
    """
    levels = [int(level) for level in np.rint(np.linspace(0, WHITE, level_count))]
    steps = [(gun, level) for gun in (GREY, *(GUNS if guns else ())) for level in levels]
    entries: list[float | None] = []  # of each step; None where it is left out
    while len(entries) < len(steps):
        gun, level = steps[len(entries)]
        rgb = tuple(level if gun in (GREY, own) else 0 for own in GUNS)
        prompt = f"{gun} {level} ({len(entries) + 1} of {len(steps)}), cd/m² > "
        answer = ask((rgb[0], rgb[1], rgb[2]), prompt).strip()
        if answer == "b":
            del entries[-1:]
            continue
        if not answer and 0 < level < WHITE:
            entries.append(None)
            continue
        try:
            cd_m2 = float(answer.replace(",", "."))
        except ValueError:
            cd_m2 = np.nan
        lower = [
            e for (of, _), e in zip(steps, entries, strict=False) if of == gun and e is not None
        ]
        before = lower[-1] if lower else -1.0
        if not 0.0 <= cd_m2 < np.inf:
            console.print("[yellow]a number of cd/m², or b for the level before[/]")
        elif cd_m2 <= before:
            console.print(
                f"[yellow]not more than {before:g} of the level before: enter it again, nothing to "
                "leave this level out, or b for the level before[/]"
            )
        else:
            entries.append(cd_m2)
    pairs = zip(steps, entries, strict=True)
    return [(gun, level, cd_m2) for (gun, level), cd_m2 in pairs if cd_m2 is not None]


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
