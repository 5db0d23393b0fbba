"""Descriptions of the crowd study's own columns; the kit describes those of every session."""

from collections.abc import Mapping, Sequence
from typing import Final

from visavis.experiments.crowd.design import CROWDS
from visavis.protocol.plan.columns import Column

TRIALS: Final = (
    Column("measure_rule", "", "rule of volumes: volume, centres or published"),
    Column("measure_surface", "", "bodies measured: characters, fine, light or capsules"),
    Column("block_walks", "1", "walks planned in the block"),
    Column("crowd_density_per_m2", "1/m²", "people per square metre of the crowd, as planned"),
    Column("walk_flags", "", "what the body's tracking and the walk flagged while it ran"),
    Column("board_ns", "ns", "when the board first showed the track; empty: never"),
    Column("came_back", "", "reached the mark again within the limit"),
    Column("track", "", "track number on the board"),
    Column("track_read", "", "what the participant read aloud, as the operator entered it"),
    Column("track_right", "", "they are the same"),
    Column("contacts_online", "1", "contacts of an arm segment that began while it ran"),
    Column("scene_frames", "1", "display frames that showed the crowd"),
    Column("body_samples", "1", "body samples looked at online"),
    Column("body_silent_ms", "ms", "time in gaps between body samples of more than 150 ms"),
    Column("body_frozen_ms", "ms", "time in which the tracker repeated one pose"),
    Column("frozen_segments", "", "segment=time (ms) of those that repeated one pose, found live"),
    Column("frozen_segments_measured", "", "segment=time (ms), by the recording; not measured"),
    Column("body_part_lost_samples", "1", "samples in which some segment was not tracked"),
    Column("outside_room_samples", "1", "samples outside the room"),
    Column("lost_01", "1", "share of 10 ms steps without a whole tracked body"),
    Column("collisions", "1", "counted collisions: above 1e-6 m³ for more than 10 ms"),
    Column("tracked_s", "s", "time in which the whole body was tracked and measured"),
    Column("collisions_per_tracked_min", "1/min", "counted collisions per minute of that time"),
    Column("collisions_uncounted", "1", "contacts too short to count"),
    Column("collisions_cut", "1", "counted ones cut by lost tracking or the walk's end"),
    Column("max_volume_dm3", "dm³", "mean over counted collisions of their largest common volume"),
    Column("largest_volume_dm3", "dm³", "the largest of them"),
    Column("collision_s", "s", "mean duration of counted collisions"),
    Column("collision_speed_m_s", "m/s", "mean speed of the hips at their first contact"),
    Column("arm_collisions", "1", "counted collisions of an upper arm, forearm or hand"),
    Column("crossings", "1", "crossings between two people, in and out of the crowd included"),
    Column("shoulders_to_gap_deg", "deg", "mean angle of shoulders to gap at crossings, 0–90"),
    Column("shoulders_to_gap_narrow_deg", "deg", "the same at gaps of at most narrow_gap_m"),
    Column("crossings_narrow", "1", "crossings of such gaps"),
    Column("shoulders_to_way_deg", "deg", "mean angle of shoulders to square across the way, 0–90"),
    Column("speed_m_s", "m/s", "mean speed farther than a step from the point nearest the board"),
    Column("speed_whole_m_s", "m/s", "mean speed over all tracked time"),
    Column("path_m", "m", "length of the way over the floor; empty: more than 1 % was not tracked"),
    Column("time_s", "s", "from first to last step"),
    Column("stop_s", "s", "time left out round the stop at the board"),
    Column("hesitations", "1", "stretches below 0.1 m/s for at least 0.5 s outside that stop"),
    Column("hesitation_s", "s", "their sum"),
    Column("clearance_mean_m", "m", "mean distance to the nearest person's centre"),
    Column("clearance_min_m", "m", "least distance to a person's centre"),
    Column("cells", "1", "different cells walked through"),
    Column("cells_problem", "", "why the crowd has no cells"),
    Column("step_m", "m", "the step left out round the stop"),
    Column("density_per_m2", "1/m²", "mean density by the participant's Voronoi cell (PedPy)"),
    Column("individual_speed_m_s", "m/s", "mean individual speed at the same moments (PedPy)"),
    Column("pulses", "1", "vibrations commanded"),
    Column("pulses_lost", "1", "of these, never acknowledged"),
    Column("caution", "1", "a simulated participant's learned caution at the end"),
)
"""Columns that a walk writes into its row, and its measures."""
COLLISIONS: Final = (
    Column("person", "", "number of the person in the crowd, from 0"),
    Column("behaviour", "", "0 waiting, 1 telephoning"),
    Column("start_s", "s", "first step in contact, from the walk's start"),
    Column("end_s", "s", "last step in contact"),
    Column("duration_s", "s", "from first to last step in contact"),
    Column("max_volume_dm3", "dm³", "largest common volume"),
    Column("peak_s", "s", "when it was reached"),
    Column("body_part", "", "participant's part nearest to the centre of the common volume then"),
    Column("side", "", "left, right or middle of the participant"),
    Column("speed_m_s", "m/s", "speed of the hips at first contact"),
    Column("counted", "", "lasted longer than 10 ms"),
    Column("rule", "", "rule of volumes: volume, centres or published"),
    Column("surface", "", "bodies measured: characters, fine, light or capsules"),
    Column("cut", "", "the step before or after was not measured, so the duration is unknown"),
)
CROSSINGS: Final = (
    Column("first", "", "number of one of the two people"),
    Column("second", "", "number of the other"),
    Column("x_m", "m", "where the way crossed the line between them, to the right"),
    Column("z_m", "m", "the same, towards the start"),
    Column("t_s", "s", "when, from the walk's start"),
    Column("centres_apart_m", "m", "distance of the two people"),
    Column("shoulders_to_gap_deg", "deg", "shoulders to the line between them, 0–90 (published)"),
    Column("shoulders_to_way_deg", "deg", "shoulders to square across the way walked, 0–90"),
)
PULSES: Final = (
    Column("role", "", "armband"),
    Column("segment", "", "arm segment in contact"),
    Column("person", "", "number of the person touched, from 0"),
    Column("motors", "", "motors driven"),
    Column("t_contact_ns", "ns", "session time of the body sample that showed the contact"),
    Column("commanded_ms", "ms", "from that sample to the order"),
    Column("sent_ms", "ms", "to the last byte on the wire"),
    Column("acknowledged_ms", "ms", "to the band's answer; empty: none came"),
    Column("risen_ms", "ms", "to the motor at 63 %, by the band's own time and a modelled rise"),
    Column("held_ms", "ms", "how long the contact lasted"),
    Column("acknowledged", "", "the band answered"),
)
CELLS: Final = (
    Column("cells", "", "cells as walked, each the numbers of three people; null outside"),
    Column("track_m", "m", "way over the floor, x and z every 0.1 s"),
)
SIMILARITY: Final = (
    Column("variant", "", "of Dice: union, frequency or pairs"),
    Column("first", "", "one block"),
    Column("second", "", "the other"),
    Column("between_blocks", "1", "whole blocks, as published; mean over configurations"),
    Column("between_blocks_sd", "1", "its standard deviation over configurations"),
    Column("within_block_halves", "1", "random halves of one block, as published"),
    Column("within_block_halves_sd", "1", "standard deviation over blocks and splits"),
    Column("matched_between", "1", "between blocks at equal sizes, different people"),
    Column("matched_within", "1", "within blocks at the same sizes"),
    Column("matched_difference", "1", "within less between"),
    Column("permutation_p", "1", "one-sided, by exchanging people's blocks"),
    Column("n_people", "1", "people"),
    Column("n_splits", "1", "random splits"),
    Column("n_permutations", "1", "permutations"),
    *(
        Column(f"between_{crowd}", "1", f"Dice of whole blocks in configuration {crowd}")
        for crowd in CROWDS
    ),
)
TABLES: Final[Mapping[str, Sequence[Column]]] = {
    "collisions": COLLISIONS,
    "crossings": CROSSINGS,
    "cells": CELLS,
    "pulses": PULSES,
}
"""Tables beside those of every study."""
