"""What long work says while it runs: lines, warnings, and a bar of how much is done."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from cli.app import console


class TerminalTelling:
    """Follow `visavis.sessions.studies.Telling` on the terminal."""

    def say(self, text: str) -> None:
        """Print it."""
        console.print(text, markup=False, highlight=False, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Print it in yellow."""
        console.print(text, style="yellow", markup=False, highlight=False, soft_wrap=True)

    @contextmanager
    def progress(self, what: str) -> Iterator[Callable[[int, int], None]]:
        """Show a bar."""
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                   TimeElapsedColumn(), TimeRemainingColumn())  # fmt: skip
        with Progress(*columns, console=console) as bar:
            line = bar.add_task(what, total=None)
            yield lambda done, of: bar.update(line, completed=done, total=of)


TELLING = TerminalTelling()
