"""Hold a gaze recording that came from elsewhere, in Visavis's frames and times."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.stamps import Times
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector, quat_multiply

Column = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class EyeSamples:
    """One eye (or both combined): n rows as the tracker gave them.

    `direction` (n, 3), frame as the recording says; NaN when lost; unit unless
    the file is wrong. `valid` (n,) the
    tracker's own verdict. The rest (n,) with NaN where unknown; `pupil_size` is in the tracker's
    own unit where that is not mm.
    """

    direction: Vector
    valid: Mask
    pupil_mm: Column
    openness_01: Column
    confidence_01: Column
    pupil_size: Column | None = None


@dataclass(frozen=True)
class GazeRecording:
    """A gaze recording read from a file; rows keep the file's order.

    `t_ns` (n,) the recording's main clock, `t_device_ns` (n,) the tracker's own where the file
    has both. Directions are in head when `space` is "head". `head_position_m` (n, 3) and
    `head_orientation_wxyz` (n, 4) are in world, NaN when untracked, None when the file has none.
    `rate_hz` is what the file or its maker states; None when nobody does. `notes` keeps what
    else the file said, `remarks` what was read otherwise than it stands, `time_unit` the unit of
    the file's stamps ("" when unknown). `resumed_ns` (k,) are the stamps at which the recorder went
    on after pauses that its user made, in which nothing was lost.
    """

    name: str
    t_ns: Times
    space: str
    left: EyeSamples | None = None
    right: EyeSamples | None = None
    combined: EyeSamples | None = None
    t_device_ns: Times | None = None
    head_position_m: Vector | None = None
    head_orientation_wxyz: Vector | None = None
    rate_hz: float | None = None
    notes: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    time_unit: str = ""
    resumed_ns: tuple[int, ...] = ()

    def __len__(self) -> int:
        return int(self.t_ns.shape[0])

    @property
    def eyes(self) -> Mapping[str, EyeSamples]:
        """The eyes the file has, by name."""
        by_name = {"left": self.left, "right": self.right, "combined": self.combined}
        return {name: eye for name, eye in by_name.items() if eye is not None}


def rows_of_eye(eye: EyeSamples, rows: npt.NDArray[np.int64]) -> EyeSamples:
    """Return some rows of an eye."""
    return EyeSamples(
        eye.direction[rows],
        eye.valid[rows],
        eye.pupil_mm[rows],
        eye.openness_01[rows],
        eye.confidence_01[rows],
        None if eye.pupil_size is None else eye.pupil_size[rows],
    )


def rows_of(recording: GazeRecording, rows: npt.NDArray[np.int64]) -> GazeRecording:
    """Return some rows of a recording."""

    def some(values: npt.NDArray[Any] | None) -> npt.NDArray[Any] | None:
        return None if values is None else values[rows]

    return replace(
        recording,
        t_ns=recording.t_ns[rows],
        t_device_ns=some(recording.t_device_ns),
        head_position_m=some(recording.head_position_m),
        head_orientation_wxyz=some(recording.head_orientation_wxyz),
        left=recording.left and rows_of_eye(recording.left, rows),
        right=recording.right and rows_of_eye(recording.right, rows),
        combined=recording.combined and rows_of_eye(recording.combined, rows),
    )


def eye_samples(
    direction: Vector,
    *,
    valid: Mask | None = None,
    pupil_mm: Column | None = None,
    openness_01: Column | None = None,
    confidence_01: Column | None = None,
    pupil_size: Column | None = None,
) -> EyeSamples:
    """Build one eye's samples: valid where `valid` is left out, NaN in other missing columns."""
    n = direction.shape[0]
    all_missing = np.full(n, np.nan)
    return EyeSamples(
        direction,
        np.ones(n, bool) if valid is None else valid,
        all_missing if pupil_mm is None else pupil_mm,
        all_missing if openness_01 is None else openness_01,
        all_missing if confidence_01 is None else confidence_01,
        pupil_size,
    )


def without_zeros(direction: Vector) -> Vector:
    """Turn zero vectors (n, 3), which some trackers write for lost gaze, into NaN.

    Vectors of other lengths stay as they are, so that a later check finds those that are no
    directions.
    """
    without: Vector = np.where((direction == 0).all(axis=1)[:, None], np.nan, direction)
    return without


def axes_matrix(right: str, up: str, forward: str) -> Vector:
    """Return (3, 3) the map from a maker's axes to ours (x right, y up, −z forward).

    Each argument says which of the maker's axes points there: "+x", "-z".
    """
    rows = []
    for name in (right, up, forward):
        if len(name) != 2 or name[0] not in "+-" or name[1] not in "xyz":
            raise UsageError(f"axis {name!r} is not one of +x -x +y -y +z -z")
        rows.append((1.0 if name[0] == "+" else -1.0) * np.eye(3)["xyz".index(name[1])])
    matrix = np.array([rows[0], rows[1], -rows[2]])
    if abs(round(float(np.linalg.det(matrix)))) != 1:
        raise UsageError(f"axes right {right}, up {up}, forward {forward} name one axis twice")
    return matrix


def orientations_in_our_axes(wxyz: Vector, matrix: Vector) -> Vector:
    """Turn quaternions (n, 4) given in a maker's axes into ours; mirrored axes included."""
    vector_part: Vector = float(np.linalg.det(matrix)) * (wxyz[:, 1:] @ matrix.T)
    return np.column_stack([wxyz[:, :1], vector_part])


def quaternions_of_euler(degrees: Vector, order: str) -> Vector:
    """Return quaternions (n, 4) of angles (n, 3) about x, y and z, in the same axes.

    `order` names the axes in the order of the turns, which are about axes that stay: "zxy" turns
    about z, then x, then y.
    """
    half = np.radians(degrees) / 2
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (len(half), 1))
    for name in order:
        k = "xyz".index(name)
        turn = np.zeros((len(half), 4))
        turn[:, 0], turn[:, 1 + k] = np.cos(half[:, k]), np.sin(half[:, k])
        turned = quat_multiply(turn, turned)
    return turned
