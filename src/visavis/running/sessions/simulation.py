"""Simulate and measure one of many sessions, in any process."""

import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from visavis.lab.compile_ahead import compile_kernel, read_list
from visavis.lab.config import LabConfig
from visavis.lab.garbage import collecting_seldom
from visavis.recording.folder import session_dir
from visavis.recording.integrity import DamageReport, adopt_report, confirm_report
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import simulated_request
from visavis.study.cast import use_cast_of, use_recorded_cast
from visavis.study.experiment import StudyExperiment
from visavis.study.study_errors import users_mistakes

KERNEL_LIST: Final = Path(__file__).with_name("kernels.txt")
"""What is compiled before sessions of a study are simulated or measured."""


@dataclass(frozen=True)
class SimulationTask:
    """One participant to simulate; `study` is its name, or its file."""

    study: str
    config: LabConfig
    label: str
    index: int
    group: str
    seed: int
    effect: bool
    parameters: dict[str, Any]
    session: int = 1


def worker_count(processes: int | None) -> int:
    """Return how many processes to use: as asked, or one per usable core."""
    if processes is not None:
        return max(processes, 1)
    cores: int | None
    if sys.platform == "linux":
        cores = len(os.sched_getaffinity(0))
    else:
        cores = os.cpu_count()
    return cores or 1


@collecting_seldom()
def simulate_one(task: SimulationTask) -> Path:
    """Simulate one participant's session, or what is left of it; return its folder."""
    use_cast_of(task.config)
    study = find_study(task.study)
    request = simulated_request(
        study,
        study.experiment(task.parameters),
        task.config,
        label=task.label,
        index=task.index,
        seed=task.seed,
        effect=task.effect,
        group=task.group,
        session=task.session,
    )
    root = task.config.data_root
    path = session_dir(root, study.name, task.label, task.session, is_simulated=True)
    return perform_rest(request, path) if path.exists() else perform_new(request)


def kernels_of(experiment: StudyExperiment, phase: str) -> tuple[str, ...]:
    """Return what sessions of a study call, to be compiled before them.

    A study that is not listed and rests on gaze calls what stare does, and perhaps more; of others
    nothing is known.
    """
    own = read_list(KERNEL_LIST, experiment.name, phase)
    return own or (read_list(KERNEL_LIST, "stare", phase) if experiment.rests_on_gaze else ())


def make_ready(kernel: str) -> None:
    """Compile a kernel, or load it, where its line is as the code is now.

    What cannot be compiled here is compiled when it is called, and an error is an error then.
    """
    with suppress(Exception):
        compile_kernel(kernel)


def do_job(job: tuple[Callable[[Any], Any], Any]) -> Any:
    """Call a function with one argument, in any process.

    Errors in a user's file are told here: another process gets them without their traceback.
    """
    function, argument = job
    with users_mistakes():
        return function(argument)


@dataclass(frozen=True)
class MeasuringTask:
    """One session to measure; `damage` is what was found of it before, where it was looked at."""

    study: str
    session: Path
    settings: Mapping[str, Any] = field(default_factory=dict)
    damage: DamageReport | None = None


@collecting_seldom()
def measure_one(task: MeasuringTask) -> Any:
    """Take in one session of a study; what comes back is for the study's `analyse`."""
    recording = Recording(task.session)
    if task.damage is not None:
        adopt_report(recording, task.damage)
    use_recorded_cast(recording)
    intake = find_study(task.study).measure(recording, task.settings)
    confirm_report(recording)
    return intake
