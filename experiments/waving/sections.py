"""What the report of the waving study has beside the standard sections."""

from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.figure import Figure

from analysis.plots import BLACK, draw, new_figure
from analysis.report import Block, Column, Paragraph, Section, Table
from analysis.report.notation import counted, decimal, fraction, percentage
from experiments.waving.clips import TECHNIQUES
from experiments.waving.study import DIRECTIONS, PLACES
from protocol.columns import Column as Described
from visavis.analysis import StudyAnalysis
from visavis.experiment import StudyExperiment
from visavis.report import picture_of
from visavis.sections import Extra
from visavis.texts import label_of

ENOUGH_ON_TARGET_01: Final = 0.8
"""Share of frames on target below which the report says that warping missed its target."""
TOLD: Final = ("left", "self", "right", "farther")


def confusion(trials: pd.DataFrame, technique: str | None = None) -> npt.NDArray[np.int64]:
    """Return how often a place (row) was answered as a place (column), (5, 5)."""
    chosen = trials if technique is None else trials[trials["technique"] == technique]
    counts = np.zeros((len(PLACES), len(PLACES)), dtype=np.int64)
    for target, who in zip(chosen["target_place"], chosen["who"], strict=True):
        counts[PLACES.index(str(target)), PLACES.index(str(who))] += 1
    return counts


def relative_confusion(trials: pd.DataFrame) -> pd.DataFrame:
    """Return counts of answers relative to one's own place (`TOLD`), by technique and direction."""
    steps = trials["who"].map(PLACES.index) - trials["participant_place"].map(PLACES.index)
    told = steps.map({0: "self", -1: "left", 1: "right"}).fillna("farther")
    sizes = trials.assign(told=told).groupby(["technique", "direction", "told"]).size()
    index = pd.MultiIndex.from_product([TECHNIQUES, DIRECTIONS], names=["technique", "direction"])
    table: pd.DataFrame = (
        sizes.unstack("told", fill_value=0)
        .reindex(index=index, columns=list(TOLD), fill_value=0)
        .reset_index()
    )
    return table


def places_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return answers by place: a confusion matrix, and what was taken for one's neighbour's."""
    trials, texts = analysis.selection.counted, experiment.texts
    drawn = draw(
        "confusion",
        lambda: _matrices(trials, [label_of(texts, t) for t in TECHNIQUES]),
        title="Who was waved at, and who was taken to be",
        caption="Places from the participants' left (1) to right (5). Shades and numbers: "
        "share of the answers in a row; counts below.",
        alternative="Confusion matrices of five places for both techniques.",
        is_simulated=analysis.is_simulated,
    )
    rows = []
    for row in relative_confusion(trials).to_dict("records"):
        total = max(sum(int(row[c]) for c in TOLD), 1)
        wave = f"{label_of(texts, str(row['technique']))}, {label_of(texts, str(row['direction']))}"
        rows.append((wave, *(fraction(int(row[c]) / total) for c in TOLD)))
    every = confusion(trials)
    right = float(np.trace(every)) / max(int(every.sum()), 1)
    heads = (Column("Wave"), *(Column(h.capitalize(), "right") for h in TOLD))
    said = (
        f"{fraction(right)} of all {int(every.sum())} answers named the right place among "
        f"{len(PLACES)}."
    )
    table = Table(heads, tuple(rows), "Answers relative to one's own place, as shares", said)
    section = Section("places", "Answers by place", (picture_of(drawn), table))
    places = tuple(Described(p, "1", f"answers that named {p}") for p in PLACES)
    return Extra(section, (drawn,), {"confusion": confusion_table(trials)}, places)


def confusion_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the confusion matrices as one table, a row per technique and place waved at."""
    rows: list[dict[str, str | int]] = [
        {"technique": technique, "target_place": place}
        | {p: int(n) for p, n in zip(PLACES, counts, strict=True)}
        for technique in TECHNIQUES
        for place, counts in zip(PLACES, confusion(trials, technique), strict=True)
    ]
    return pd.DataFrame(rows)


def _matrices(trials: pd.DataFrame, names: list[str]) -> Figure:
    figure = new_figure(8.4, 4.2)
    every = figure.subplots(1, 2, sharey=True)
    for axes, technique, name in zip(every, TECHNIQUES, names, strict=True):
        counts = confusion(trials, technique)
        shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        axes.imshow(shares, vmin=0, vmax=1, cmap="Blues")
        for i, j in np.argwhere(counts):
            axes.text(
                j, i, f"{fraction(shares[i, j])}\n{counts[i, j]}", ha="center", va="center",
                fontsize=7.5, color="white" if shares[i, j] > 0.55 else BLACK,
            )  # fmt: skip
        axes.set_xticks(range(5), [str(k) for k in range(1, 6)])
        axes.set_yticks(range(5), [str(k) for k in range(1, 6)])
        axes.set_xlabel("Answered place")
        axes.set_title(name.capitalize())
        axes.grid(visible=False)
    every[0].set_ylabel("Place waved at")
    return figure


def warping_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return what warping asked for and what it reached, by direction."""
    blocks = _reached(analysis.selection.counted, experiment)
    return Extra(Section("warping", "What warping reached", tuple(blocks)))


def _reached(trials: pd.DataFrame, experiment: StudyExperiment) -> list[Block]:
    if "target_met_01" not in trials or not trials["target_met_01"].notna().any():
        return [Paragraph("No wave was warped, or the recording does not tell what was reached.")]
    known = trials[trials["target_met_01"].notna()]
    rows = []
    for direction in (*DIRECTIONS, None):
        part = known if direction is None else known[known["direction"] == direction]
        wave = "All" if direction is None else label_of(experiment.texts, direction)
        cells = [_change(part[c]) for c in ("coverage_wanted", "coverage_reached")]
        shares = [_share(part[c]) for c in ("target_reachable_01", "target_met_01")]
        rows.append((wave, str(len(part)), *cells, *shares))
    shown = (
        "Warped trials", "Coverage wanted", "Reached", "Frames within reach", "Frames on target",
    )  # fmt: skip
    heads = (Column("Wave"), *(Column(h, "right") for h in shown))
    met_01 = float(known["target_met_01"].mean())
    said = (
        "Coverage: medians of trials, beside the wave that was not warped. A frame is on target "
        "when head and hand both are within a tenth of the change wanted, within reach when a "
        "search over the pose alone, of the wave as planned, came to it."
    )
    table = Table(heads, tuple(rows), "Coverage of head and hand", said)
    blocks: list[Block] = [table]
    if met_01 < ENOUGH_ON_TARGET_01:
        blocks.insert(0, Paragraph(
            f"Warping met its target in {percentage(met_01, 0)} of frames; "
            f"{_share(known['target_reachable_01'])} were within reach. What this study compares "
            "is the wave as it was reached, not the coverage that was asked for."
        ))  # fmt: skip
    if "warp_loop_hz" in known and known["warp_loop_hz"].notna().any():
        rate_hz = float(pd.to_numeric(known["warp_loop_hz"]).median())
        late = int(pd.to_numeric(known["warp_late"]).sum())
        blocks.append(Paragraph(
            f"Waves at the participant were corrected for the tracked head {decimal(rate_hz, 0)} "
            f"times a second (median of trials); {counted(late, 'correction')} came too late to be "
            "shown."
        ))  # fmt: skip
    return blocks


def _share(shares: pd.Series) -> str:
    """Return the mean of shares in percent."""
    known = pd.to_numeric(shares).dropna()
    return "–" if known.empty else percentage(float(known.mean()), 0)


def _change(shares: pd.Series) -> str:
    """Return the median change of coverage in percent, with its sign."""
    known = shares.dropna()
    if known.empty:
        return "–"
    change = float(known.median()) - 1
    return f"{'−' if change < 0 else '+'}{percentage(abs(change), 0)}"
