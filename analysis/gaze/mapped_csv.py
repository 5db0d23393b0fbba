"""Read any table of gaze by a mapping that says which column is what, in which unit."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from visavis.analysis.gaze.foreign import (
    EyeSamples,
    GazeRecording,
    axes_matrix,
    eye_samples,
    orientations_in_our_axes,
    quaternions_of_euler,
    without_zeros,
)
from visavis.analysis.gaze.implausible import without_lost_points
from visavis.analysis.gaze.stamps import Times
from visavis.analysis.gaze.text_table import TextTable, plain_value, read_text_table
from visavis.lab.errors import ConfigError, DataError
from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg, unit
from visavis.lab.sampling import sampling_of
from visavis.lab.screen import FlatScreen
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
    """Gaze as two angle columns.

    `unit_is_certain` says that gaze that stays within 1.6 degrees is no mistake of unit.
    """

    azimuth: str
    elevation: str
    unit: Literal["deg", "rad"]
    unit_is_certain: bool = False
    azimuth_positive: Literal["right", "left"] = "right"
    elevation_positive: Literal["up", "down"] = "up"


class Pupil(_Strict):
    """A pupil diameter column."""

    column: str
    unit: Literal["mm", "m"]


class Screen(_Strict):
    """The screen that was looked at: its picture in pixels and metres, and how far it stood."""

    width_px: int = Field(gt=0)
    height_px: int = Field(gt=0)
    width_m: float = Field(gt=0, lt=20)
    height_m: float = Field(gt=0, lt=20)
    distance_m: float = Field(gt=0, lt=50)
    center_right_m: float = 0.0
    center_up_m: float = 0.0

    @property
    def flat(self) -> FlatScreen:
        """The screen as the lab knows it."""
        return FlatScreen(**self.model_dump())

    @classmethod
    def of(cls, flat: FlatScreen) -> Self:
        """Return where and how large a screen of the lab is, without how bright."""
        return cls(**{name: getattr(flat, name) for name in cls.model_fields})


class Pixels(_Strict):
    """Gaze as two columns on the screen: pixels, or shares of its width and height."""

    x: str
    y: str
    unit: Literal["px", "share"] = "px"
    origin: Literal["top left", "bottom left", "middle"] = "top left"


class ValidColumn(_Strict):
    """A column that says whether the tracker calls a sample usable, and by which values."""

    column: str
    is_: list[str | float] = Field(alias="is", min_length=1)


class Filter(_Strict):
    """Take only the rows in which a column holds one of these values."""

    column: str
    is_: list[str | float] = Field(alias="is", min_length=1)


class EyeColumns(_Strict):
    """One eye's columns: a direction of three columns, two angles, or a point on the screen."""

    direction: Three | None = None
    angles: Angles | None = None
    pixels: Pixels | None = None
    valid: str | ValidColumn | None = None
    pupil: Pupil | None = None
    openness: str | None = None
    confidence: str | None = None

    @model_validator(mode="after")
    def _one_direction(self) -> "EyeColumns":
        if [self.direction, self.angles, self.pixels].count(None) != 2:
            raise ValueError("give either direction (three columns), angles or pixels, one of them")
        return self

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that hold this eye's gaze, and what says whether it is valid."""
        gaze = list(self.direction or ())
        if self.angles is not None:
            gaze = [self.angles.azimuth, self.angles.elevation]
        elif self.pixels is not None:
            gaze = [self.pixels.x, self.pixels.y]
        valid = self.valid.column if isinstance(self.valid, ValidColumn) else self.valid
        return (*gaze, *((valid,) if valid else ()))


class Euler(_Strict):
    """Three columns of angles about x, y and z; `order` says about which is turned first.

    Turns are about axes that stay: "zxy" turns about z, then x, then y, as Unity does. A positive
    angle turns as the file's axes do: clockwise where they are left-handed.
    """

    columns: Three
    order: Literal["xyz", "xzy", "yxz", "yzx", "zxy", "zyx"]
    unit: Literal["deg", "rad"]


class HeadColumns(_Strict):
    """The head pose in world: position columns, and a quaternion or three angles."""

    position: Three
    unit: Literal["m", "mm", "cm"]
    orientation_wxyz: Four | None = None
    orientation_xyzw: Four | None = None
    euler: Euler | None = None
    axes: Axes = Axes()

    @model_validator(mode="after")
    def _one_orientation(self) -> "HeadColumns":
        if [self.orientation_wxyz, self.orientation_xyzw, self.euler].count(None) != 2:
            raise ValueError("give orientation_wxyz, orientation_xyzw or euler, one of them")
        return self


MIN_ROWS_JUDGED = 30
MAX_LENGTH_ERROR = 0.01
"""Directions are this close to 1 long; others would be dropped as damaged."""
"""Fewer rows say nothing about a mistake of unit or of meaning."""
MIN_SPREAD_RAD = 0.02
"""Angles of a person who looks about spread at least so far in rad; of one who does not, less."""
MAX_SHARE = 3.0
MIN_OTHERS_01 = 0.1
MAX_LOST_BETWEEN_OTHERS_01 = 0.02


class GazeMapping(_Strict):
    """Columns of a table of gaze and their meaning; the content of a `--mapping` file.

    `delimiter` None is found in the file; `where` chooses rows.
    """

    time: TimeColumn
    space: Literal["head", "world"]
    delimiter: str | None = ","
    where: list[Filter] = Field(default_factory=list)
    screen: Screen | None = None
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
        if self.screen is None and any(eye.pixels is not None for eye in self.eyes):
            raise ValueError("pixels need the screen: width_px, height_px, width_m, …")
        return self

    @property
    def eyes(self) -> tuple[EyeColumns, ...]:
        """The eyes that are mapped."""
        return tuple(e for e in (self.left, self.right, self.combined) if e is not None)


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
    """Read a table of gaze as its mapping says.

    Rows of other sensors, which hold nothing of any eye and stand evenly between those of gaze,
    are left out and told.

    Raises:
        DataError: a line or column that cannot be what the mapping says, with the likely reason.
    """
    return recording_of_table(read_text_table(path, delimiter=mapping.delimiter), mapping)


def recording_of_table(table: TextTable, mapping: GazeMapping) -> GazeRecording:
    """Return the recording that a table holds, as `read_csv`."""
    for each in mapping.where:
        table = table.where(each.column, each.is_)
    table, remarks = _without_other_sensors(table, mapping)
    matrix = mapping.axes.matrix
    position = orientation = None
    if mapping.head is not None:
        scale = {"m": 1.0, "cm": 0.01, "mm": 0.001}[mapping.head.unit]
        head_matrix = mapping.head.axes.matrix
        position = scale * table.vectors(mapping.head.position) @ head_matrix.T
        orientation = orientations_in_our_axes(_orientation(table, mapping.head), head_matrix)
    screen = None if mapping.screen is None else mapping.screen.flat
    eyes = {}
    for name in ("left", "right", "combined"):
        eyes[name], eye_remarks = _eye(table, getattr(mapping, name), matrix, screen)
        remarks = (*remarks, *(f"{name}: {text}" for text in eye_remarks))
    return GazeRecording(
        name=table.path.stem,
        t_ns=_stamps(table, mapping.time),
        space=mapping.space,
        left=eyes["left"],
        right=eyes["right"],
        combined=eyes["combined"],
        head_position_m=position,
        head_orientation_wxyz=orientation,
        rate_hz=mapping.rate_hz,
        notes={"format": "CSV by mapping"},
        remarks=(*table.remarks, *remarks),
        time_unit=mapping.time.unit,
    )


def _stamps(table: TextTable, time: TimeColumn) -> Times:
    return table.stamps(time.column, time.unit, from_first=time.from_first)


def _without_other_sensors(
    table: TextTable, mapping: GazeMapping
) -> tuple[TextTable, tuple[str, ...]]:
    """Return a table without rows that hold nothing of any eye, where they are other sensors'.

    Rows of lost gaze are empty, too; but without them a hole is left, and what is left without
    rows of another sensor has a rate of its own with no hole.
    """
    columns = [name for eye in mapping.eyes for name in eye.columns]
    is_blank = np.ones(len(table), bool)
    for name in columns:
        is_blank &= np.array([not cell.strip() for cell in table.column(name)], bool)
    n_blank = int(is_blank.sum())
    if n_blank < MIN_OTHERS_01 * len(table) or n_blank > len(table) - 3:
        return table, ()
    own = table.rows(np.flatnonzero(~is_blank))
    t_ns = np.unique(_stamps(own, mapping.time))
    if len(t_ns) < 3 or sampling_of(t_ns).lost_01 > MAX_LOST_BETWEEN_OTHERS_01:
        return table, ()
    return own, (
        f"{n_blank} of {len(table)} rows hold nothing of any eye and stand evenly between the "
        "others: they are another sensor's, and were left out",
    )


def _orientation(table: TextTable, head: HeadColumns) -> Vector:
    if head.euler is not None:
        angles = table.vectors(head.euler.columns)
        angles = np.degrees(angles) if head.euler.unit == "rad" else angles
        return quaternions_of_euler(angles, head.euler.order)
    if head.orientation_xyzw is not None:
        return unit(table.vectors(head.orientation_xyzw)[:, [3, 0, 1, 2]])
    return unit(table.vectors(head.orientation_wxyz or []))


def _eye(
    table: TextTable, columns: EyeColumns | None, matrix: Vector, screen: FlatScreen | None
) -> tuple[EyeSamples | None, tuple[str, ...]]:
    if columns is None:
        return None, ()
    remarks: tuple[str, ...] = ()
    if columns.angles is not None:
        ray = _ray_of_angles(table, columns.angles)
    elif columns.pixels is not None and screen is not None:
        ray, remarks = _ray_of_pixels(table, columns.pixels, screen)
    else:
        ray = without_zeros(table.vectors(columns.direction or []) @ matrix.T)
        _refuse_other_lengths(table, columns.direction or (), ray)
    pupil = None
    if columns.pupil is not None:
        pupil = table.numbers(columns.pupil.column) * (1e3 if columns.pupil.unit == "m" else 1.0)
        pupil = np.where(pupil > 0, pupil, np.nan)
    eye = eye_samples(
        ray,
        valid=_valid(table, columns.valid, ray),
        pupil_mm=pupil,
        openness_01=table.numbers(columns.openness) if columns.openness else None,
        confidence_01=table.numbers(columns.confidence) if columns.confidence else None,
    )
    return eye, remarks


def _refuse_other_lengths(table: TextTable, names: Sequence[str], ray: Vector) -> None:
    """Refuse vectors that are no directions: each of them would be dropped as damaged."""
    lengths = np.linalg.norm(ray, axis=1)
    lengths = lengths[np.isfinite(lengths)]
    if len(lengths) < MIN_ROWS_JUDGED:
        return
    middle = float(np.median(lengths))
    if abs(middle - 1.0) > MAX_LENGTH_ERROR:
        raise DataError(
            f"{table.path}: {', '.join(names)} are {middle:.4g} long in the middle, and a "
            "direction is 1 long; are they points or angles? Divide directions by their length"
        )


def _ray_of_angles(table: TextTable, convention: Angles) -> Vector:
    angles = table.vectors([convention.azimuth, convention.elevation])
    farthest = float(np.nanmax(np.abs(angles), initial=0.0)) if np.isfinite(angles).any() else 0.0
    spread = np.nanmax(np.nanstd(angles, axis=0)) if farthest else 0.0
    about = f"{table.path}: {convention.azimuth} and {convention.elevation}"
    if convention.unit == "rad" and farthest > 2 * np.pi:
        raise DataError(f"{about} reach {farthest:.4g}, which is no angle in rad; is it deg?")
    if (
        convention.unit == "deg"
        and not convention.unit_is_certain
        and len(angles) >= MIN_ROWS_JUDGED
        and farthest <= np.pi / 2
        and spread > MIN_SPREAD_RAD
    ):
        raise DataError(
            f"{about} stay within {farthest:.3g} degrees; are they in rad? If gaze did not leave "
            "the middle, say in the mapping unit_is_certain: true beside unit: deg"
        )
    angles = np.degrees(angles) if convention.unit == "rad" else angles
    yaw = angles[:, 0] * (-1.0 if convention.azimuth_positive == "right" else 1.0)
    pitch = angles[:, 1] * (1.0 if convention.elevation_positive == "up" else -1.0)
    return direction_from_yaw_pitch_deg(yaw, pitch)


def _ray_of_pixels(
    table: TextTable, pixels: Pixels, screen: FlatScreen
) -> tuple[Vector, tuple[str, ...]]:
    points = table.vectors([pixels.x, pixels.y])
    remarks: tuple[str, ...] = ()
    if pixels.origin != "middle":
        points, remarks = without_lost_points(points)
    size = np.array([screen.width_px, screen.height_px], np.float64)
    if pixels.unit == "px" and pixels.origin != "middle" and len(points) >= MIN_ROWS_JUDGED:
        farthest = float(np.nanmax(np.abs(points), initial=0.0))
        if 0.0 < farthest <= MAX_SHARE:
            raise DataError(
                f"{table.path}: {pixels.x} and {pixels.y} never exceed {farthest:.4g} px; are they "
                "shares of the screen (unit: share)?"
            )
    if pixels.unit == "share":
        farthest = float(np.nanmedian(np.abs(points))) if np.isfinite(points).any() else 0.0
        if farthest > MAX_SHARE:
            raise DataError(
                f"{table.path}: {pixels.x} and {pixels.y} are shares of the screen, yet half "
                f"of them exceed {farthest:.4g}; is the unit px?"
            )
        points = points * size
    if pixels.origin == "middle":
        points = points + size / 2
    elif pixels.origin == "bottom left":
        points = np.column_stack([points[:, 0], size[1] - points[:, 1]])
    return screen.directions_of(points), remarks


def _valid(
    table: TextTable, column: str | ValidColumn | None, ray: Vector
) -> npt.NDArray[np.bool_] | None:
    """Return what the tracker calls usable; refuse a column that calls nothing so."""
    if column is None:
        return None
    if isinstance(column, ValidColumn):
        name, valid = column.column, table.flags(column.column, column.is_)
    else:
        name, valid = column, table.flags(column)
    has_gaze = np.isfinite(ray[:, 0])
    if has_gaze.any() and len(valid) >= MIN_ROWS_JUDGED and not (valid & has_gaze).any():
        counts = Counter(plain_value(cell) for cell in table.column(name))
        values = ", ".join(f"{v or 'nothing'} in {n} rows" for v, n in counts.most_common(4))
        likely = counts.most_common(1)[0][0]
        raise DataError(
            f"{table.path}: {name} calls no sample valid although {int(has_gaze.sum())} rows hold "
            f"gaze ({values}); does {likely} mean valid here? Say so in the mapping: valid: "
            f"{{column: {name}, is: [{likely}]}}"
        )
    return valid
