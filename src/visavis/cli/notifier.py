"""Messages, warnings and progress bars of long work."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

from visavis.analysis.report.notation import count_of
from visavis.cli.app import console, errors, say_plainly
from visavis.lab.clock import StopWatch

if TYPE_CHECKING:
    from visavis.lab.config import LabConfig
    from visavis.results.opened_study import OpenedStudy
    from visavis.running.film_store import FilmStore
    from visavis.study.experiment import StudyExperiment
    from visavis.study.films import Film

MEASURED_PICTURES = 8
"""Number of pictures from which a film's time is estimated, after the first, which loads
everything.
"""
SOON_S = 10.0
"""Work that ends within this time is not announced."""
COMPILING_NOTE = (
    "first start after installing or updating: compiling numeric code, once (a minute or two, "
    "longer on a busy computer)"
)


def time_left(elapsed_s: float, count: int, total: int) -> str:
    """Return how long the rest of some work takes at the pace so far; "" where nobody knows."""
    return _about(elapsed_s / count * (total - count)) if 0 < count < total else ""


def _about(seconds: float) -> str:
    return f"about {seconds:.0f} s" if seconds < 90 else f"about {seconds / 60:.0f} min"


class _TimeLeft(ProgressColumn):
    """The time that is left at the mean pace: pieces of work that are done at once mislead less."""

    def render(self, task: Task) -> Text:
        """Return it; nothing before the first piece of work is done."""
        if task.total is None or task.elapsed is None:
            return Text()
        left = time_left(task.elapsed, int(task.completed), int(task.total))
        return Text(f"{left} more" if left else "", style="progress.remaining")


def counting(shown_on: Console, *, quiet: bool = False) -> Progress:
    """Return a progress bar with the amount done, the total, and the time passed and left."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        _TimeLeft(),
    )
    return Progress(*columns, console=shown_on, disable=quiet)


class TerminalNotifier:
    """Follow `visavis.running.sessions.studies.Notifier` on the terminal."""

    def say(self, text: str) -> None:
        """Print it."""
        say_plainly(text)

    def warn(self, text: str) -> None:
        """Print it in yellow."""
        say_plainly(text, style="yellow")

    @contextmanager
    def progress(self, what: str) -> Iterator[Callable[[int, int], None]]:
        """Show a bar from the first second; without a terminal, a line when there is work to do."""
        is_announced = console.is_terminal
        with counting(console) as bar:
            line = bar.add_task(what, total=None)

            def report(count: int, total: int) -> None:
                nonlocal is_announced
                if not is_announced and count < total:
                    errors.print(f"{what} …", soft_wrap=True, highlight=False, markup=False)
                    is_announced = True
                # Show no bar when there is nothing to do.
                bar.update(line, completed=count, total=total, visible=total > 0)

            yield report


NOTIFIER = TerminalNotifier()


@cache
def say_when_compiling() -> None:
    """Print once per process, on stderr, that compiling has begun; nothing else would show it."""
    from visavis.lab.compiled import announce_compiling  # late: it loads numba

    announce_compiling(lambda: errors.print(f"[dim]{COMPILING_NOTE}[/]", soft_wrap=True))


def build_missing_films(store: "FilmStore", films: "Sequence[Film]") -> None:
    """Build the films of a study that are missing, and say from the first second what is done."""
    with NOTIFIER.progress("looking for films drawn before") as on_progress:
        missing = store.missing(films, on_progress)
    if missing:
        with NOTIFIER.progress(
            f"drawing {count_of(len(missing), 'film')}, pictures"
        ) as on_progress:
            store.build(missing, on_progress)


def prepare_pages(store: "FilmStore", experiment: "StudyExperiment") -> None:
    """Make what a study's pages show, and say from the first second what is done."""
    # Late: verbs that run no session load neither people nor rooms.
    from visavis.running.live_store import prepare_live_films
    from visavis.study.films import LiveFilm

    if experiment.films:
        build_missing_films(store, experiment.films)
    if any(isinstance(live, LiveFilm) for live in experiment.lives):
        with NOTIFIER.progress(f"getting {experiment.name} ready") as on_progress:
            experiment.prepare(on_progress)
        with NOTIFIER.progress("computing everybody's poses, scenes") as on_progress:
            prepare_live_films(experiment.lives, store, on_progress)


def make_ready(study: "OpenedStudy", experiment: "StudyExperiment", config: "LabConfig") -> None:
    """Prepare a study so that no frame is held up later; a second call takes no time."""
    # Late: verbs that run no session load neither devices nor pumps.
    from visavis.running.sessions.perform import get_ready

    with NOTIFIER.progress(f"getting {experiment.name} ready") as on_progress:
        trouble = get_ready(study, experiment, config, on_progress)
    if trouble:
        NOTIFIER.warn(trouble)


class Forecast:
    """Estimate a film's time from its first pictures, and say once what would shorten it."""

    def __init__(self, elapsed_s: Callable[[], float] | None = None) -> None:
        self._elapsed_s = elapsed_s or StopWatch().elapsed_s
        self._first_s = 0.0

    def line_after(self, count: int, total: int) -> str:
        """Return the line to print after `count` of `total` pictures; mostly empty."""
        if count == 1:
            self._first_s = self._elapsed_s()
        if count != MEASURED_PICTURES + 1:
            return ""
        left_s = (self._elapsed_s() - self._first_s) / MEASURED_PICTURES * (total - count)
        if left_s < SOON_S:
            return ""
        return (
            f"{total} pictures, {_about(left_s)} more; --seconds, --rate and --size make it fewer "
            "and smaller ones, --png draws one"
        )


class Pace:
    """Say how long work still takes where no bar does: after its first piece, and each tenth."""

    def __init__(self, what: str, elapsed_s: Callable[[], float] | None = None) -> None:
        self._what = what
        self._elapsed_s = elapsed_s or StopWatch().elapsed_s
        self._tenth = -1

    def line_after(self, count: int, total: int) -> str:
        """Return the line to print after `count` of `total` pieces; mostly empty."""
        elapsed_s, tenth = self._elapsed_s(), 10 * count // total
        if tenth == self._tenth or elapsed_s / count * (total - count) < SOON_S:
            return ""
        self._tenth = tenth
        return f"{self._what}: {count} of {total} done, {time_left(elapsed_s, count, total)} more"
