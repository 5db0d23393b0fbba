"""Read gaze recordings that other software wrote: Vive Pro Eye CSV, Pupil Core exports."""

from pathlib import Path

import numpy as np

from visavis.analysis.gaze.foreign import (
    EyeSamples,
    GazeRecording,
    axes_matrix,
    eye_samples,
    orientations_in_our_axes,
    quaternions_of_euler,
    without_zeros,
)
from visavis.analysis.gaze.stamps import Times
from visavis.analysis.gaze.text_table import TextTable, read_text_table
from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector, unit

VIVE_RATE_HZ = 120.0
_VIVE_DIRECTION_VALID = 0b10
"""The second of the five validity bits (origin, direction, pupil, openness, position)."""

_VIVE_GAZE_AXES = axes_matrix("-x", "+y", "+z")
_UNITY_AXES = axes_matrix("+x", "+y", "+z")
_CAMERA_AXES = axes_matrix("+x", "-y", "+z")


def read_vive(path: Path) -> GazeRecording:
    """Read the table of the Vive Pro Eye runtime (SRanipal) with its Unity head pose.

    Columns are parted by semicolons, or by commas.

    Host time (100 ns ticks) is the main clock, counted from the first row; the device's
    millisecond counter, which repeats and wraps at 32 bits, becomes `t_device_ns`. Lost eyes are
    zero vectors in the file and NaN here.
    """
    table = read_text_table(path, delimiter=None)
    return GazeRecording(
        name=path.stem,
        t_ns=table.stamps("time(100ns)", "100ns", from_first=True),
        space="head",
        left=_vive_eye(table, "L"),
        right=_vive_eye(table, "R"),
        t_device_ns=_unwrapped_ms(table.numbers("time_stamp(ms)")),
        head_position_m=table.vectors([f"helmet_pos_{c}" for c in "xyz"]) @ _UNITY_AXES.T,
        head_orientation_wxyz=orientations_in_our_axes(
            quaternions_of_euler(table.vectors([f"helmet_rot_{c}" for c in "xyz"]), "zxy"),
            _UNITY_AXES,
        ),
        rate_hz=VIVE_RATE_HZ,
        notes={"format": "Vive Pro Eye (SRanipal) CSV"},
        remarks=table.remarks,
        time_unit="100ns",
    )


def _vive_eye(table: TextTable, side: str) -> EyeSamples:
    ray = table.vectors([f"gaze_direct_{side}.{c}" for c in "xyz"]) @ _VIVE_GAZE_AXES.T
    codes = table.numbers(f"eye_valid_{side}")
    flags = np.nan_to_num(codes).astype(np.int64)
    pupil = table.numbers(f"pupil_diameter_{side}(mm)")
    return eye_samples(
        without_zeros(ray),
        valid=(flags & _VIVE_DIRECTION_VALID) != 0,
        pupil_mm=np.where(pupil > 0, pupil, np.nan),
        openness_01=table.numbers(f"openness_{side}"),
    )


def _unwrapped_ms(stamps_ms: Vector) -> Times:
    """Count a 32-bit millisecond counter on from its first value."""
    counter = stamps_ms.astype(np.int64)
    steps = (np.diff(counter) + 2**31) % 2**32 - 2**31
    count_ns: Times = np.concatenate([[0], np.cumsum(steps)]) * NS_PER_MS
    return count_ns


def read_pupil(path: Path) -> GazeRecording:
    """Read `gaze_positions.csv` as the Pupil player exports it, with 3-D gaze mapping.

    The scene camera stands for the head. Eye 0 is the right eye, eye 1 the left. A row of one
    eye leaves the other missing; rows may go back in time where the eyes interleave.
    """
    table = read_text_table(path, delimiter=",")
    point = table.vectors([f"gaze_point_3d_{c}" for c in "xyz"])
    if np.isnan(point).all():
        raise DataError(
            f"{path}: no 3-D gaze points, only positions in the camera image; export again with "
            "the 3-D gaze mapper"
        )
    confidence = table.numbers("confidence")
    left, right = (
        eye_samples(
            unit(table.vectors([f"gaze_normal{eye}_{c}" for c in "xyz"]) @ _CAMERA_AXES.T),
            confidence_01=confidence,
        )
        if table.has(f"gaze_normal{eye}_x")
        else None
        for eye in (1, 0)
    )
    return GazeRecording(
        name=path.parent.name + "_" + path.stem if path.stem == "gaze_positions" else path.stem,
        t_ns=table.stamps("gaze_timestamp", "s"),
        space="head",
        left=left,
        right=right,
        combined=eye_samples(unit(point @ _CAMERA_AXES.T), confidence_01=confidence),
        notes={"format": "Pupil Core export"},
        remarks=table.remarks,
        time_unit="s",
    )
