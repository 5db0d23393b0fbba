"""Say what every column of the study's tables is, as JSON beside each table."""

import json
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final

from experiments.crowd.design import AFTER_BLOCK, AT_END
from protocol.questionnaires import load_questionnaire

Entry = tuple[str, str]
"""Unit and description."""

SHARED: Final[Mapping[str, Entry]] = {
    "is_simulated": ("", "nobody took part: simulated participant or devices"),
    "participant": ("", "label from the ledger"),
    "trial_id": ("", "unique within the session: P practice, T trial"),
    "condition": ("", "block: NoHaptic1, Haptic or NoHaptic2, in this order"),
    "configuration": ("", "crowd, 1 to 8"),
    "measure_rule": ("", "rule of volumes: volume, centres or published"),
    "measure_surface": ("", "bodies measured: characters, fine, light or capsules"),
    "rule": ("", "rule of volumes: volume, centres or published"),
    "surface": ("", "bodies measured: characters, fine, light or capsules"),
    "group": ("", "between-subject group: haptics or control; empty without control group"),
    "recording_part": ("", "part of the recording; session time begins anew in each"),
}

TRIALS: Final[Mapping[str, Entry]] = {
    "participant_index": ("", "place in the order, from 0; decides orders and seeds"),
    "session": ("", "session number"),
    "part": ("", "the same as recording_part"),
    "number": ("", "planned number, from 1"),
    "block": ("", "block index; 0 is training"),
    "block_walks": ("1", "walks planned in the block"),
    "crowd_density_per_m2": ("1/m²", "people per square metre of the crowd, as planned"),
    "is_analysed": ("", "the walk counts in means and tests"),
    "left_out_because": ("", "why it does not count; empty where it does"),
    "is_practice": ("", "training, not analysed"),
    "attempt": ("", "how often the walk was begun, this time included"),
    "status": ("", "complete; others are not measured"),
    "reason": ("", "why it was interrupted or skipped"),
    "flags": ("", "what a device, the walk or the measuring flagged, separated by semicolons"),
    "walk_flags": ("", "what the body's tracking and the walk flagged while it ran"),
    "vibrates": ("", "contacts were answered by the armbands"),
    "t_start_ns": ("ns", "session time of the first frame that showed the crowd"),
    "t_end_ns": ("ns", "session time of the frame that ended the walk"),
    "board_ns": ("ns", "when the board first showed the track; empty: never"),
    "came_back": ("", "reached the mark again within the limit"),
    "track": ("", "track number on the board"),
    "track_read": ("", "what the participant read aloud, as the operator entered it"),
    "track_right": ("", "they are the same"),
    "contacts_online": ("1", "contacts of an arm segment that began while it ran"),
    "scene_frames": ("1", "display frames that showed the crowd"),
    "frames": ("1", "display frames of the whole trial step"),
    "frames_dropped": ("1", "frames the display skipped"),
    "body_samples": ("1", "body samples looked at online"),
    "body_silent_ms": ("ms", "time in gaps between body samples of more than 150 ms"),
    "body_frozen_ms": ("ms", "time in which the tracker repeated one pose"),
    "frozen_segments": ("ms", "segment=time of those that repeated their last pose, as found live"),
    "frozen_segments_measured": ("ms", "segment=time, by the recording; missing in the measures"),
    "body_part_lost_samples": ("1", "samples in which some segment was not tracked"),
    "outside_room_samples": ("1", "samples outside the room"),
    "lost_01": ("1", "share of 10 ms steps without a whole tracked body"),
    "collisions": ("1", "counted collisions: above 1e-6 m³ for more than 10 ms"),
    "tracked_s": ("s", "time in which collisions could be measured: the whole body was tracked"),
    "collisions_per_tracked_min": ("1/min", "counted collisions per minute of that time"),
    "collisions_uncounted": ("1", "contacts too short to count"),
    "collisions_cut": ("1", "counted ones cut by lost tracking or the walk's end"),
    "max_volume_dm3": ("dm³", "mean over counted collisions of their largest common volume"),
    "largest_volume_dm3": ("dm³", "the largest of them"),
    "collision_s": ("s", "mean duration of counted collisions"),
    "collision_speed_m_s": ("m/s", "mean speed of the hips at their first contact"),
    "arm_collisions": ("1", "counted collisions of an upper arm, forearm or hand"),
    "crossings": ("1", "crossings between two people, in and out of the crowd included"),
    "shoulders_to_gap_deg": ("deg", "mean angle of the shoulders to the gap at crossings, 0–90"),
    "shoulders_to_gap_narrow_deg": ("deg", "the same at gaps of at most 1.5 m (narrow_gap_m)"),
    "crossings_narrow": ("1", "crossings of such gaps"),
    "shoulders_to_way_deg": ("deg", "mean angle of the shoulders to square across the way, 0–90"),
    "speed_m_s": ("m/s", "mean speed farther than a step from the point nearest the board"),
    "speed_whole_m_s": ("m/s", "mean speed over all tracked time"),
    "path_m": ("m", "length of the way over the floor; empty: more than 1 % was not tracked"),
    "time_s": ("s", "from first to last step"),
    "stop_s": ("s", "time left out round the stop at the board"),
    "hesitations": ("1", "stretches below 0.1 m/s for at least 0.5 s outside that stop"),
    "hesitation_s": ("s", "their sum"),
    "clearance_mean_m": ("m", "mean distance to the nearest person's centre"),
    "clearance_min_m": ("m", "least distance to a person's centre"),
    "cells": ("1", "different cells walked through"),
    "step_m": ("m", "the step left out round the stop"),
    "density_per_m2": ("1/m²", "mean density by the participant's Voronoi cell (PedPy)"),
    "individual_speed_m_s": ("m/s", "mean individual speed at the same moments (PedPy)"),
    "pulses": ("1", "vibrations commanded"),
    "pulses_lost": ("1", "of these, never acknowledged"),
    "caution": ("1", "a simulated participant's learned caution at the end"),
}  # fmt: skip

COLLISIONS: Final[Mapping[str, Entry]] = {
    "person": ("", "number of the person in the crowd, from 0"),
    "behaviour": ("", "0 waiting, 1 telephoning"),
    "start_s": ("s", "first step in contact, from the walk's start"),
    "end_s": ("s", "last step in contact"),
    "duration_s": ("s", "from first to last step in contact"),
    "max_volume_dm3": ("dm³", "largest common volume"),
    "peak_s": ("s", "when it was reached"),
    "body_part": ("", "participant's part nearest to the centre of the common volume then"),
    "side": ("", "left, right or middle of the participant"),
    "speed_m_s": ("m/s", "speed of the hips at first contact"),
    "counted": ("", "lasted longer than 10 ms"),
    "cut": ("", "the step before or after was not measured, so the duration is unknown"),
}

CROSSINGS: Final[Mapping[str, Entry]] = {
    "first": ("", "number of one of the two people"),
    "second": ("", "number of the other"),
    "x_m": ("m", "where the way crossed the line between them, to the right"),
    "z_m": ("m", "the same, towards the start"),
    "t_s": ("s", "when, from the walk's start"),
    "centres_apart_m": ("m", "distance of the two people"),
    "shoulders_to_gap_deg": ("deg", "shoulders to the line between them, 0–90 (published)"),
    "shoulders_to_way_deg": ("deg", "shoulders to square across the way walked, 0–90"),
}

PULSES: Final[Mapping[str, Entry]] = {
    "attempt": ("", "at the walk; trials hold the complete one"),
    "role": ("", "armband"),
    "segment": ("", "arm segment in contact"),
    "person": ("", "number of the person touched, from 0"),
    "motors": ("", "motors driven"),
    "t_contact_ns": ("ns", "session time of the body sample that showed the contact"),
    "commanded_ms": ("ms", "from that sample to the order"),
    "sent_ms": ("ms", "to the last byte on the wire"),
    "acknowledged_ms": ("ms", "to the band's answer; empty: none came"),
    "risen_ms": ("ms", "to the motor at 63 %, by the band's own time and a modelled rise"),
    "held_ms": ("ms", "how long the contact lasted"),
    "acknowledged": ("", "the band answered"),
}

CELLS: Final[Mapping[str, Entry]] = {
    "cells": ("", "cells in the order walked, each the numbers of three people; null outside"),
}
PEDESTRIAN: Final[Mapping[str, Entry]] = {
    "t_s": ("s", "time from the walk's start"),
    "density_per_m2": ("1/m²", "1 / area of the participant's Voronoi cell (PedPy)"),
    "individual_speed_m_s": ("m/s", "individual speed (PedPy)"),
}
STATISTICS: Final[Mapping[str, Entry]] = {
    "measure": ("", "column of the trial table, or a rating"),
    "comparison": ("", "blocks: the test over all three; otherwise first - second"),
    "n": ("1", "participants with all three blocks"),
    "test": ("", "rm_anova or friedman"),
    "p": ("1", "of the test; adjusted (Bonferroni over three) for pairs"),
    "significant": ("", "p below alpha; for pairs only after a significant test over blocks"),
    "difference": ("", "mean of the first block less that of the second"),
    "agrees_with_published": ("", "same verdict and direction as printed"),
    "sentence": ("", "the result in words"),
    "problem": ("", "why it was not tested"),
}
SIMILARITY: Final[Mapping[str, Entry]] = {
    "variant": ("", "of Dice: union, frequency or pairs"),
    "first": ("", "one block"),
    "second": ("", "the other"),
    "between_blocks": ("1", "whole blocks, as published; mean over configurations"),
    "between_blocks_sd": ("1", "its standard deviation over configurations"),
    "within_block_halves": ("1", "random halves of one block, as published"),
    "within_block_halves_sd": ("1", "standard deviation over blocks and splits"),
    "matched_between": ("1", "between blocks at equal sizes, different people"),
    "matched_within": ("1", "within blocks at the same sizes"),
    "matched_difference": ("1", "within less between"),
    "permutation_p": ("1", "one-sided, by exchanging people's blocks"),
    "n_people": ("1", "people"),
    "n_splits": ("1", "random splits"),
    "n_permutations": ("1", "permutations"),
}
EXCLUDED: Final[Mapping[str, Entry]] = {
    "trial_id": ("", "the walk left out; empty: the whole participant"),
    "reason": ("", "why"),
}

TABLES: Final[Mapping[str, Mapping[str, Entry]]] = {
    "trials": TRIALS,
    "collisions": COLLISIONS,
    "crossings": CROSSINGS,
    "pulses": PULSES,
    "cells": CELLS,
    "pedestrian": PEDESTRIAN,
    "statistics": STATISTICS,
    "similarity": SIMILARITY,
    "excluded": EXCLUDED,
    "condition_means": TRIALS,
    "blocks": {"block": ("", "block index; 0 is training")},
    "people": {},
}
_PREFIXES: Final[Mapping[str, str]] = {
    "mean_": "mean over participants of block ",
    "sd_": "standard deviation over participants of block ",
    "between_": "Dice of whole blocks in configuration ",
    "calibration_": "validation of the eye tracker in force: ",
    "gaze_": "gaze samples: ",
}


def describe(table: str, column: str) -> dict[str, Any]:
    """Return the dictionary entry of a column: description, and units where it has one."""
    entry = TABLES[table].get(column) or SHARED.get(column) or _answers().get(column)
    if entry is None:
        for prefix, text in _PREFIXES.items():
            if column.startswith(prefix):
                entry = ("", text + column.removeprefix(prefix).replace("_", " "))
                break
    if entry is None:
        entry = ("", "as the session recorded it")
    unit, description = entry
    return {"Description": description} | ({"Units": unit} if unit else {})


@cache
def _answers() -> dict[str, Entry]:
    found: dict[str, Entry] = {}
    for name in (*AFTER_BLOCK, *AT_END):
        questionnaire = load_questionnaire(name)
        for question in questionnaire.questions():
            found[question.question_id] = ("", f"{questionnaire.title}: {question.item.text}")
        if name in AFTER_BLOCK:
            for score in questionnaire.scores:
                found[score] = ("1", f"{questionnaire.title}: mean of its items, 1 to 7")
    return found


def write_dictionary(table: str, columns: Iterable[str], path: Path) -> Path:
    """Write the description of a table's columns as JSON, in the manner of a BIDS sidecar."""
    content = {column: describe(table, column) for column in columns}
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return path
