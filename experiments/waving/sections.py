"""What the report of the waving study has beside the standard sections."""

from typing import Final

import numpy as np
import pandas as pd

from visavis.analysis.report import Block, Column, Paragraph, Section, Table
from visavis.analysis.report.notation import counted, decimal, fraction, percentage
from visavis.experiments.waving.clips import DIRECTIONS, PLACES, TECHNIQUES
from visavis.results.analysis import StudyAnalysis
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra
from visavis.study.texts import label_of

ENOUGH_ON_TARGET_01: Final = 0.8
"""Share of frames on target below which the report says that warping missed its target."""
TOLD: Final = ("left", "self", "right", "farther")


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


def relative_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return answers relative to one's own place: were waves at neighbours taken for one's own?"""
    texts = experiment.texts
    rows = []
    for row in relative_confusion(analysis.selection.counted).to_dict("records"):
        total = max(sum(int(row[c]) for c in TOLD), 1)
        wave = f"{label_of(texts, str(row['technique']))}, {label_of(texts, str(row['direction']))}"
        rows.append((wave, *(fraction(int(row[c]) / total) for c in TOLD)))
    heads = (Column("Wave"), *(Column(h.capitalize(), "right") for h in TOLD))
    said = "Shares of the answers to waves of a kind."
    table = Table(heads, tuple(rows), "Answers relative to one's own place, as shares", said)
    return Extra(Section("relative", "Answers relative to one's own place", (table,)))


def warping_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return what warping asked for and what it reached, by direction."""
    blocks = _reached(analysis.selection.counted, experiment)
    return Extra(Section("warping", "What warping reached", tuple(blocks)))


def _reached(trials: pd.DataFrame, experiment: StudyExperiment) -> list[Block]:
    if "target_met_01" not in trials or not trials["target_met_01"].notna().any():
        return [Paragraph("No wave was warped, or the recording does not tell what was reached.")]
    known = trials[trials["target_met_01"].notna()]
    if "target_reachable_01" not in known:  # recorded before it was written down
        known = known.assign(target_reachable_01=np.nan)
    rows = []
    for direction in (*DIRECTIONS, None):
        part = known if direction is None else known[known["direction"] == direction]
        wave = "All" if direction is None else label_of(experiment.texts, direction)
        cells = [_change(part[c]) for c in ("coverage_wanted", "coverage_reached")]
        shares = [_share(part[c]) for c in ("target_reachable_01", "target_met_01")]
        rows.append((wave, str(len(part)), *cells, *shares))
    shown = (
        "Warped trials",
        "Coverage wanted",
        "Reached",
        "Frames within reach",
        "Frames on target",
    )
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
        blocks.insert(
            0,
            Paragraph(
                f"Warping met its target in {percentage(met_01, 0)} of frames; "
                f"{_share(known['target_reachable_01'])} were within reach. What this study "
                "compares is the wave as it was reached, not the coverage that was asked for."
            ),
        )
    if "warp_loop_hz" in known and known["warp_loop_hz"].notna().any():
        rate_hz = float(pd.to_numeric(known["warp_loop_hz"]).median())
        late = int(pd.to_numeric(known["warp_late"]).sum())
        blocks.append(
            Paragraph(
                f"Waves at the participant were corrected for the tracked head "
                f"{decimal(rate_hz, 0)} times a second (median of trials); "
                f"{counted(late, 'correction')} came too late to be shown."
            )
        )
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
