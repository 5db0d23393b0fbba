"""The crowd study as the command line uses it: made, measured, analysed."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.crowd.design import QUESTIONNAIRES, STUDY, CrowdParameters
from experiments.crowd.intake import SessionIntake, take_in
from experiments.crowd.measures import measure_parameters
from experiments.crowd.measuring import Runner, measure_sessions
from experiments.crowd.participant.participant import CrowdParticipant
from experiments.crowd.redrawing import views_of
from experiments.crowd.study import CrowdStudy
from lab.config import LabConfig
from protocol.experiment import ValidationPoint, ValidationVerdict
from protocol.parameters import parameters_from
from protocol.questionnaires import Questionnaire, load_questionnaire
from protocol.shown import Shown
from recording.reader import Recording
from stimuli.scene import SceneFrame


@dataclass(frozen=True)
class CrowdBundle:
    """Everything the command line asks of the study."""

    name: str = STUDY
    title: str = "Through the crowd"

    def experiment(self, overrides: Mapping[str, Any]) -> CrowdStudy:
        """Return the experiment; `overrides` replace published parameters by name.

        Raises:
            ConfigError: a parameter or its value does not exist.
        """
        return CrowdStudy(parameters_from(CrowdParameters, overrides, STUDY))

    def participant(
        self, index: int, seed: int, *, effect: bool, experiment: object = None
    ) -> CrowdParticipant:
        """Return a simulated participant."""
        return CrowdParticipant(index, seed, effect)

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
        """Return the questionnaires asked after blocks and at the end, in the lab's wording."""
        return tuple(load_questionnaire(n, config.wording.get(n)) for n in QUESTIONNAIRES)

    def measure(self, recording: Recording) -> SessionIntake:
        """Take in one session: trials measured from the recording alone, answers scored."""
        return take_in(recording)

    def measure_all(
        self,
        sessions: Sequence[Path],
        store: Path,
        run: Runner,
        on_walk: Callable[[int, int], None],
        settings: Mapping[str, Any],
    ) -> list[SessionIntake]:
        """Take in sessions walk by walk; what `store` holds already is not measured again.

        `settings` are fields of `MeasureParameters` by name.

        Raises:
            ConfigError: a setting or its value does not exist.
        """
        params = measure_parameters(settings)
        return measure_sessions(sessions, store, run, params=params, on_walk=on_walk)

    def write_film(
        self,
        recording: Recording,
        trial_id: str,
        video: Path,
        *,
        size_px: tuple[int, int],
        rate_hz: int,
        seconds: float | None,
        on_frame: Callable[[int, int], None] | None,
    ) -> int:
        """Write the film of a walk from above, contacts lit; return its number of pictures."""
        from experiments.crowd.film import write_film

        return write_film(
            recording, trial_id, video, size_px=size_px, rate_hz=rate_hz, seconds=seconds,
            on_frame=on_frame,
        )  # fmt: skip

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
        from experiments.crowd.study_outputs import analyse_study

        return analyse_study(sessions, out_dir, is_simulated=is_simulated, commands=commands)


MAKE_STUDY = CrowdBundle
"""What the command line calls to get the study."""
