"""The stare study as the command line uses it: made, measured, analysed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.stare.analysis_parameters import AnalysisParameters
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
from stimuli.scenes.audience import DRESSED_BY
from visavis.observer import Observer
from visavis.validation import judge_validation


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

    def participant(
        self, index: int, seed: int, *, effect: bool, experiment: object = None
    ) -> Observer:
        """Return a simulated participant."""
        return Observer(index, seed, effect)

    def judge_validation(
        self, points: Sequence[ValidationPoint], rate_hz: float
    ) -> ValidationVerdict:
        """Measure a validation per eye; the combined eye decides."""
        return judge_validation(points, rate_hz)

    def views_of(self, shown: Shown) -> Iterator[SceneFrame]:
        """Yield the view that a frame showed."""
        yield replace(shown.view, scene=replace(shown.view.scene, dressed_by=DRESSED_BY))

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
        settings: Mapping[str, Any] | None = None,
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
            parameters=parameters_from(AnalysisParameters, settings or {}, f"analysis of {STUDY}"),
            facts=sessions[0].facts,
            measures=measure_parameters_of(sessions[0].manifest.plan),
            study_parameters=sessions[0].manifest.plan["parameters"],
        )
        return outputs.report


MAKE_STUDY = StareBundle
"""What the command line calls to get the study."""
