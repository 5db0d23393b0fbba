"""Further sections of the waving study's report, after the standard ones."""

from typing import Final

import numpy as np
import pandas as pd

from visavis.analysis.report import Block, Column, Paragraph, Section, Table
from visavis.analysis.report.notation import count_of, decimal, fraction, percentage
from visavis.experiments.waving.clips import DIRECTIONS, PLACES, TECHNIQUES
from visavis.results.analysis import StudyAnalysis
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra
from visavis.study.texts import label_of

ENOUGH_ON_TARGET_01: Final = 0.8
"""Share of frames on target below which the report says that warping missed its target."""
RELATIVE_PLACES: Final = ("left", "self", "right", "farther")


def relative_confusion(trials: pd.DataFrame) -> pd.DataFrame:
    """Return counts of answers by technique, direction and place relative to one's own.

    Columns of places are `RELATIVE_PLACES`.
    """
    steps = trials["who"].map(PLACES.index) - trials["participant_place"].map(PLACES.index)
    relative_place = steps.map({0: "self", -1: "left", 1: "right"}).fillna("farther")
    keys = [trials["technique"], trials["direction"], relative_place.rename("relative_place")]
    sizes = trials.groupby(keys).size()
    index = pd.MultiIndex.from_product([TECHNIQUES, DIRECTIONS], names=["technique", "direction"])
    table: pd.DataFrame = (
        sizes.unstack("relative_place", fill_value=0)
        .reindex(index=index, columns=list(RELATIVE_PLACES), fill_value=0)
        .reset_index()
    )
    return table


def relative_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return answers relative to one's own place: were waves at neighbours taken for one's own?"""
    texts = experiment.texts
    rows = []
    for row in relative_confusion(analysis.selection.counted).to_dict("records"):
        total = max(sum(int(row[c]) for c in RELATIVE_PLACES), 1)
        wave = f"{label_of(texts, str(row['technique']))}, {label_of(texts, str(row['direction']))}"
        rows.append((wave, *(fraction(int(row[c]) / total) for c in RELATIVE_PLACES)))
    heads = (Column("Wave"), *(Column(h.capitalize(), "right") for h in RELATIVE_PLACES))
    note = "Shares of the answers to waves of a kind."
    table = Table(heads, tuple(rows), "Answers relative to one's own place, as shares", note)
    return Extra(Section("relative", "Answers relative to one's own place", (table,)))


def warping_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return what warping asked for and what it reached, by direction."""
    blocks = _warping_blocks(analysis.selection.counted, experiment)
    return Extra(Section("warping", "What warping reached", tuple(blocks)))


def _warping_blocks(trials: pd.DataFrame, experiment: StudyExperiment) -> list[Block]:
    if "target_met_01" not in trials or not trials["target_met_01"].notna().any():
        return [Paragraph("No wave was warped, or the recording does not tell what was reached.")]
    warped_trials = trials[trials["target_met_01"].notna()]
    if "target_reachable_01" not in warped_trials:  # recorded before it was written down
        warped_trials = warped_trials.assign(target_reachable_01=np.nan)
    rows = []
    for direction in (*DIRECTIONS, None):
        part = (
            warped_trials
            if direction is None
            else warped_trials[warped_trials["direction"] == direction]
        )
        wave = "All" if direction is None else label_of(experiment.texts, direction)
        cells = [_change(part[c]) for c in ("coverage_wanted", "coverage_reached")]
        shares = [_share(part[c]) for c in ("target_reachable_01", "target_met_01")]
        rows.append((wave, str(len(part)), *cells, *shares))
    headings = (
        "Warped trials",
        "Coverage wanted",
        "Reached",
        "Frames within reach",
        "Frames on target",
    )
    heads = (Column("Wave"), *(Column(h, "right") for h in headings))
    met_01 = float(warped_trials["target_met_01"].mean())
    note = (
        "Coverage: medians of trials, beside the wave that was not warped. A frame is on target "
        "when head and hand both are within a tenth of the change wanted, within reach when a "
        "search over the pose alone, of the wave as planned, came to it."
    )
    table = Table(heads, tuple(rows), "Coverage of head and hand", note)
    blocks: list[Block] = [table]
    if met_01 < ENOUGH_ON_TARGET_01:
        blocks.insert(
            0,
            Paragraph(
                f"Warping met its target in {percentage(met_01, 0)} of frames; "
                f"{_share(warped_trials['target_reachable_01'])} were within reach. What this "
                "study compares is the wave as it was reached, not the coverage that was asked for."
            ),
        )
    if "warp_loop_hz" in warped_trials and warped_trials["warp_loop_hz"].notna().any():
        rate_hz = float(pd.to_numeric(warped_trials["warp_loop_hz"]).median())
        late = int(pd.to_numeric(warped_trials["warp_late"]).sum())
        blocks.append(
            Paragraph(
                f"Waves at the participant were corrected for the tracked head "
                f"{decimal(rate_hz, 0)} times a second (median of trials); "
                f"{count_of(late, 'correction')} came too late to be shown."
            )
        )
    return blocks


def _share(shares: pd.Series) -> str:
    """Return the mean of shares in percent."""
    numbers = pd.to_numeric(shares).dropna()
    return "–" if numbers.empty else percentage(float(numbers.mean()), 0)


def _change(shares: pd.Series) -> str:
    """Return the median change of coverage in percent, with its sign."""
    numbers = shares.dropna()
    if numbers.empty:
        return "–"
    change = float(numbers.median()) - 1
    return f"{'−' if change < 0 else '+'}{percentage(abs(change), 0)}"
