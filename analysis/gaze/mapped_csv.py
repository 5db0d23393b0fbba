"""Read any table of gaze by a mapping that says which column is what, in which unit."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from visavis.analysis.gaze.foreign import (
    EyeSamples,
    GazeRecording,
    axes_matrix,
    eye_samples,
    orientations_in_our_axes,
    without_zeros,
)
from visavis.analysis.gaze.text_table import TextTable, read_text_table
from visavis.lab.errors import ConfigError
from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg, unit
from visavis.lab.yaml_lines import ProblemsError, read_document

Three = Annotated[list[str], Field(min_length=3, max_length=3)]
Four = Annotated[list[str], Field(min_length=4, max_length=4)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class TimeColumn(_Strict):
    """Where the time stamps are; `from_first` counts from the first row."""

    column: str
    unit: Literal["ns", "100ns", "us", "ms", "s"]
    from_first: bool = False


class Axes(_Strict):
    """Which of the file's axes points right, up and forward; default: x, y, −z."""

    right: str = "+x"
    up: str = "+y"
    forward: str = "-z"

    @property
    def matrix(self) -> Vector:
        """The map to our axes."""
        return axes_matrix(self.right, self.up, self.forward)


class Angles(_Strict):
    """Gaze as two angle columns."""

    azimuth: str
    elevation: str
    unit: Literal["deg", "rad"]
    azimuth_positive: Literal["right", "left"] = "right"
    elevation_positive: Literal["up", "down"] = "up"


class Pupil(_Strict):
    """A pupil diameter column."""

    column: str
    unit: Literal["mm", "m"]


class EyeColumns(_Strict):
    """One eye's columns: a direction of three columns, or two angles."""

    direction: Three | None = None
    angles: Angles | None = None
    valid: str | None = None
    pupil: Pupil | None = None
    openness: str | None = None
    confidence: str | None = None

    @model_validator(mode="after")
    def _one_direction(self) -> "EyeColumns":
        if (self.direction is None) == (self.angles is None):
            raise ValueError("give either direction (three columns) or angles, not both")
        return self


class HeadColumns(_Strict):
    """The head pose in world: position columns and quaternion columns, w first."""

    position: Three
    unit: Literal["m", "mm", "cm"]
    orientation_wxyz: Four
    axes: Axes = Axes()


class GazeMapping(_Strict):
    """Columns of a table of gaze and their meaning; the content of a `--mapping` file."""

    time: TimeColumn
    space: Literal["head", "world"]
    delimiter: str = ","
    axes: Axes = Axes()
    rate_hz: float | None = Field(default=None, gt=0)
    left: EyeColumns | None = None
    right: EyeColumns | None = None
    combined: EyeColumns | None = None
    head: HeadColumns | None = None

    @model_validator(mode="after")
    def _some_eye(self) -> "GazeMapping":
        if self.left is None and self.right is None and self.combined is None:
            raise ValueError("map at least one of left, right, combined")
        return self


def read_mapping(path: Path) -> GazeMapping:
    """Read a mapping from YAML. Raises ConfigError with every problem at once."""
    document = read_document(path)
    if document.problems:
        raise ProblemsError(path, document.problems)
    return mapping_of(document.data, source=str(path))


def mapping_of(content: object, *, source: str = "mapping") -> GazeMapping:
    """Check a mapping given as nested dictionaries."""
    try:
        return GazeMapping.model_validate(content)
    except ValidationError as error:
        lines = [f"  {'.'.join(map(str, e['loc'])) or 'all'}: {e['msg']}" for e in error.errors()]
        raise ConfigError("\n".join([f"{source}: not a gaze mapping", *lines])) from error


def read_csv(path: Path, mapping: GazeMapping) -> GazeRecording:
    """Read a table of gaze as its mapping says."""
    table = read_text_table(path, delimiter=mapping.delimiter)
    matrix = mapping.axes.matrix
    position = orientation = None
    if mapping.head is not None:
        scale = {"m": 1.0, "cm": 0.01, "mm": 0.001}[mapping.head.unit]
        head_matrix = mapping.head.axes.matrix
        position = scale * table.vectors(mapping.head.position) @ head_matrix.T
        orientation = orientations_in_our_axes(
            unit(table.vectors(mapping.head.orientation_wxyz)), head_matrix
        )
    return GazeRecording(
        name=path.stem,
        t_ns=table.stamps(
            mapping.time.column, mapping.time.unit, from_first=mapping.time.from_first
        ),
        space=mapping.space,
        left=_eye(table, mapping.left, matrix),
        right=_eye(table, mapping.right, matrix),
        combined=_eye(table, mapping.combined, matrix),
        head_position_m=position,
        head_orientation_wxyz=orientation,
        rate_hz=mapping.rate_hz,
        notes={"format": "CSV by mapping"},
    )


def _eye(table: TextTable, columns: EyeColumns | None, matrix: Vector) -> EyeSamples | None:
    if columns is None:
        return None
    if columns.angles is None:
        ray = without_zeros(table.vectors(columns.direction or []) @ matrix.T)
    else:
        convention = columns.angles
        angles = table.vectors([convention.azimuth, convention.elevation])
        if convention.unit == "rad":
            angles = np.degrees(angles)
        yaw = angles[:, 0] * (-1.0 if convention.azimuth_positive == "right" else 1.0)
        pitch = angles[:, 1] * (1.0 if convention.elevation_positive == "up" else -1.0)
        ray = direction_from_yaw_pitch_deg(yaw, pitch)
    pupil = None
    if columns.pupil is not None:
        pupil = table.numbers(columns.pupil.column) * (1e3 if columns.pupil.unit == "m" else 1.0)
        pupil = np.where(pupil > 0, pupil, np.nan)
    return eye_samples(
        ray,
        valid=table.flags(columns.valid) if columns.valid else None,
        pupil_mm=pupil,
        openness_01=table.numbers(columns.openness) if columns.openness else None,
        confidence_01=table.numbers(columns.confidence) if columns.confidence else None,
    )
