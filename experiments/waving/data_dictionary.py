"""Say what every column of the study's tables is, for the analyst who has only the tables."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from experiments.waving.measures import Column
from lab.errors import DataError

TRIALS: Final = (
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
    Column("technique", "", "orientation or warping"),
    Column("direction", "", "who was waved at: self, left or right of the participant"),
    Column("clerk", "", "who waved"),
    Column("participant_place", "", "where the participant stood, place_2 to place_4"),
    Column("target_place", "", "the place waved at, place_1 to place_5 from left to right"),
    Column("t_start_ns", "ns", "session time of the first frame that showed the scene"),
    Column("scene_frames", "1", "display frames that showed the scene before the questions"),
    Column("eye_height_m", "m", "median height of the tracked head above the floor in the scene"),
    Column("planned_eye_height_m", "m", "the height that the waves were warped for"),
    Column("who", "", "the place answered; empty when left out"),
    Column("who_by", "", "how it was answered: ray, keys, keyboard or operator"),
    Column("who_ms", "ms", "from the frame that showed the question to the answer"),
    Column("realism", "1", "1 low to 9 high"),
    Column("realism_by", "", "how it was answered"),
    Column("realism_ms", "ms", "from the frame that showed the question to the answer"),
    Column("is_right", "", "the answer is the place waved at"),
    Column("wave_sha256", "", "hash of the wave's poses; its parameters are in the event 'wave'"),
    Column("t_end_ns", "ns", "session time of the last answer"),
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
PARTICIPANTS: Final = (
    Column("participant", "", "label from the ledger"),
    Column("eye_height_m", "m", "median over finished trials; empty where none was tracked"),
    Column("eye_height_off_m", "m", "this minus the height that the waves were warped for"),
    Column("eye_height_is_off", "", "farther from it than the study's tolerance"),
    Column("age", "years", "as answered"),
    Column("gender", "", "as answered: 1 woman, 2 man, 3 another, 4 not said"),
    Column("vr_experience", "", "1 none to 5 almost daily"),
    Column("games_experience", "", "1 none to 5 almost daily"),
    Column("vision", "", "how vision was corrected"),
    Column("strategy", "", "what was looked at, in the participant's words"),
    Column("comment", "", "in the participant's words"),
    Column("is_simulated", "", "nobody took part"),
)
CELL_MEANS: Final = (
    Column("participant", "", "label from the ledger"),
    Column("technique", "", "orientation or warping"),
    Column("direction", "", "self, left or right"),
    Column("accuracy", "1", "share of right answers"),
    Column("realism", "1", "mean rating"),
    Column("response_ms", "ms", "median time to the answer"),
    Column("n", "1", "trials that count"),
    Column("is_simulated", "", "nobody took part"),
)
CONFUSION: Final = (
    Column("technique", "", "orientation or warping"),
    Column("target_place", "", "the place waved at"),
    *(Column(f"place_{k}", "1", f"answers that named place_{k}") for k in range(1, 6)),
    Column("is_simulated", "", "nobody took part"),
)
STATISTICS: Final = (
    Column("measure", "", "accuracy, realism or response_ms"),
    Column("kind", "", "effect (of the ART ANOVA) or contrast (Tukey, on aligned ranks)"),
    Column("term", "", "the effect, or the factors whose levels are compared"),
    Column("F", "1", "on aligned ranks"),
    Column("df1", "1", "numerator degrees of freedom"),
    Column("df2", "1", "denominator degrees of freedom"),
    Column("p", "1", "uncorrected; of a contrast before Tukey's adjustment"),
    Column("contrast", "", "first level minus second"),
    Column("estimate", "1", "difference of mean aligned ranks"),
    Column("p_adjusted", "1", "of a contrast, after Tukey"),
    Column("published_F", "1", "as printed in the source"),
    Column("published_significant", "", "the source's verdict"),
    Column("agrees_with_published", "", "the same verdict here"),
)
TABLES: Final = {
    "trials": TRIALS,
    "participants": PARTICIPANTS,
    "cell_means": CELL_MEANS,
    "confusion": CONFUSION,
    "statistics": STATISTICS,
}


def write_dictionary(table: str, columns: Iterable[str], path: Path) -> Path:
    """Write what the columns of a table are as JSON, in the manner of a BIDS sidecar.

    Columns of the statistics that other statistics modules name are described by those.

    Raises:
        DataError: a column of another table is not described.
    """
    known = {c.name: c for c in TABLES[table]}
    content: dict[str, dict[str, str]] = {}
    for name in columns:
        column = known.get(name)
        if column is None:
            if table != "statistics":
                raise DataError(f"column {name!r} of {table} is not described; add it here")
            content[name] = {"Description": "see docs/statistics.md"}
            continue
        content[name] = {"Description": column.description}
        if column.unit:
            content[name]["Units"] = column.unit
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return path
