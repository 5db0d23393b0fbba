"""Columns of tables, first those that the session writes into every trial row."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final


@dataclass(frozen=True)
class Column:
    """A column of a table: its unit ("1" for counts and shares, "" for none) and what it holds.

    `levels` say what codes mean.
    """

    name: str
    unit: str
    description: str
    levels: Mapping[str, str] = field(default_factory=dict, hash=False)


def read_columns(path: Path) -> dict[str, tuple[Column, ...]]:
    """Return the columns that a CSV file describes, by table: table, name, unit, description."""
    columns: dict[str, tuple[Column, ...]] = {}
    with path.open(encoding="utf-8", newline="") as lines:
        for row in csv.DictReader(lines):
            table = row.pop("table")
            columns[table] = (*columns.get(table, ()), Column(**row))
    return columns


IDENTITY: Final = (
    Column("is_simulated", "", "nobody took part: simulated participant or devices"),
    Column("recording_part", "", "part of the recording; session time begins anew in each"),
    Column("participant", "", "label from the ledger"),
    Column("participant_index", "", "place in the order, from 0; decides orders and seeds"),
    Column("session", "", "session number"),
    Column("group", "", "group of the participant; empty where there is one group only"),
    Column("part", "", "the same as recording_part"),
    Column("trial_id", "", "unique within the session: P practice, T trial"),
    Column("number", "", "planned number, from 1 within its kind"),
    Column("block", "", "block index; practice, where there is any, is block 0"),
    Column("is_practice", "", "practice, never analysed"),
    Column("attempt", "", "how often the trial was begun, this time included"),
    Column("status", "", "complete, interrupted or skipped"),
    Column("reason", "", "why it was interrupted or skipped"),
    Column("flags", "", "what the operator or a device flagged, separated by semicolons"),
)
"""Columns that say whose trial a row is and how it ended."""
DELIVERED: Final = (
    Column(
        "t_start_ns",
        "ns",
        "session time from which the trial is measured: its first scene on display, or the event "
        "trial_start where it shows none; darkness before a scene is not in it",
    ),
    Column(
        "t_end_ns",
        "ns",
        "session time up to which it is measured: the end of its last scene, or its last answer",
    ),
    Column(
        "frames",
        "1",
        "display frames from the event trial_start to the end of its last step, those before "
        "t_start_ns included",
    ),
    Column("frames_dropped", "1", "frames the display skipped"),
    Column(
        "gaze_expected", "1", "gaze samples expected at the nominal rate in all of these frames"
    ),
    Column("gaze_received", "1", "gaze samples that arrived"),
    Column("gaze_valid", "1", "of these, usable"),
    Column("left_eye_seen_01", "1", "share of received samples in which the left eye was seen"),
    Column("right_eye_seen_01", "1", "the same of the right eye"),
    Column("calibration_id", "", "validation in force, numbered through the session"),
    Column("calibration_accepted", "", "it met the thresholds"),
    Column("calibration_accuracy_deg", "deg", "its mean error over the targets"),
    Column("calibration_worst_point_deg", "deg", "its largest error at a target"),
    Column("calibration_precision_deg", "deg", "its RMS from sample to sample"),
    Column("calibration_lost_01", "1", "share of samples lost during it"),
    Column("calibration_age_s", "s", "time since then"),
    Column("clock_offset_ns", "ns", "session time minus tracker time, constant in the trial"),
)
"""The last columns of every trial row: what was delivered while the trial ran."""
ENGINE_COLUMNS: Final = (*IDENTITY, *DELIVERED)
"""Every column that the session writes in any study."""
