"""The stare study as the command line uses it: made, measured, analysed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.gaze.quality import validate
from experiments.stare.design import QUESTIONNAIRES, STUDY, StareParameters
from experiments.stare.intake import SessionIntake, measure_parameters_of, provenance_of, take_in
from experiments.stare.study import StareStudy
from lab.config import LabConfig
from protocol.experiment import ValidationPoint, ValidationVerdict
from protocol.parameters import parameters_from
from protocol.questionnaires import Questionnaire, load_questionnaire
from protocol.shown import Shown
from recording.reader import Recording
from stimuli.scene import SceneFrame
from visavis.observer import Observer

EYES = ("combined", "left", "right")


@dataclass(frozen=True)
class StareBundle:
    """Everything the command line asks of the study."""

    name: str = STUDY
    title: str = "Stare in the crowd"

    def experiment(self, overrides: Mapping[str, Any]) -> StareStudy:
        """Return the experiment; `overrides` replace published parameters by name.

        Raises:
            ConfigError: a parameter or its value does not exist.
        """
        return StareStudy(parameters_from(StareParameters, overrides, STUDY))

    def participant(self, index: int, seed: int, *, effect: bool) -> Observer:
        """Return a simulated participant."""
        return Observer(index, seed, effect)

    def judge_validation(
        self, points: Sequence[ValidationPoint], rate_hz: float
    ) -> ValidationVerdict:
        """Measure a validation per eye; the combined eye decides."""
        return judge_validation(points, rate_hz)

    def views_of(self, shown: Shown) -> Iterator[SceneFrame]:
        """Yield the view that a frame showed."""
        yield shown.view

    def questionnaires(self, config: LabConfig) -> tuple[Questionnaire, ...]:
        """Return the questionnaires asked at the end, in the lab's wording."""
        return tuple(load_questionnaire(n, config.wording.get(n)) for n in QUESTIONNAIRES)

    def measure(self, recording: Recording) -> SessionIntake:
        """Take in one session: trials measured, answers scored, sources noted."""
        return take_in(recording, measure_parameters_of(recording.manifest.plan))

    def analyse(
        self,
        sessions: Sequence[SessionIntake],
        out_dir: Path,
        *,
        is_simulated: bool,
        commands: tuple[str, ...],
        example: Recording | None,
    ) -> Path:
        """Write tables, figures and the report of a study; return the report's path."""
        # Figures take a second to import; sessions and previews do without.
        from experiments.stare.study_outputs import analyse_study
        from experiments.stare.trial_example import example_of

        outputs = analyse_study(
            pd.concat([s.rows for s in sessions], ignore_index=True),
            pd.DataFrame([s.person for s in sessions]),
            out_dir,
            is_simulated=is_simulated,
            provenance=provenance_of(sessions, commands),
            sensitivity_rows=pd.concat([s.sensitivity for s in sessions], ignore_index=True),
            example=None if example is None else example_of(example),
            facts=sessions[0].facts,
            measures=measure_parameters_of(sessions[0].manifest.plan),
            study_parameters=sessions[0].manifest.plan["parameters"],
        )
        return outputs.report


def judge_validation(points: Sequence[ValidationPoint], rate_hz: float) -> ValidationVerdict:
    """Decide a validation by the combined eye; rows hold every point and eye."""
    rows: list[dict[str, str | int | float | bool | None]] = []
    summaries = {}
    for eye in EYES:
        measured = [(p.target, p.t_ns, getattr(p, eye)) for p in points]
        summary = validate(measured, nominal_rate_hz=rate_hz)
        summaries[eye] = summary
        for point, found in zip(points, summary.points, strict=True):
            rows.append(
                {
                    "point": point.name,
                    "eye": eye,
                    "accuracy_deg": _known(found.accuracy.of_mean_deg),
                    "mean_of_samples_deg": _known(found.accuracy.mean_of_samples_deg),
                    "right_deg": _known(found.accuracy.right_deg),
                    "up_deg": _known(found.accuracy.up_deg),
                    "rms_s2s_deg": _known(found.precision.rms_s2s_deg),
                    "std_deg": _known(found.precision.std_deg),
                    "usable_ms": found.usable_ms,
                    "lost_01": found.lost_01,
                }
            )
    combined = summaries["combined"]
    return ValidationVerdict(
        accepted=combined.passed,
        reason="" if combined.passed else _why_not(combined.accuracy_deg, combined.worst_deg),
        accuracy_deg=_known(combined.accuracy_deg),
        worst_point_deg=_known(combined.worst_deg),
        precision_deg=_known(combined.rms_s2s_deg),
        lost_01=combined.lost_01 if np.isfinite(combined.lost_01) else 1.0,
        rows=tuple(rows),
    )


def _why_not(accuracy_deg: float, worst_deg: float) -> str:
    if not np.isfinite(accuracy_deg):
        return "too little valid gaze at every target"
    return f"mean error {accuracy_deg:.2f}°, worst target {worst_deg:.2f}°, or too little gaze"


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


MAKE_STUDY = StareBundle
"""What the command line calls to get the study."""
