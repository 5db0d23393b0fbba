"""Say what every column of the trial table is, for the analyst who has only the table."""

import json
from pathlib import Path

from protocol.columns import Column
from visavis.looks import LOOK_COLUMNS

SESSION_COLUMNS: tuple[Column, ...] = (
    Column("is_simulated", "", "nobody took part: simulated participant or devices"),
    Column("recording_part", "", "part of the recording; session time begins anew in each"),
    Column("participant", "", "label from the ledger"),
    Column("participant_index", "", "place in the order, from 0; decides orders and seeds"),
    Column("session", "", "session number"),
    Column("group", "", "between-subject group; empty here"),
    Column("part", "", "the same as recording_part"),
    Column("trial_id", "", "unique within the session: P practice, T trial"),
    Column("number", "", "planned number, from 1 within its kind"),
    Column("block", "", "block index; 0 is training"),
    Column("is_practice", "", "training, not analysed"),
    Column("attempt", "", "how often the trial was begun, this time included"),
    Column("status", "", "complete, interrupted, skipped, damaged (samples unreadable) or lost"),
    Column("reason", "", "why it was interrupted or skipped, or what is unreadable"),
    Column("flags", "", "what the operator or a device flagged, separated by semicolons"),
    Column("condition", "", "A averted, D directed, AD averted then directed, DA the reverse"),
    Column("place", "", "where the active agent sat"),
    Column("zone", "", "left, centre or right"),
    Column("depth", "", "close, middle or far"),
    Column("active_index", "", "index of the active agent in the recorded columns"),
    Column("active_agent", "", "its identifier in the event 'scene'"),
    Column("active_character", "", "the character model that played it"),
    Column("t_start_ns", "ns", "session time of the first frame that showed the scene"),
    Column("t_end_ns", "ns", "start plus the trial's duration"),
    Column("switch_ns", "ns", "session time of the frame that showed the gaze change (AD, DA)"),
    Column("switch_ms", "ms", "the same from the trial's start"),
    Column("switch_cause", "", "look: the participant looked at the agent; time: half the trial"),
    Column("look_ns", "ns", "session time of the gaze sample that caused the change"),
    Column("scene_frames", "1", "display frames that showed the scene"),
    Column("scene_samples", "1", "gaze samples evaluated online meanwhile"),
    Column("frames", "1", "display frames of the whole trial step"),
    Column("frames_dropped", "1", "frames the display skipped"),
    Column("gaze_expected", "1", "samples expected at the nominal rate"),
    Column("gaze_received", "1", "samples that arrived"),
    Column("gaze_valid", "1", "of these, usable"),
    Column("left_eye_seen_01", "1", "share of received samples in which the left eye was seen"),
    Column("right_eye_seen_01", "1", "the same of the right eye"),
    Column("calibration_id", "", "validation in force, numbered through the session"),
    Column("calibration_accepted", "", "it met the thresholds"),
    Column("calibration_accuracy_deg", "deg", "its mean error over nine points"),
    Column("calibration_worst_point_deg", "deg", "its largest error at a point"),
    Column("calibration_precision_deg", "deg", "its RMS sample to sample"),
    Column("calibration_lost_01", "1", "share of samples lost during it"),
    Column("calibration_age_s", "s", "time since then"),
    Column("clock_offset_ns", "ns", "session time minus tracker time, constant in the trial"),
)
"""Columns of a trial's row before it is measured."""

ANALYSIS_COLUMNS: tuple[Column, ...] = (
    Column("is_analysed", "", "went into the statistics (finished, not training, not excluded)"),
)

TRIAL_TABLE: tuple[Column, ...] = (*SESSION_COLUMNS, *LOOK_COLUMNS, *ANALYSIS_COLUMNS)
"""Every column the trial table can have, in its order."""


def write_dictionary(path: Path) -> Path:
    """Write the description of every column as JSON, in the manner of a BIDS sidecar."""
    content = {
        c.name: {"Description": c.description} | ({"Units": c.unit} if c.unit else {})
        for c in TRIAL_TABLE
    }
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return path
