"""Studies of the tests, simulated at low rates on the virtual clock."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.faults.sessions import lab
from visavis.lab.config import LabConfig, load_config
from visavis.protocol.session.operator import Operator
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import Request, simulated_request

STUDIES = Path(__file__).parent / "studies"
SHORT_STARE = [
    f"--set={one}" for one in ("trial_s=1", "intertrial_s=0.5", "practice_s=1", "repetitions=1")
]
"""Words of a command that make a session of stare short: 36 trials of a second, one of practice."""


def opened(name: str) -> OpenedStudy:
    """Return a study of the tests by name, or any by the path of its file."""
    found = find_study(name if name.endswith(".py") else str(STUDIES / f"{name}.py"))
    assert isinstance(found, OpenedStudy)
    return found


def lab_in(folder: Path, example: Path, show: str = "") -> LabConfig:
    """Return a lab of an example whose sessions lie in a folder; it shows them as it says."""
    config = load_config(example)
    display = config.display.model_copy(update={"show": show or config.display.show})
    roots = {"data_root": folder / "data", "key_root": folder / "keys"}
    return config.model_copy(update={**roots, "display": display})


def request_in(folder: Path, study: Any, example: Path, show: str = "") -> Request:
    """Return the request of the first participant's simulated session in such a lab."""
    config = lab_in(folder, example, show)
    return simulated_request(study, study.experiment({}), config, label="S01", index=0, seed=1)


def perform(
    name: str,
    data_root: Path,
    index: int = 0,
    *,
    effect: bool = True,
    operator: Operator | None = None,
    **parameters: Any,
) -> Recording:
    """Simulate one participant of a study and return what was recorded."""
    study = opened(name)
    request = simulated_request(
        study,
        study.experiment(parameters),
        lab(data_root),
        label=f"S{index + 1:02d}",
        index=index,
        seed=1,
        effect=effect,
    )
    return Recording(perform_new(replace(request, operator=operator or request.operator)))
