"""The crowd study as the command line uses it: declared on the kit, measured by its own rules."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final

from experiments.crowd.analysis_parameters import RULES, AnalysisParameters
from experiments.crowd.intake import SessionIntake, take_in
from experiments.crowd.measures import MeasureParameters, measure_parameters
from experiments.crowd.measuring import Runner, measure_sessions
from experiments.crowd.study import study
from protocol.parameters import parameters_from
from recording.reader import Recording
from visavis.exclusions import limits_in_force
from visavis.opened import OpenedStudy
from visavis.study import Study

MEASURED_BY: Final = frozenset(f.name for f in fields(MeasureParameters))


@dataclass(frozen=True, eq=False)
class CrowdBundle(OpenedStudy):
    """The declared study with measures and an analysis of its own."""

    study: Study = field(default_factory=lambda: study)

    def measure(  # type: ignore[override]  # its tables are not the kit's yet
        self, recording: Recording
    ) -> SessionIntake:
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

        `settings` are fields of `MeasureParameters` and of `AnalysisParameters`, and limits of
        rules of exclusion, by name.

        Raises:
            ConfigError: a setting or its value does not exist.
        """
        _thresholds(settings)  # said before anything is measured
        params = measure_parameters({k: v for k, v in settings.items() if k in MEASURED_BY})
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

    def analyse(  # type: ignore[override]  # as above
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

        parameters, limits = _thresholds(settings or {})
        return analyse_study(
            sessions,
            out_dir,
            is_simulated=is_simulated,
            commands=commands,
            parameters=parameters,
            limits=limits,
        )


def _thresholds(settings: Mapping[str, Any]) -> tuple[AnalysisParameters, dict[str, Any]]:
    """Return thresholds of tests and limits of rules among settings of the analysis."""
    rules = {rule.name for rule in RULES}
    limits = {k: v for k, v in settings.items() if k in rules}
    limits_in_force(RULES, limits)
    rest = {k: v for k, v in settings.items() if k not in rules | MEASURED_BY}
    return parameters_from(AnalysisParameters, rest, "analysis of crowd"), limits


MAKE_STUDY = CrowdBundle
"""What the command line calls to get the study."""
