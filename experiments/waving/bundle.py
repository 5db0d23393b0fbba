"""The waving study as the command line uses it: made, measured, analysed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.waving.design import (
    QUESTIONNAIRES,
    STUDY,
    WavingParameters,
)
from experiments.waving.intake import (
    SessionIntake,
    provenance_of,
    questionnaire,
    take_in,
)
from experiments.waving.participant import WavingParticipant
from experiments.waving.redrawing import views_of
from experiments.waving.study import WavingStudy
from lab.config import LabConfig
from lab.errors import ConfigError
from protocol.experiment import ValidationPoint, ValidationVerdict
from protocol.parameters import parameters_from
from protocol.questionnaires import Questionnaire
from protocol.shown import Shown
from recording.reader import Recording
from stimuli.scene import SceneFrame


@dataclass(frozen=True)
class WavingBundle:
    """Everything the command line asks of the study."""

    name: str = STUDY
    title: str = "Waving at whom?"

    def experiment(self, overrides: Mapping[str, Any]) -> WavingStudy:
        """Return the experiment; `overrides` replace parameters by name.

        Raises:
            ConfigError: a parameter or its value does not exist.
        """
        return WavingStudy(parameters_from(WavingParameters, overrides, STUDY))

    def participant(
        self, index: int, seed: int, *, effect: bool, experiment: object = None
    ) -> WavingParticipant:
        """Return a simulated participant."""
        return WavingParticipant(index, seed, effect)

    def judge_validation(
        self, points: Sequence[ValidationPoint], rate_hz: float
    ) -> ValidationVerdict:
        """Accept: gaze is recorded along, but nothing here is measured by it."""
        return ValidationVerdict(
            True, "gaze is not measured in this study", None, None, None, 0, ()
        )

    def views_of(self, shown: Shown) -> Iterator[SceneFrame]:
        """Yield the views that a frame may have shown, the likeliest first."""
        return views_of(shown)

    def questionnaires(self, config: LabConfig) -> tuple[Questionnaire, ...]:
        """Return the questionnaires asked at the end, in the lab's wording."""
        return tuple(questionnaire(n, config.wording.get(n)) for n in QUESTIONNAIRES)

    def measure(self, recording: Recording) -> SessionIntake:
        """Take in one session."""
        return take_in(recording)

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
        from experiments.waving.study_outputs import analyse_study

        if settings:
            raise ConfigError(f"waving cannot be analysed with {', '.join(settings)} set")
        return analyse_study(
            sessions,
            out_dir,
            is_simulated=is_simulated,
            provenance=provenance_of(sessions, commands),
        )


MAKE_STUDY = WavingBundle
"""What the command line calls to get the study."""
