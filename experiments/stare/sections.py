"""Further sections of the stare study's report, after the standard ones."""

from dataclasses import dataclass
from typing import Final

import pandas as pd

from visavis.analysis.plots import draw
from visavis.analysis.report import Block, Bullets, Fold, Paragraph, Section
from visavis.analysis.report.notation import count_of, percentage
from visavis.experiments.stare import published
from visavis.experiments.stare.design import DYNAMIC_CONDITIONS
from visavis.experiments.stare.figures_places import place_figure
from visavis.experiments.stare.trial_example import TOLERANCE_MS, example_of, trial_figure
from visavis.lab.clock import NS_PER_MS
from visavis.results.analysis import StudyAnalysis
from visavis.results.report.study_report import picture_of
from visavis.study.experiment import StudyExperiment
from visavis.study.look_measures import FIRST_FIXATION_DURATION_MS, FIRST_FIXATION_TIME_MS
from visavis.study.sections import Extra

_REQUIRED_COLUMNS: Final = (
    "condition",
    "switch_cause",
    "look_ns",
    "t_start_ns",
    FIRST_FIXATION_TIME_MS,
    FIRST_FIXATION_DURATION_MS,
)


def places_figure(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return the figure of the tests by place: dwell time on the seating plan."""
    figure = draw(
        "places",
        lambda: place_figure(analysis),
        title="Dwell time by the active agent's place",
        caption="Left and middle: mean dwell time in ms when the agent at this place is "
        "active. Right: directed minus averted, with stars where significant (.05, .01, .001 "
        "over the places). Grey: places that are never active. Top: from above, the "
        "triangle is the participant. Bottom: the heads as the participant sees them.",
        alternative="Seating plan from above and from the participant's view, coloured by "
        "dwell time.",
        is_simulated=analysis.is_simulated,
    )
    return Extra(figures=(figure,))


@dataclass(frozen=True)
class GazeChanges:
    """How many trials of AD and DA changed by a look and by time alone.

    `began_fixation` of the `by_look` changes fell into the first fixation on the active agent;
    the others were caused by a glance shorter than a fixation.
    """

    by_look: int
    by_time: int
    began_fixation: int

    @property
    def share_01(self) -> float:
        """Share of look-caused changes that began a fixation; NaN without any."""
        return self.began_fixation / self.by_look if self.by_look else float("nan")

    def sentence(self) -> str:
        """Return the counts in words."""
        total = self.by_look + self.by_time
        if not total:
            return "No trial with a change of the agent's gaze was analysed."
        text = (
            f"In {self.by_look} of {count_of(total, 'trial')} with averted-then-directed or "
            "directed-then-averted gaze a look caused the change"
        )
        if not self.by_look:
            return f"{text}; in the others time did."
        return (
            f"{text}; {self.began_fixation} of these {self.by_look} looks "
            f"({percentage(self.share_01, 0)}) were fixations on the active agent, the others "
            "glances."
        )


def gaze_changes(rows: pd.DataFrame) -> GazeChanges | None:
    """Count the changes of finished trials; None when the table does not say what caused them."""
    if any(name not in rows for name in _REQUIRED_COLUMNS):
        return None
    changing = rows[rows["condition"].isin(DYNAMIC_CONDITIONS)]
    by_look = changing[changing["switch_cause"] == "look"]
    look_ms = (by_look["look_ns"].astype(float) - by_look["t_start_ns"].astype(float)) / NS_PER_MS
    onset_ms = by_look[FIRST_FIXATION_TIME_MS].astype(float)
    end_ms = onset_ms + by_look[FIRST_FIXATION_DURATION_MS].astype(float)
    began = (look_ms >= onset_ms - TOLERANCE_MS) & (look_ms <= end_ms + TOLERANCE_MS)
    return GazeChanges(
        len(by_look), int((changing["switch_cause"] == "time").sum()), int(began.sum())
    )


def changes_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return what made agents' gaze change, with one trial, and what does not fit in the source."""
    blocks: list[Block] = []
    changes = gaze_changes(analysis.selection.counted)
    if changes is not None:
        blocks.append(Paragraph(changes.sentence()))
    if not float(experiment.parameters["look_trigger_ms"]):
        blocks.append(
            Paragraph(
                "One gaze sample on the active agent's head changes its gaze at once, so a saccade "
                "that passes over the head is enough: this platform's reading of “first looked at”."
            )
        )
    rules = analysis.study.analysis.looks[0].rules({"parameters": experiment.parameters})
    example = None if analysis.example is None else example_of(analysis.example, rules)
    figures = (
        () if example is None else (trial_figure(example, is_simulated=analysis.is_simulated),)
    )
    blocks += [picture_of(d) for d in figures]
    slips = tuple(f"{slip.where}: {slip.what}." for slip in published.INCONSISTENCIES)
    blocks.append(Fold("What does not fit in the published numbers", (Bullets(slips),)))
    return Extra(Section("changes", "Changes of gaze", tuple(blocks)), figures)
