"""What every column of every table is, for the analyst who has only the tables."""

import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pandas as pd

from visavis.lab.errors import DataError
from visavis.protocol.plan.columns import ANALYSED_COLUMNS, ENGINE_COLUMNS, Column, read_columns
from visavis.protocol.plan.design import SESSION
from visavis.protocol.plan.questionnaires import Questionnaire, score_range
from visavis.recording.csv_file import note_escaped_columns, write_csv
from visavis.results.picture_delay import LATE
from visavis.results.selection import HAND_PERSON, HAND_TRIAL
from visavis.results.several_sessions import SESSION_NUMBER
from visavis.study.exclusions import ANSWERED_COLUMN
from visavis.study.experiment import StudyExperiment
from visavis.study.films import film_columns
from visavis.study.gaze_on import ENDINGS as GAZE_ENDINGS
from visavis.study.gaze_window import ENDINGS as WINDOW_ENDINGS
from visavis.study.live import SEEN_IN, live_columns
from visavis.study.look_measures import LOOK_COLUMNS
from visavis.study.measures import CLOCK_JUMP, Measure
from visavis.study.quest_plus import QuestPlus, columns_of_quest
from visavis.study.showing import PAGE_COLUMNS
from visavis.study.staircase import columns_of

PEOPLE: Final = (
    Column("participant", "", "label from the ledger"),
    Column("trials_finished", "1", "trials finished, practice and repetitions not counted"),
    Column("completed_01", "1", "share of the planned trials that were finished"),
    Column("bad_trials_01", "1", "share of the finished trials that were left out"),
    Column("smallest_cell_trials", "1", "trials that count in the emptiest cell"),
    Column("smallest_cell_01", "1", "their share of the trials planned for a cell"),
    Column(
        ANSWERED_COLUMN, "1", "share of the questionnaires' required questions that were answered"
    ),
    Column("calibration_error_deg", "deg", "mean error over the validations of these trials"),
    Column("end_accuracy_deg", "deg", "mean error of the validation after the last trial"),
    Column("drift_deg", "deg", "error after the last trial minus that before; positive: worse"),
    Column("rejected_validations", "1", "validations that did not meet the thresholds"),
    Column("left_out_because", "", "why the person does not count; empty where they do"),
    Column("is_analysed", "", "the person counts"),
    Column("is_simulated", "", "nobody took part"),
)

HAND_COLUMNS: Final = (
    Column(
        HAND_TRIAL, "", "why and by whom the trial was left out by hand; empty where it was not"
    ),
    Column(HAND_PERSON, "", "why and by whom the participant was left out by hand"),
)
"""Columns that exclusions by hand add to the trials."""
WALK_COLUMNS: Final = (
    Column("walk_ms", "ms", "time until the place was reached; empty if it was not"),
    Column("walk_reached", "", "the place was reached in time"),
)
"""Columns of a trial in which the participant walks to a place."""
STATISTICS: Final = read_columns(Path(__file__).with_name("statistics_columns.csv"))["statistics"]


def trial_columns(experiment: StudyExperiment, measures: Sequence[Measure]) -> dict[str, Column]:
    """Return the descriptions of the columns of a study's trial table, by name."""
    columns = {c.name: c for c in (*ENGINE_COLUMNS, *ANALYSED_COLUMNS, LATE, CLOCK_JUMP)}
    for factor in experiment.study.design.factors:
        levels = ", ".join(map(str, factor.levels))
        kind = "between" if factor.between else "within"
        words = experiment.texts.find(f"labels.{factor.name}") or factor.name.replace("_", " ")
        columns[factor.name] = Column(factor.name, "", f"{words} ({kind} participants): {levels}")
    if experiment.study.design.sessions:
        words = f"session (within participants): {', '.join(experiment.study.design.sessions)}"
        columns[SESSION] = Column(SESSION, "", words)
        columns[SESSION_NUMBER.name] = SESSION_NUMBER
    for response in experiment.responses.values():
        columns |= {c.name: c for c in response.columns()}
    columns |= {c.name: c for c in (*WALK_COLUMNS, *HAND_COLUMNS)}
    for name in dict.fromkeys(n for t in experiment.read.values() for n in t.sound_columns):
        words = (
            "session time at which the sound's first sample left the card, on a page the browser; "
            "empty if nobody knows"
        )
        columns[name] = Column(name, "ns", words)
    columns |= film_columns(
        max((len(t.films) for t in experiment.read.values()), default=0),
        heard=bool(experiment.voices),
    )
    table = experiment.item_table
    if table is not None:
        for name in table.columns:
            columns.setdefault(name, Column(name, "", f"{name.replace('_', ' ')} of {table.file}"))
    columns |= {c.name: c for c in PAGE_COLUMNS} if experiment.fills_screen else {}
    lives = dict.fromkeys(name for t in experiment.read.values() for name in t.lives)
    columns |= live_columns(lives)
    if experiment.study.procedure.xr != "never":
        columns[SEEN_IN.name] = SEEN_IN
    for staircase in dict.fromkeys(s for t in experiment.read.values() for s in t.staircases):
        own = (
            columns_of_quest(staircase)
            if isinstance(staircase, QuestPlus)
            else columns_of(staircase)
        )
        columns |= {c.name: c for c in own}
    columns |= {m.column: m.description() for m in measures}
    columns |= {c.name: c for c in experiment.study.analysis.columns}
    for name in experiment.study.design.derived:
        columns.setdefault(name, Column(name, "", f"{name.replace('_', ' ')}, from the factors"))
    if experiment.study.analysis.looks:
        columns |= {c.name: c for c in LOOK_COLUMNS}
    return columns


def fixed_columns(experiment: StudyExperiment) -> tuple[Column, ...]:
    """Return the columns of a study's trial table whose types do not depend on the data.

    A study's own columns of unit "1" are not among them, except numbers of frames and samples:
    their values may be whole or not. A factor with the name of a column takes its place.
    """
    own = (
        c
        for c in experiment.study.analysis.columns
        if c.unit != "1" or c.name.endswith(("_frames", "_samples"))
    )
    looks = LOOK_COLUMNS if experiment.study.analysis.looks else ()
    factors = {f.name for f in experiment.study.design.factors if not f.between}
    factors |= {SESSION} if experiment.study.design.sessions else set()
    return tuple(c for c in (*ENGINE_COLUMNS, *own, *looks) if c.name not in factors)


def column_of_trial(name: str, columns: Collection[str]) -> Column:
    """Return the description of a column that a study does not describe: one that a shown scene
    added, or what its trial wrote. `columns` are all of the table.
    """
    return scene_column(name, columns) or Column(
        name, "", "written by the trial; the study describes it nowhere (columns=)"
    )


def scene_column(name: str, columns: Collection[str] | None = None) -> Column | None:
    """Return the description of a column that a shown scene adds; its ending says what it holds.

    `columns` are all of the table: None comes back where no scene was shown with whose name the
    column begins. Without them the ending alone decides.
    """
    for ending, unit, words in (
        *GAZE_ENDINGS,
        *WINDOW_ENDINGS,
        ("_film_on_ns", "ns", "session time of the first picture of a film of {}, by the browser"),
        ("_film_first_at_ms", "ms", "where in the film of {} that picture stood"),
        ("_film_pictures", "1", "pictures of the film that were shown as {}"),
        ("_film_dropped", "1", "pictures of the film of {} that no frame showed in their time"),
        (
            "_sound_error_ms",
            "ms",
            "half the range within which a browser said when the sounds of {} began",
        ),
        ("_on_ns", "ns", "session time at which the first frame that showed {} began"),
        (
            "_off_ns",
            "ns",
            "session time up to which {} counts; it stays until another is shown",
        ),
        ("_frames_dropped", "1", "frames that the browser left out while it showed {}"),
        (
            "_frames",
            "1",
            "display frames that showed {}, those included in which its last gaze "
            "samples were waited for after its end (at most 50 ms)",
        ),
    ):
        shown = name.removesuffix(ending)
        if name.endswith(ending) and (columns is None or f"{shown}_off_ns" in columns):
            return Column(name, unit, words.format(shown))
    scenes = (
        [name.partition("_")[0]]
        if columns is None
        else [c.removesuffix("_off_ns") for c in columns if c.endswith("_off_ns")]
    )
    for scene in scenes:
        role = name.removeprefix(f"{scene}_")
        if role and role != name:
            return Column(name, "", f"index of the agent that plays {role!r} in {scene}")
    return None


def of_shown(name: str, roles: Iterable[str]) -> bool:
    """Tell whether a shown scene, whatever its name, can add a column of this name."""
    endings = (
        *("_on_ns", "_off_ns", "_frames", "_frames_dropped"),
        *(ending for ending, _, _ in (*GAZE_ENDINGS, *WINDOW_ENDINGS)),
        *(f"_{role}" for role in roles),
    )
    return any(name.endswith(ending) and name != ending for ending in endings)


def people_columns(questionnaires: Sequence[Questionnaire]) -> dict[str, Column]:
    """Return the descriptions of the columns of the table of participants, by name."""
    columns = {c.name: c for c in PEOPLE}
    for questionnaire in questionnaires:
        for question in questionnaire.questions():
            name = question.question_id
            levels = {str(v): label for v, label in question.scale.options.items()}
            unit = "years" if question.scale_name == "years" else ""
            columns[name] = Column(name, unit, f"{questionnaire.name}: {question.prompt}", levels)
        for score, rule in questionnaire.scores.items():
            column = f"{questionnaire.name}_{score}"
            low, high = score_range(questionnaire, score)
            words = f"{questionnaire.title}: {rule.method} of {score.replace('_', ', ')}"
            words += "; reworded, not validated" if questionnaire.reworded else ""
            columns[column] = Column(column, "1", f"{words}, {low:g} to {high:g}")
    return columns


def block_columns(questionnaires: Sequence[Questionnaire]) -> dict[str, Column]:
    """Return the descriptions of answers and scores of questionnaires asked after blocks."""
    columns = people_columns(questionnaires)
    columns["block"] = Column("block", "1", "number of the block")
    for questionnaire in questionnaires:
        for score_name in questionnaire.scores:
            columns[score_name] = replace(
                columns[f"{questionnaire.name}_{score_name}"], name=score_name
            )
    return columns


def write_table(
    table: pd.DataFrame, descriptions: dict[str, Column], path: Path, *, scenes: bool = False
) -> tuple[Path, Path]:
    """Write a table as CSV with the JSON dictionary of its columns, as BIDS sidecars are.

    Raises:
        DataError: a column is not described.
    """
    entries: dict[str, dict[str, Any]] = {}
    for name in map(str, table.columns):
        column = descriptions.get(name)
        if column is None and scenes:
            column = column_of_trial(name, list(map(str, table.columns)))
        if column is None:
            raise DataError(f"column {name!r} of {path.name} is not described")
        entries[name] = {"Description": column.description}
        if column.unit:
            entries[name]["Units"] = column.unit
        if column.levels:
            entries[name]["Levels"] = dict(column.levels)
    escaped_columns = write_csv(table, path)
    sidecar = path.with_suffix(".json")
    sidecar.write_text(json.dumps(entries, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    note_escaped_columns(sidecar, escaped_columns)
    return path, sidecar


def undescribed_columns(columns: Iterable[str], descriptions: dict[str, Column]) -> tuple[str, ...]:
    """Return the columns that nothing describes."""
    names = list(columns)
    return tuple(c for c in names if c not in descriptions and scene_column(c, names) is None)
