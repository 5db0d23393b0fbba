"""A made-up crowd study analysed by the kit, and what tests ask of it."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import pandas as pd

from visavis.experiments.crowd.design import CONTROL_GROUP, GROUPS, HAPTICS_GROUP
from visavis.experiments.crowd.measures import DEFAULT_MEASURES, MeasureParameters
from visavis.experiments.crowd.study import study
from visavis.recording.reader import Recording
from visavis.results.analysis import StudyAnalysis
from visavis.results.intake import SessionIntake
from visavis.results.opened_study import OpenedStudy

OPENED: Final = OpenedStudy(study)
QUICK: Final = {"n_permutations": 49, "n_splits": 10}


def analysed(
    tables: Mapping[str, pd.DataFrame],
    *,
    planned: int | None = None,
    everybody: Sequence[str] = (),
    parameters: Mapping[str, Any] | None = None,
    **settings: Any,
) -> StudyAnalysis:
    """Return the analysis of tables of walks; `planned` walks a block (as many as were walked).

    A control group is in the design where somebody belongs to it.
    """
    trials = tables["trials"]
    groups = [g for g in GROUPS if g == HAPTICS_GROUP or (trials["group"] == CONTROL_GROUP).any()]
    experiment = OPENED.experiment({"group": groups, **(parameters or {})})
    blocks = len(experiment.levels["condition"])
    walked = trials.groupby(["participant", "condition"]).size()
    per_block = int(walked.max()) if planned is None else planned
    people = sorted({*trials["participant"], *everybody})
    return OPENED.analysis_of_rows(
        experiment,
        trials,
        pd.DataFrame({"participant": people}),
        planned_counts=dict.fromkeys(people, per_block * blocks),
        settings={**QUICK, **settings},
        tables={k: v for k, v in tables.items() if k != "trials"},
    )


def measured(
    recording: Recording, how: MeasureParameters = DEFAULT_MEASURES
) -> tuple[SessionIntake, list[dict[str, Any]]]:
    """Take in a session; return it with the rows of the walks that were measured."""
    taken = OPENED.measure(recording, {"rule": how.rule, "surface": how.surface})
    lost = taken.rows.get("lost_01")  # no column where no walk could be measured
    rows = [] if lost is None else taken.rows[lost.notna()].to_dict("records")
    return taken, [{str(k): v for k, v in row.items()} for row in rows]
