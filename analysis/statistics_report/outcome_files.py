"""Write an outcome: tables as CSV, words as text, figures as SVG and PNG."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from visavis.analysis.plots import BLUE, ReportFigure, draw, new_figure, write_figure
from visavis.analysis.statistics import StatisticsError, estimation_plot
from visavis.analysis.statistics.results import Row
from visavis.analysis.statistics_report.assumptions import draw_assumptions
from visavis.analysis.statistics_report.outcome import Outcome, Samples
from visavis.analysis.statistics_report.r_code import DATA_FILE, r_code
from visavis.recording.csv_file import write_csv
from visavis.recording.durable import make_folder, protect_files

R_FILE = "repeat.R"
OWN_FILES = (
    DATA_FILE,
    R_FILE,
    "tests.csv",
    "contrasts.csv",
    "cells.csv",
    "error_rates.csv",
    "report.txt",
    "estimation_*.svg",
    "estimation_*.png",
    "scatter_*.svg",
    "scatter_*.png",
    "assumptions.svg",
    "assumptions.png",
)
"""Files that an outcome writes; old ones are removed, so that none passes for the next one's."""


def write_outcome(outcome: Outcome, folder: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Write everything; return the files and what could not be drawn, with the reason.

    Files that an earlier outcome left in the folder are removed, others stay.
    """
    make_folder(folder, exist_ok=True)
    for pattern in OWN_FILES:
        for old in folder.glob(pattern):
            old.unlink()
    files = []
    for name, rows in (
        ("tests", outcome.rows),
        ("contrasts", outcome.contrasts),
        ("cells", outcome.cells),
        ("error_rates", outcome.error_rates),
    ):
        if rows:
            path = folder / f"{name}.csv"
            frame = pd.DataFrame([dict(r) for r in rows])
            write_csv(frame.assign(is_simulated=outcome.is_simulated), path)
            files.append(path)
    code = r_code(outcome)
    if code and outcome.data is not None:
        tested_rows = outcome.data.assign(is_simulated=outcome.is_simulated)
        write_csv(tested_rows, folder / DATA_FILE)
        (folder / R_FILE).write_text(code, encoding="utf-8", newline="\n")
        files += [folder / DATA_FILE, folder / R_FILE]
    words = folder / "report.txt"
    words.write_text(outcome_text(outcome), encoding="utf-8", newline="\n")
    files.append(words)
    assumptions = draw_assumptions(outcome)
    if assumptions is not None:
        files += write_figure(assumptions, folder)
    problems = []
    for samples in outcome.samples:
        try:
            figure = draw_samples(samples, outcome)
        except StatisticsError as error:
            problems.append(f"no figure of {samples.name}: {error}")
            continue
        files += write_figure(figure, folder)
    protect_files(files)
    return tuple(files), tuple(problems)


def outcome_text(outcome: Outcome) -> str:
    """Return everything that can be said in words."""
    parts = ["SIMULATED DATA"] if outcome.is_simulated else []
    parts += [outcome.title, "", *outcome.sentences]
    for heading, lines in (
        ("How it was decided", [f"{i}. {line}" for i, line in enumerate(outcome.path, 1)]),
        ("Contrasts", outcome.contrast_sentences),
        ("Notes", [f"- {note}" for note in outcome.notes]),
    ):
        if lines:
            parts += ["", heading, *lines]
    return "\n".join(parts) + "\n"


def draw_samples(samples: Samples, outcome: Outcome) -> ReportFigure:
    """Draw one figure; simulated data are marked."""
    name = re.sub(r"[^\w.-]+", "_", samples.name)
    scatter = samples.kind == "scatter"
    caption = (
        "One dot per participant."
        if scatter
        else "Every participant, mean ± SD and smoothed distribution; below, mean differences to "
        "the first condition with 95 % confidence interval (not corrected for the number of "
        "comparisons)."
    )
    return draw(
        ("scatter_" if scatter else "estimation_") + name,
        lambda: _scatter(samples) if scatter else _estimation(samples, outcome.question.dv),
        title=samples.title,
        caption=caption,
        alternative=f"{samples.title}: {' '.join(outcome.sentences)}",
        is_simulated=outcome.is_simulated,
    )


def _estimation(samples: Samples, dv: str) -> Figure:
    return estimation_plot(samples.conditions, dv=dv, paired=samples.paired, title=samples.title)


def _scatter(samples: Samples) -> Figure:
    (x_name, x), (y_name, y) = samples.conditions.items()
    figure = new_figure(5.2, 4.6)
    axes = figure.add_subplot()
    axes.scatter(x, y, s=26, color=BLUE, alpha=0.75, linewidths=0)
    axes.set_xlabel(x_name)
    axes.set_ylabel(y_name)
    axes.set_title(samples.title)
    return figure


def outcome_data(outcome: Outcome, files: Sequence[Path]) -> dict[str, Any]:
    """Return an outcome for other programs; numbers that do not exist are null."""
    return {
        "test": outcome.question.test,
        "title": outcome.title,
        "is_simulated": outcome.is_simulated,
        "sentences": list(outcome.sentences),
        "path": list(outcome.path),
        "rows": [_plain(r) for r in outcome.rows],
        "contrasts": [_plain(r) for r in outcome.contrasts],
        "cells": [_plain(r) for r in outcome.cells],
        "error_rates": [_plain(r) for r in outcome.error_rates],
        "notes": list(outcome.notes),
        "files": [str(f) for f in files],
    }


def _plain(row: Row | Mapping[str, object]) -> dict[str, object]:
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
