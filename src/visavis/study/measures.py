"""The measures of a study: column, unit, words, how trials are combined, and the source.

A measure is computed trial by trial from the recording alone. Answers are measures by themselves;
`dwell_on("active")` and its like measure gaze on an agent that plays a role in a scene.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, Literal, Protocol

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.analysis.gaze.aoi import DEFAULT_PAD_DEG
from visavis.analysis.gaze.looks import DEFAULT_LOOK_PARAMETERS, LookMeasures, measure_trial
from visavis.analysis.gaze.targets import GazeTargets, PartGaze, gaze_of_part
from visavis.lab.errors import DataError, DesignError, UsageError
from visavis.lab.kinds import of_kinds, takes_kinds
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.steps import Scalar
from visavis.recording.reader import Recording, flat_components
from visavis.study.quest_plus import QuestPlus, columns_of_quest
from visavis.study.staircase import Staircase
from visavis.study.study_errors import users_mistake

Aggregate = Literal["mean", "median", "share", "last", "fit"]


class SamplesUnreadable(DataError):
    """A measure asked for samples of a trial that a damaged recording lost in part."""


LOOKS: Final = replace(DEFAULT_LOOK_PARAMETERS, backward="sort", conflicts="keep_first")
"""A tracker's faulty stamps must not cost a study its session: they are mended."""
LOST_COLUMN: Final = "gaze_lost_01"
HEAD_LOST_COLUMN: Final = "head_lost_01"
CLOCK_JUMP: Final = Column(
    "clock_jump_ms",
    "ms",
    "the largest jump of the eye tracker's clock within the trial, or shortly before it with "
    "samples still dated by the old clock; 0: none",
)


@dataclass(frozen=True, eq=False)
class TrialRecord:
    """One recorded trial: its row, and its part of the session's streams.

    `gaze` are the gaze samples of the whole session's part (None without an eye tracker);
    `recording` is None for a trial of the quick path of power, which has the `events`
    that would be recorded. `damaged_streams` lost samples of this trial after they were recorded.
    """

    row: Mapping[str, Any]
    recording: Recording | None
    gaze: GazeTargets | None = field(repr=False, default=None)
    damaged_streams: frozenset[str] = frozenset()
    events: tuple[tuple[str, Mapping[str, Any]], ...] = ()

    @property
    def name(self) -> str:
        """The trial's name in messages: its session's folder and its identifier."""
        where = "a simulated trial" if self.recording is None else str(self.recording.path)
        return f"{where}, trial {self.row.get('trial_id')}"

    def number(self, column: str) -> float | None:
        """Return a number of the row, None where it is missing."""
        value = self.row.get(column)
        if value is None or isinstance(value, str) or value != value:
            return None
        return float(value)

    def window(self, scene: str = "scene") -> tuple[int, int] | None:
        """Return start and end of a scene, session time in ns; None if it was not shown."""
        on, off = self.number(f"{scene}_on_ns"), self.number(f"{scene}_off_ns")
        return None if on is None or off is None else (int(on), int(off))

    def role(self, role: str, scene: str = "scene") -> int | None:
        """Return the index of the agent that plays a role in a scene; None if none does.

        Raises:
            DesignError: nobody plays it in any trial of the session that shows such scenes.
        """
        columns = [c.removeprefix(f"{scene}_") for c in self.row if str(c).startswith(f"{scene}_")]
        if "on_ns" in columns and role not in columns:
            there = ", ".join(name for name in columns if name not in NO_ROLES) or "none"
            raise DesignError(
                f"{self.name}: nobody is {role!r} in scene {scene!r}; roles are: {there}"
            )
        index = self.number(f"{scene}_{role}")
        return None if index is None else int(index)

    def stream(self, name: str, start_ns: int, end_ns: int) -> dict[str, npt.NDArray[Any]]:
        """Return a stream's columns between two times of this trial's part.

        A field of several numbers is there whole (`direction_world`, n by 3) and by the names of
        tables (`direction_world_x`).

        Raises:
            KeyError: there is no such column, with those there are.
            SamplesUnreadable: it lost samples of this trial; a measure that asks is missing then.
        """
        if name in self.damaged_streams:
            raise SamplesUnreadable(f"{self.name}: samples of {name} cannot be read")
        if self.recording is None:
            raise UsageError(
                f"stream {name!r} is measured from recordings, which the quick path of power does "
                "not make; simulate sessions and give their folder with --from"
            )
        columns = self.recording.stream_arrays(name)
        at = columns["t_host_ns"]
        part = columns["recording_part"] == int(self.row["recording_part"])
        is_inside = part & (at >= start_ns) & (at < end_ns)
        return _StreamColumns({column: values[is_inside] for column, values in columns.items()})

    def looks(self, role: str, scene: str, pad_deg: float) -> LookMeasures | None:
        """Return the looks on the agent of a role while a scene was shown."""
        window, agent = self.window(scene), self.role(role, scene)
        if self.gaze is None or window is None or agent is None:
            return None
        samples = self.gaze.between(*window)
        aoi = samples.areas(pad_deg)
        return measure_trial(samples.t_ns, aoi, agent, *window, switch_ns=None, params=LOOKS)


class _StreamColumns(dict[str, npt.NDArray[Any]]):
    """Columns of a stream, by the names of its fields and by those of tables."""

    def __missing__(self, name: str) -> npt.NDArray[Any]:
        for field_name, values in self.items():
            for flat, column in flat_components(field_name, values):
                if flat == name:
                    return column
        raise KeyError(f"no {name!r}; there are {names_or_none(self)}")


NO_ROLES: Final = ("on_ns", "off_ns", "frames")
Of = Callable[[TrialRecord], Scalar | None]


class OfCell(Protocol):
    """A number of all trials of a cell, such as the threshold of a function fitted to them."""

    @property
    def reads(self) -> tuple[str, ...]:
        """The columns of trials that it reads."""
        ...

    def __call__(self, trials: pd.DataFrame, /) -> float | None:
        """Return the number; None where it is missing."""
        ...


@dataclass(frozen=True)
@of_kinds()
class Measure:
    """A measure of a trial.

    `words` describe the column and head figures ("Dwell time on the active person"); `aggregate`
    says how the trials of a cell become one number per person. `needs_gaze` leaves out trials
    with too much lost gaze.
    """

    column: str
    unit: str
    words: str
    of: Of | None = None
    aggregate: Aggregate = "mean"
    needs_gaze: bool = False
    role: str = ""
    """The role of a scene that it is about, if any."""
    scale: tuple[float, float] | None = None
    """The ends of a rating's scale; figures show the whole of it."""
    held: str = ""
    """The answer whose key it times from press to release, if any."""
    areas: tuple[str, ...] = ()
    """The areas of interest, or roles, that it is about, if any."""
    scene: str = ""
    """The columns of what is shown while gaze is measured, if any."""
    of_cell: OfCell | None = None
    """Computes the number of a cell from its trials, which have none of their own: `aggregate` is
    "fit"."""

    @property
    def axis(self) -> str:
        """The label of a figure's axis."""
        unit_text = {"1": "", "": ""}.get(self.unit, f" ({self.unit})")
        kind = {"mean": "", "median": "median ", "share": "share: ", "last": "last ", "fit": ""}[
            self.aggregate
        ]
        return f"{kind}{self.words}{unit_text}".capitalize() if kind else f"{self.words}{unit_text}"

    @property
    def digits(self) -> int:
        """Decimals to print: 0 for milliseconds, 3 for metres, 4 for what is fitted."""
        return {"ms": 0, "m": 3}.get(self.unit, 2 if self.of_cell is None else 4)

    def is_in(self, trials: pd.DataFrame) -> bool:
        """Tell whether trials have it, or what it is computed from."""
        columns = (self.column,) if self.of_cell is None else self.of_cell.reads
        return set(columns) <= set(trials.columns)

    def description(self) -> Column:
        """Return the column as a dictionary describes it."""
        return Column(self.column, self.unit, self.words[:1].lower() + self.words[1:])


def whom(role: str) -> str:
    """Return who plays a role, in words: "the active person", "the person"."""
    words = role.replace("_", " ")
    return f"the {words}" if words.split()[-1] in ("person", "people") else f"the {words} person"


def _of_looks(role: str, scene: str, pad_deg: float, pick: Callable[[LookMeasures], Any]) -> Of:
    def of(record: TrialRecord) -> Scalar | None:
        looks = record.looks(role, scene, pad_deg)
        if looks is None or looks.lost_01 is None or looks.lost_01 >= 1.0:
            return None  # without gaze the value is missing, not zero
        value: Scalar | None = pick(looks)
        return value

    return of


@takes_kinds()
def dwell_on(
    role: str, *, scene: str = "scene", column: str = "dwell_ms", pad_deg: float = DEFAULT_PAD_DEG
) -> Measure:
    """Return the time of valid gaze on the head of the agent that plays a role."""
    return Measure(
        column,
        "ms",
        f"Dwell time on {whom(role)}",
        _of_looks(role, scene, pad_deg, lambda looks: looks.dwell_ms),
        needs_gaze=True,
        role=role,
    )


@takes_kinds()
def dwell_share_on(
    role: str,
    *,
    scene: str = "scene",
    column: str = "dwell_of_valid_01",
    pad_deg: float = DEFAULT_PAD_DEG,
) -> Measure:
    """Return the dwell time on the head of an agent as a share of the time with usable gaze.

    Trials of which more gaze was lost can be compared by it; in milliseconds they cannot.
    """
    return Measure(
        column,
        "1",
        f"Share of usable gaze on {whom(role)}",
        _of_looks(role, scene, pad_deg, lambda looks: looks.dwell_of_valid_01),
        needs_gaze=True,
        role=role,
    )


@takes_kinds()
def fixations_on(
    role: str,
    *,
    scene: str = "scene",
    column: str = "fixation_count",
    pad_deg: float = DEFAULT_PAD_DEG,
) -> Measure:
    """Return how many fixations fell on the head of the agent that plays a role."""
    return Measure(
        column,
        "1",
        f"Fixations on {whom(role)}",
        _of_looks(role, scene, pad_deg, lambda looks: looks.as_row()["fixation_count"]),
        needs_gaze=True,
        role=role,
    )


@takes_kinds()
def first_fixation_on(
    role: str,
    *,
    scene: str = "scene",
    column: str = "first_fixation_time_ms",
    pad_deg: float = DEFAULT_PAD_DEG,
) -> Measure:
    """Return the time from the scene's onset to the first fixation on a head; missing if none."""
    return Measure(
        column,
        "ms",
        f"Time to the first fixation on {whom(role)}",
        _of_looks(role, scene, pad_deg, lambda looks: looks.first_fixation_time_ms),
        needs_gaze=True,
        role=role,
    )


def lost_gaze(scene: str = "scene") -> Measure:
    """Return the share of a scene's time without usable gaze, missing samples included."""

    def of(record: TrialRecord) -> Scalar | None:
        window = record.window(scene)
        if record.gaze is None or window is None:
            return None
        samples = record.gaze.between(*window)
        nobody = np.where(samples.valid, -1, -2).astype(np.int16)
        looks = measure_trial(samples.t_ns, nobody, 0, *window, switch_ns=None, params=LOOKS)
        return looks.lost_01

    return Measure(LOST_COLUMN, "1", "Share of the scene without usable gaze", of)


def lost_head() -> Measure:
    """Return the share of a trial's head poses that were not tracked."""

    def of(record: TrialRecord) -> Scalar | None:
        start, end = record.number("t_start_ns"), record.number("t_end_ns")
        if record.recording is None or start is None or end is None:
            return None
        if "head" not in record.recording.stream_names:
            return None
        valid = record.stream("head", int(start), int(end))["valid"]
        return float(1 - valid.mean()) if len(valid) else None

    return Measure(HEAD_LOST_COLUMN, "1", "Share of the trial without a tracked head", of)


@takes_kinds()
def column(
    name: str, unit: str = "1", words: str = "", *, aggregate: Aggregate = "mean"
) -> Measure:
    """Return a column that the trial itself wrote into its row, as a measure."""
    return Measure(name, unit, words or name.replace("_", " ").capitalize(), None, aggregate)


@takes_kinds()
def staircase_measures(staircase: Staircase | QuestPlus) -> tuple[Measure, ...]:
    """Return the columns of a staircase as measures: levels, and the threshold they lead to.

    Of QUEST+, threshold and slope with their intervals, as they are after the last answer.
    """
    words = staircase.name.replace("_", " ")
    if isinstance(staircase, QuestPlus):
        return tuple(
            column(c.name, "1", c.description.capitalize(), aggregate="last")
            for c in columns_of_quest(staircase)
            if c.name.startswith((f"{staircase.name}_threshold", f"{staircase.name}_slope"))
        )
    return (
        column(f"{staircase.name}_level", "1", f"Level of {words}"),
        column(f"{staircase.name}_threshold", "1", f"Threshold of {words}, levels at reversals"),
    )


def value_of(measure: Measure, record: TrialRecord) -> Scalar | None:
    """Return a measure of a trial: computed, or as the trial wrote it.

    None if it needs samples that a damaged recording lost.

    Raises:
        DataError: the measure cannot be computed, with the trial and the reason.
    """
    if measure.of is None:
        value = record.row.get(measure.column)
        return None if value is None or value != value else value
    try:
        return measure.of(record)
    except SamplesUnreadable:
        return None
    except Exception as error:
        mistake = users_mistake(error)
        if mistake is None and not isinstance(error, KeyError | ValueError | IndexError):
            raise
        what = f"{type(error).__name__}: {error}" if mistake is None else str(mistake)
        raise DataError(
            f"{record.name}: {measure.column} could not be measured ({what}); correct its function "
            "in the study file, or look at the trial: visavis check, visavis view"
        ) from error


def count_column(factors: Sequence[str]) -> str:
    """Return the column of the number of trials of a cell: "n", unless a factor is called so."""
    return "n_trials" if "n" in factors else "n"


def aggregate_cells(
    trials: pd.DataFrame, measures: Sequence[Measure], factors: Sequence[str]
) -> pd.DataFrame:
    """Return one row per participant and cell: each measure combined as it says, and its number of
    trials (`count_column`).
    """
    keys = ["participant", *factors]
    groups = trials.groupby(keys, sort=True, observed=True)
    columns: dict[str, Any] = {count_column(factors): groups.size()}
    for measure in measures:
        if not measure.is_in(trials):
            continue
        if (of_cell := measure.of_cell) is not None:
            if not set(of_cell.reads) & set(factors):  # levels apart lead to no function
                numbers = {key: of_cell(cell) for key, cell in groups}
                index = columns[count_column(factors)].index
                columns[measure.column] = pd.Series(list(numbers.values()), index, dtype=float)
            continue
        values = pd.to_numeric(trials[measure.column], errors="coerce").astype(float)
        cell = values.groupby([trials[k] for k in keys], sort=True, observed=True)
        columns[measure.column] = (
            cell.median()
            if measure.aggregate == "median"
            else cell.last()  # of those that are there, in the order of trials
            if measure.aggregate == "last"
            else cell.mean()
        )
    return pd.DataFrame(columns).reset_index()


class SessionGaze:
    """The gaze samples of a session, read once and cut by part."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording

    @cached_property
    def _parts(self) -> dict[int, PartGaze]:
        return {}

    def of_part(self, part: int) -> PartGaze | None:
        """Return one part's samples, frozen and misdated ones lost; None without a tracker."""
        if "gaze_targets" not in self._recording.stream_names:
            return None
        if part not in self._parts:
            self._parts[part] = gaze_of_part(self._recording, part)
        return self._parts[part]
