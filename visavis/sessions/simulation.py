"""Simulate and measure many sessions on all cores."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lab.config import LabConfig
from recording.folder import session_dir
from recording.reader import Recording
from visavis.catalogue import find_study
from visavis.opened import OpenedStudy
from visavis.sessions.perform import perform_new, perform_rest, simulated_request


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


def worker_count(asked: int | None) -> int:
    """Return how many processes to use: as asked, or one per usable core."""
    if asked is not None:
        return max(asked, 1)
    cores: int | None
    if sys.platform == "linux":
        cores = len(os.sched_getaffinity(0))
    else:
        cores = os.cpu_count()
    return cores or 1


def simulate_one(task: SimulationTask) -> Path:
    """Simulate one participant's session, or what is left of it; return its folder."""
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
    )
    path = session_dir(task.config.data_root, study.name, task.label, 1, is_simulated=True)
    return perform_rest(request, path) if path.exists() else perform_new(request)


def measure_one(job: tuple[str, Path, Mapping[str, Any]]) -> Any:
    """Take in one session of a study; what comes back is for the study's `analyse`."""
    reference, session, settings = job
    study = find_study(reference)
    if isinstance(study, OpenedStudy):
        return study.measure(Recording(session), settings)
    return study.measure(Recording(session))


def in_parallel(
    work: Callable[..., Any], jobs: list[tuple[Any, ...]], processes: int
) -> Iterator[tuple[int, Any]]:
    """Yield (job number, result) as they finish; with one process, here and in order.

    Whatever ends this ends the other processes, too: they hear of no signal themselves.
    """
    if processes == 1 or len(jobs) <= 1:
        for number, job in enumerate(jobs):
            yield number, work(*job)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(
        min(processes, len(jobs)), mp_context=context, initializer=_leave_signals_to_parent
    ) as pool:
        numbers: dict[Future[Any], int] = {pool.submit(work, *j): i for i, j in enumerate(jobs)}
        try:
            for future in as_completed(numbers):
                yield numbers[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


def _leave_signals_to_parent() -> None:
    """Let Ctrl-C, which reaches a terminal's whole group, end work by way of the parent alone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
