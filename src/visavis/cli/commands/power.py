"""power: find by simulation how many participants a study needs."""

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from rich.table import Table

from visavis.analysis.plots import write_figure
from visavis.analysis.power import (
    ANYTHING,
    PRIMARY,
    PowerRequest,
    PowerStudy,
    PowerSummary,
    Source,
    TestPower,
    draw_power,
    jobs_of,
    run_job,
    summarise,
)
from visavis.analysis.power.summary import target_text
from visavis.analysis.statistics import PowerPoint
from visavis.analysis.statistics.power_estimates import AdequacyRule
from visavis.analysis.statistics.results import number
from visavis.cli.app import (
    ConfigOption,
    JsonOption,
    StudyArgument,
    app,
    console,
    errors,
    load_lab,
    say,
    say_json,
    verbatim,
)
from visavis.cli.commands.study import ProcessesOption
from visavis.cli.notifier import Pace, counting, say_when_compiling
from visavis.cli.quick_tracker import tracker_of
from visavis.lab.clock import StopWatch
from visavis.lab.errors import UsageError
from visavis.recording.csv_file import write_csv
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.power import KitPower
from visavis.running.quick import quick_study
from visavis.running.sessions.runners import on_scheduler, on_this_machine
from visavis.running.sessions.simulation import worker_count
from visavis.running.sessions.study_folder import DEFAULT_SEED, read_parameters
from visavis.study.catalogue import reference_of

TESTS_PER_TABLE = 5
WIDEST_COLUMN = 60
"""Characters for all columns of one table together."""
POOL_PEOPLE = 240
"""People simulated for --fast: as many as five large studies."""
POOL_TIMES = 5
"""A pool smaller than this many times the largest study makes the simulated studies too alike."""
POOL_PART = 8
ALONE = 2
"""So many people of a pool are simulated by themselves first: they tell how long all will take."""
FAST_JOB = 10
POOL_SEED_STEP = 1_000_003


def power_study(
    name: str,
    of_lab: Mapping[str, Path] | None = None,
    assignments: Sequence[str] | None = None,
) -> KitPower:
    """Return a study's power simulation.

    Raises:
        UsageError: there is no such study, or it offers no simulation.
    """
    say_when_compiling()
    opened_study = find_study(name, of_lab)
    if not isinstance(opened_study, OpenedStudy):
        raise UsageError(f"{name} offers no power simulation yet; studies on the kit do")
    overrides = read_parameters(list(assignments or ()))
    opened_study.experiment_to_run(overrides)  # refuses wrong parameters before any work begins
    return KitPower(reference_of(opened_study.study), tracker_of, quick_study, overrides=overrides)


@app.command()
def power(
    study: StudyArgument,
    participants: Annotated[
        str,
        typer.Option("--participants", help="First:last:step, such as 8:48:4, or 12,16,24."),
    ] = "8:48:4",
    effect: Annotated[
        str,
        typer.Option("--effect", help="published, none, or a multiplier of it such as 0.5."),
    ] = "published",
    replicates: Annotated[
        int, typer.Option("--replicates", help="Simulated studies per curve.")
    ] = 500,
    tests: Annotated[
        list[str] | None,
        typer.Option("--test", help="Planned test, repeatable; the first decides. list: all."),
    ] = None,
    fast: Annotated[
        bool, typer.Option("--fast", help="Draw people from one large simulated pool.")
    ] = False,
    source: Annotated[
        Path | None,
        typer.Option("--from", help="Draw people from this analysed study's folder instead."),
    ] = None,
    pool: Annotated[
        int, typer.Option("--pool", help="People in the simulated pool of --fast.")
    ] = POOL_PEOPLE,
    alpha: Annotated[float, typer.Option("--alpha", help="Level of the study.")] = 0.05,
    target: Annotated[float, typer.Option("--power", help="Power that is adequate.")] = 0.8,
    rule: Annotated[
        str,
        typer.Option("--rule", help="bound: the interval's lower end must reach it; or point."),
    ] = "bound",
    seed: Annotated[int, typer.Option("--seed", help="Seed of the simulation.")] = DEFAULT_SEED,
    processes: ProcessesOption = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="Address of a Dask scheduler, tcp://host:8786."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder; a new power_STUDY when left out.")
    ] = None,
    config: ConfigOption = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a parameter of the study: --set repetitions=8"),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Find the number of participants a study needs, by simulating it many times.

    Every replicate goes through the study's own exclusion rules and tests.

    Example: visavis power stare --participants 8:32:8 --replicates 200 --fast
    """
    of_lab = load_lab(config, "sim", only_simulates=True, quiet=as_json).studies
    simulation = power_study(study, of_lab, assignments)
    if tests and "list" in tests:
        for name, claim in simulation.tests.items():
            rank = " (primary)" if name in simulation.primary_tests else ""
            typer.echo(f"{name:40} {claim}{rank}")
        return
    # Read every option before the first simulation: a typing error must not cost an hour.
    watch = StopWatch()
    request = PowerRequest(
        numbers=read_numbers(participants, at_least=simulation.smallest_n),
        tests=read_tests(simulation, tests, read_effect(effect)),
        replicates=replicates,
        effect=read_effect(effect),
        alpha=alpha,
        seed=seed,
    )
    simulation.effect_meaning(request.effect, "studies")
    adequacy = read_rule(rule)
    run = _Run(simulation, request, worker_count(processes), scheduler, quiet=as_json)
    if source is None:
        run.prepare()
    people, kind, are_simulated, notes = run.people(source, fast=fast, pool=pool)
    if source is None and (times := simulation.unplanted_times):
        notes = (
            f"the power of {', '.join(times)} cannot be known: simulated people answer after a "
            "time that does not depend on what they see; let @study.answer return a Race",
            *notes,
        )
    if assignments:
        notes = (f"the study with {', '.join(assignments)}", *notes)
    # A replicate that simulates its own people is a job; drawing from a pool is so quick that
    # many replicates share one.
    jobs = jobs_of(simulation, request, size=1 if people is None else FAST_JOB, people=people)
    sizes = [len(job.replicates) for job in jobs]
    results = [r for _, part in run.jobs(run_job, jobs, sizes, "replicates") for r in part]
    summary = summarise(
        simulation,
        request,
        results,
        source=kind,
        people_are_simulated=are_simulated,
        target=target,
        rule=adequacy,
        notes=notes,
    )
    folder = free_folder(f"power_{simulation.name}") if output is None else output
    paths = write_power(summary, folder)
    if as_json:
        say_json(as_data(summary, paths))
        return
    print_power(summary)
    console.print(f"{replicates} replicates in {watch.elapsed_s():.0f} s")
    say(f"curve and figure in [b]{verbatim(folder)}[/]")


class _Run:
    """The jobs of one power simulation: where they run, and the progress bar meanwhile."""

    def __init__(
        self,
        study: PowerStudy,
        request: PowerRequest,
        processes: int,
        scheduler: str | None,
        *,
        quiet: bool,
    ) -> None:
        self._study = study
        self._request = request
        self._processes = processes
        self._scheduler = scheduler
        self._quiet = quiet

    def prepare(self) -> None:
        """Compute the slow parts once before the processes start; the results are cached."""
        with counting(errors, quiet=self._quiet) as bar:
            line = bar.add_task(f"getting {self._study.name} ready", total=None)
            self._study.prepare(
                lambda count, total: bar.update(
                    line, completed=count, total=total, visible=total > 0
                )
            )

    def jobs(
        self, work: Any, jobs: list[Any], sizes: list[int], what: str
    ) -> Iterator[tuple[int, Any]]:
        """Yield (job number, result) as they finish, with progress; `sizes` are of the jobs."""
        pace, count, total = Pace(what), 0, sum(sizes)
        has_lines = not (self._quiet or errors.is_terminal)
        if has_lines:
            errors.print(f"{what} …", soft_wrap=True, highlight=False, markup=False)
        with counting(errors, quiet=self._quiet) as bar:
            line = bar.add_task(what, total=total)
            results = (
                on_this_machine(work, jobs, self._processes)
                if self._scheduler is None
                else on_scheduler(work, jobs, self._scheduler)
            )
            for number_, result in results:
                count += sizes[number_]
                bar.update(line, completed=count)
                if has_lines and (text := pace.line_after(count, total)):
                    errors.print(text, soft_wrap=True, highlight=False, markup=False)
                yield number_, result

    def people(
        self, source: Path | None, *, fast: bool, pool: int
    ) -> tuple[pd.DataFrame | None, Source, bool, tuple[str, ...]]:
        """Return the people to draw from, their source, whether they are simulated, and notes.

        People are None where every replicate simulates its own.

        Raises:
            UsageError: the pool is smaller than the largest study.
        """
        effect = self._request.effect
        if source is not None:
            people, is_simulated = self._study.people_of(source, effect=effect)
            count = people["participant"].nunique()
            note = (
                f"{count} people to draw from: the curve inherits their chance differences, "
                "and an effect measured in few people is more often too large than too small"
            )
            return people, "study folder", is_simulated, (note,)
        if not fast:
            return None, "studies", True, ()
        if pool < max(self._request.numbers):
            raise UsageError(
                f"a pool of {pool} is smaller than the largest study "
                f"({max(self._request.numbers)}); give --pool a few times that"
            )
        seed = self._request.seed + POOL_SEED_STEP
        begins = sorted({*range(min(ALONE, pool)), *range(ALONE, pool, POOL_PART)})
        parts = [
            PoolPart(self._study, tuple(range(begin, end)), effect, seed)
            for begin, end in pairwise((*begins, pool))
        ]
        sizes = [len(part.indices) for part in parts]
        what = f"simulating a pool of {pool} people"
        tables_by_part = dict(self.jobs(simulate_part, parts, sizes, what))
        people = pd.concat([tables_by_part[i] for i in range(len(parts))], ignore_index=True)
        note = (
            f"drawn from one pool of {pool} simulated people: all replicates share its chance "
            "differences; whole studies (without --fast) do not"
        )
        largest = max(self._request.numbers)
        if pool < POOL_TIMES * largest:
            size_note = (
                f"{pool} people are few to draw studies of {largest} from: the same ones come "
                f"again and again, and the curve may lie far off; give --pool "
                f"{POOL_TIMES * largest} or more, or leave --fast out"
            )
            return people, "simulated pool", True, (size_note, note)
        return people, "simulated pool", True, (note,)


@dataclass(frozen=True)
class PoolPart:
    """Some people of the pool of --fast."""

    study: PowerStudy
    indices: tuple[int, ...]
    effect: float
    seed: int


def simulate_part(part: PoolPart) -> pd.DataFrame:
    """Simulate some people of a pool."""
    return part.study.simulate_people(part.indices, effect=part.effect, seed=part.seed)


def read_numbers(text: str, *, at_least: int) -> tuple[int, ...]:
    """Read numbers of participants: '8:48:4' (both ends included), '12,16,24' or '20'.

    Raises:
        UsageError: it is no such list, or a number is too small for the planned tests.
    """
    try:
        if ":" in text:
            parts = [int(p) for p in text.split(":")]
            if len(parts) not in (2, 3):
                raise ValueError
            first, last, step = (*parts, 1)[:3]
            numbers = list(range(first, last + 1, step)) if step > 0 else []
        else:
            numbers = sorted({int(p) for p in text.split(",")})
    except ValueError:
        numbers = []
    if not numbers:
        raise UsageError(
            f"--participants takes first:last:step such as 8:48:4, or a list such as 12,16,24, "
            f"not {text!r}"
        )
    if numbers[0] < at_least:
        raise UsageError(
            f"--participants begins at {numbers[0]}; the planned tests need at least {at_least}"
        )
    return tuple(numbers)


def read_effect(text: str) -> float:
    """Read the multiplier of the effect; published is 1, none is 0.

    Raises:
        UsageError: it is none of these words and no multiplier.
    """
    multipliers = {"published": 1.0, "none": 0.0}
    try:
        value = multipliers[text] if text in multipliers else float(text)
    except ValueError:
        value = float("nan")
    if not (np.isfinite(value) and value >= 0):
        raise UsageError(
            f"--effect takes published, none, or a multiplier such as 0.5, not {text!r}"
        )
    return value


def read_rule(text: str) -> AdequacyRule:
    """Read which number must reach the target power: the lower bound or the estimate."""
    rules: dict[str, AdequacyRule] = {"bound": "lower bound", "point": "estimate"}
    if text not in rules:
        raise UsageError(f"--rule takes bound or point, not {text!r}")
    return rules[text]


def read_tests(study: PowerStudy, names: list[str] | None, effect: float = 1.0) -> tuple[str, ...]:
    """Return the planned tests to simulate; without an effect, whether anything is found, too.

    Raises:
        UsageError: the study plans no test of this name; the message suggests the nearest.
    """
    if not names:
        whole = [name for name in study.tests if name in (PRIMARY, ANYTHING) and effect == 0]
        return (*study.shown_tests, *whole)
    if names == ["all"]:
        return tuple(study.tests)
    for name in names:
        if name not in study.tests:
            near = difflib.get_close_matches(name, study.tests, n=1, cutoff=0.3)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise UsageError(
                f"{study.name} plans no test {name!r}{hint} All: visavis power {study.name} "
                "--test list"
            )
    return tuple(dict.fromkeys(names))


def free_folder(name: str) -> Path:
    """Return a folder that does not exist yet: NAME, else NAME_2, NAME_3 and so on."""
    folder = Path(name)
    number = 1
    while folder.exists():
        number += 1
        folder = Path(f"{name}_{number}")
    return folder


def write_power(summary: PowerSummary, folder: Path) -> tuple[Path, ...]:
    """Write power.csv, power.txt and the figure; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "power.csv"
    write_csv(pd.DataFrame(list(summary.rows())), table)
    words = folder / "power.txt"
    figure = draw_power(summary)
    lines = [summary.sentence(), figure.caption, *(f"Note: {note}." for note in summary.notes)]
    words.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    return (table, words, *write_figure(figure, folder))


def as_data(summary: PowerSummary, files: tuple[Path, ...]) -> dict[str, Any]:
    """Return the summary for other programs; numbers that do not exist are null."""
    return {
        "smallest_n": summary.smallest_n,
        "sentence": summary.sentence(),
        "effect": summary.effect_meaning,
        "rule": summary.rule_of_significance,
        "is_simulated": True,
        "people_are_simulated": summary.people_are_simulated,
        "rows": list(summary.rows()),
        "tests": [
            {
                "test": t.name,
                "claim": t.claim,
                "smallest_n": t.curve.smallest,
                "difference": t.difference if np.isfinite(t.difference) else None,
                "standardised": t.standardised if np.isfinite(t.standardised) else None,
            }
            for t in summary.tests
        ],
        "notes": list(summary.notes),
        "files": [str(p) for p in files],
    }


def print_power(summary: PowerSummary) -> None:
    """Print the curves, the answer and what to know about it."""
    numbers = summary.request.numbers
    for first in range(0, len(summary.tests), TESTS_PER_TABLE):
        console.print(_table(summary, summary.tests[first : first + TESTS_PER_TABLE]))
    curve = summary.tests[0].curve
    of_pairs = any(np.isfinite(t.difference) or np.isfinite(t.standardised) for t in summary.tests)
    say(
        f"In brackets the 95 % Monte-Carlo interval. Enough: "
        f"{target_text(curve.target, curve.rule)}."
        + (
            f" Difference and dz, of comparisons of two levels: as found at n = {numbers[-1]}, "
            "mean of replicates."
            if of_pairs
            else ""
        )
    )
    say(f"{summary.effect_meaning}.")
    say(f"[b]{summary.sentence()}[/]".replace("CI [", "CI \\["))
    for note in summary.notes:
        say(f"note: {verbatim(note)}")


def _table(summary: PowerSummary, tests: tuple[TestPower, ...]) -> Table:
    table = Table(
        title=f"Power of {summary.study} in percent (SIMULATED)", title_justify="left", box=None
    )
    table.add_column("n", justify="right", no_wrap=True, min_width=10)
    for t in tests:
        width = WIDEST_COLUMN // max(len(tests), 3)
        table.add_column(t.claim, justify="right", width=width, overflow="fold")
    for i, n in enumerate(summary.request.numbers):
        points = [t.curve.points[i] for t in tests]
        table.add_row(
            str(n),
            *(_percent(p) for p in points),
        )
    table.add_section()
    table.add_row("enough", *(str(t.curve.smallest or "none") for t in tests), style="bold")
    for label, values in (
        ("difference", [t.difference for t in tests]),
        ("dz", [t.standardised for t in tests]),
    ):
        if np.isfinite(values).any():  # tests of more than two levels have no single difference
            table.add_row(label, *(number(v) if np.isfinite(v) else "–" for v in values))
    return table


def _percent(point: PowerPoint) -> str:
    low, high = (round(100 * v) for v in (point.interval.low, point.interval.high))
    return f"{100 * point.power:.0f} ({low}–{high})"
