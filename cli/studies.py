"""The studies the command line knows, each imported only when it is used."""

import difflib
import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, cast, runtime_checkable

from lab.config import LabConfig
from lab.errors import UsageError
from protocol.experiment import Experiment, ValidationPoint, ValidationVerdict
from protocol.participants import SimulatedParticipant
from protocol.questionnaires import Questionnaire
from protocol.shown import Shown
from recording.reader import Recording
from stimuli.scene import SceneFrame

STUDY_MODULES = {
    "stare": "experiments.stare.bundle",
    "crowd": "experiments.crowd.bundle",
    "waving": "experiments.waving.bundle",
}


class Study(Protocol):
    """What every study module offers to the command line."""

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        ...

    @property
    def title(self) -> str:
        """The study's name in a heading."""
        ...

    def experiment(self, overrides: Mapping[str, Any]) -> Experiment:
        """Return the experiment; `overrides` replace published parameters by name."""
        ...

    def participant(self, index: int, seed: int, *, effect: bool) -> SimulatedParticipant:
        """Return a simulated participant."""
        ...

    def judge_validation(
        self, points: Sequence[ValidationPoint], rate_hz: float
    ) -> ValidationVerdict:
        """Measure a validation and decide."""
        ...

    def questionnaires(self, config: LabConfig) -> tuple[Questionnaire, ...]:
        """Return the questionnaires asked at the end, in the lab's wording."""
        ...

    def measure(self, recording: Recording) -> Any:
        """Take in one session; the result can travel between processes."""
        ...

    def analyse(
        self,
        sessions: Sequence[Any],
        out_dir: Path,
        *,
        is_simulated: bool,
        commands: tuple[str, ...],
        example: Recording | None,
    ) -> Path:
        """Write tables, figures and the report of a study; return the report's path."""
        ...


@runtime_checkable
class PiecewiseStudy(Protocol):
    """A study whose sessions take long to measure: trial by trial, kept in a store."""

    def measure_all(
        self,
        sessions: Sequence[Path],
        store: Path,
        run: Any,
        on_walk: Callable[[int, int], None],
        settings: Mapping[str, Any],
    ) -> list[Any]:
        """Take in sessions; `run` does jobs anywhere, `on_walk` is told how many are done.

        `settings` say how to measure, by name.
        """
        ...


@runtime_checkable
class RedrawableStudy(Protocol):
    """A study whose frames can be rebuilt from the recording alone."""

    def views_of(self, shown: Shown) -> Iterator[SceneFrame]:
        """Yield the views that a recorded frame may have shown, the likeliest first."""
        ...


def find_study(name: str) -> Study:
    """Return a study by name.

    Raises:
        UsageError: unknown, with the nearest name.
    """
    if name not in STUDY_MODULES:
        near = difflib.get_close_matches(name, STUDY_MODULES, n=1, cutoff=0.3)
        hint = f"; did you mean {near[0]}?" if near else "."
        raise UsageError(f"there is no study {name!r}{hint} Known: {', '.join(STUDY_MODULES)}")
    module = importlib.import_module(STUDY_MODULES[name])
    make = cast(Callable[[], Study], module.MAKE_STUDY)
    return make()
