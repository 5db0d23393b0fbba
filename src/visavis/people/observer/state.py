"""The state of a simulated observer as structured arrays, shared by its compiled kernels."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

HEAD, BODY, ROOM, SPEAKER_SIDE = 0, 1, 2, 3
FREE, INSTRUCTED, IDLE = 0, 1, 2
FAR_FUTURE_NS = np.int64(1) << np.int64(62)
N_SEGMENTS = 16
N_PENDING = 8
NO_TARGET = -1

TARGET_DTYPE = np.dtype(
    [
        ("kind", "i8"),
        ("agent", "i8"),
        ("direction", "f8", (3,)),  # from the seat
        ("distance_m", "f8"),
        ("radius_rad", "f8"),  # fixations scatter round the centre by a share of this
        ("appeal", "f8"),  # attraction from place and size, before novelty and contact
        ("contact", "i8"),  # 1 while its gaze meets the observer's eyes
        ("is_noticed", "i8"),  # 1 once that has been noticed
        ("caught", "i8"),  # 1 when it was seen to look elsewhere before
        ("lost_ns", "i8"),  # when contact was seen to end, -1 never
        ("visits", "i8"),
        ("left_ns", "i8"),  # when it was looked at last
    ]
)
"""Somewhere to look, with what the observer remembers of it."""

SEGMENT_DTYPE = np.dtype(
    [
        ("start_ns", "i8"),
        ("saccade_ns", "i8"),
        ("origin", "f8", (3,)),
        ("landing", "f8", (3,)),
        ("origin_dioptre", "f8"),
        ("landing_dioptre", "f8"),
        ("axis_a", "f8", (3,)),
        ("axis_b", "f8", (3,)),
        ("phase", "f8", (4,)),
        ("head_yaw", "f8"),
        ("head_pitch", "f8"),
        ("head_yaw_rate", "f8"),
        ("head_pitch_rate", "f8"),
        ("goal_yaw", "f8"),
        ("goal_pitch", "f8"),
        ("pupil_mm", "f8"),
        ("pupil_goal_mm", "f8"),
    ]
)
"""One saccade and the fixation after it; head and pupil follow closed forms from its start."""

MIND_DTYPE = np.dtype(
    [
        ("key", "u8"),
        ("draws", "u8"),  # random numbers used of stream `key`
        ("blink_key", "u8"),
        ("blinks_drawn", "u8"),
        ("now_ns", "i8"),
        ("mode", "i8"),
        ("n_targets", "i8"),
        ("target", "i8"),
        ("next_ns", "i8"),
        ("visit_end_ns", "i8"),
        ("arrival_ns", "i8"),
        ("notice_ns", "i8"),
        ("correction", "i8"),
        ("saw_change", "i8"),
        ("aim", "f8", (3,)),
        ("aim_dioptre", "f8"),
        ("segment", "i8"),
        ("pending_first", "i8"),
        ("pending_count", "i8"),
        ("pending_ns", "i8", (N_PENDING,)),
        ("pending_contacts", "i8", (N_PENDING,)),
        ("contacts", "i8"),
        ("last_seen_contacts", "i8"),
        ("blink_start_ns", "i8"),
        ("blink_end_ns", "i8"),
        ("last_blink_start_ns", "i8"),
        ("last_blink_end_ns", "i8"),
        ("scene_ns", "i8"),
        ("brightness_01", "f8"),
        ("arousal_01", "f8"),
        ("rest_yaw", "f8"),
        ("rest_pitch", "f8"),
        ("sway_phase", "f8", (4,)),
        ("instructed", "f8", (3,)),
        ("instructed_dioptre", "f8"),
    ]
)
"""The current state of the observer."""

PERSON_DTYPE = np.dtype(
    [
        (name, "f8")
        for name in (
            "head_visit_s",
            "head_visit_log_sd",
            "other_visit_s",
            "other_visit_log_sd",
            "hold_s",
            "hold_log_sd",
            "hold_growth",
            "caught_hold",
            "caught_return",
            "startle_s",
            "return_gain",
            "recheck_gain",
            "recheck_s",
            "return_habituation",
            "novelty_gain",
            "recovery_s",
            "familiar_share",
            "second_look_gain",
            "second_look_s",
            "early_gain",
            "early_s",
            "notice_s",
            "change_notice_s",
            "notice_log_sd",
            "notice_p",
            "parafovea_p",
            "parafovea_rad",
            "onset_p",
            "onset_rad",
            "capture_gain",
            "amplitude_rad",
            "scatter_share",
            "fixation_s",
            "fixation_log_sd",
            "onset_latency_s",
            "undershoot_share",
            "undershoot_p",
            "correction_s",
            "saccade_s",
            "saccade_s_per_rad",
            "drift_rad",
            "tremor_rad",
            "head_gain",
            "head_rate",
            "eye_range_rad",
            "blink_interval_s",
            "blink_s",
            "pupil_dark_mm",
            "pupil_bright_mm",
            "pupil_arousal_mm",
            "pupil_s",
            "sway_m",
            "ipd_m",
            "neck_back_m",
            "neck_up_m",
            "seat_x",
            "seat_y",
            "seat_z",
        )
    ]
)
"""One person's constants; `temperament.Population` documents each."""

Records: TypeAlias = npt.NDArray[np.void]
Record: TypeAlias = Any
"""One element of a structured array; its fields are attributes only in compiled code."""
