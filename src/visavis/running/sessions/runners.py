"""Run jobs on this machine's cores or on a Dask scheduler."""

import importlib
import multiprocessing
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from multiprocessing.process import BaseProcess
from typing import Any, TypeAlias, TypeVar

from visavis.lab.errors import UsageError
from visavis.lab.processes import begin_worker, main_unseen, needs_main
from visavis.recording.provenance import provenance

Job = TypeVar("Job")
Result = TypeVar("Result")
Versions: TypeAlias = tuple[tuple[str, str], ...]

CONNECT_S = 10
LIBRARY_MISSING = (
    "--scheduler needs Dask's distributed scheduler, which is not installed here; install it "
    "with: pip install 'visavis[cluster]' (or leave --scheduler out to use this machine's cores)"
)


def on_this_machine(
    work: Callable[[Job], Result], jobs: list[Job], processes: int
) -> Iterator[tuple[int, Result]]:
    """Yield (job number, result) as they finish; with one process, here and in order.

    Works from a script as it stands, a notebook or a terminal; where no process can be begun, jobs
    are done here, with a warning. An error or a signal here ends the other processes, which ignore
    signals themselves.

    Raises:
        KeyboardInterrupt: this process was interrupted, or the others were asked to end (SIGTERM).
        UsageError: one of them was killed, for example for lack of memory.
    """
    if processes == 1 or len(jobs) <= 1:
        for number, job in enumerate(jobs):
            yield number, work(job)
        return
    reason = _why_no_process()
    if reason:
        warnings.warn(
            f"{reason}: {len(jobs)} jobs are done one after another in this process", stacklevel=2
        )
        yield from on_this_machine(work, jobs, 1)
        return
    workers: list[BaseProcess] = []
    try:
        with ProcessPoolExecutor(
            min(processes, len(jobs)),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=begin_worker,
            initargs=(work.__module__,),
        ) as pool:
            try:
                with main_unseen(not needs_main(work, jobs[0])):
                    numbers: dict[Future[Result], int] = {
                        pool.submit(work, j): i for i, j in enumerate(jobs)
                    }
                workers += multiprocessing.active_children()
                for future in as_completed(numbers):
                    yield numbers[future], future.result()
            except BrokenProcessPool:  # the pool ends the others itself, and waits for them
                raise
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for worker in multiprocessing.active_children():
                    worker.terminate()
                raise
    except BrokenProcessPool as pool_error:
        # A signal to the whole group may appear here first as a broken pool. The pool ends the
        # rest by SIGTERM, so a process that was killed otherwise has another exit code.
        if workers and all(worker.exitcode == -signal.SIGTERM for worker in workers):
            raise KeyboardInterrupt from pool_error
        raise UsageError(
            "a worker process was killed from outside, mostly for lack of memory; give "
            "the command again with a smaller --processes"
        ) from pool_error


def _why_no_process() -> str:
    """Return why no process can be begun from here; "" where one can."""
    if multiprocessing.current_process().daemon:
        return "a worker process may not begin others"
    if not sys.executable:
        return "Python is embedded in another program"
    try:
        multiprocessing.get_context("spawn").SimpleQueue().close()
    except (ImportError, OSError) as error:  # no semaphores, as in some containers
        return f"this machine lets no process share anything ({error})"
    return ""


def on_scheduler(
    work: Callable[[Job], Result], jobs: list[Job], address: str
) -> Iterator[tuple[int, Result]]:
    """Yield (job number, result) as a Dask scheduler's workers finish them.

    Results are those of `on_this_machine`: a job holds everything it depends on. Raises a
    UsageError when the library or the scheduler is missing, no worker is there, or a worker has
    another version of Visavis or of what it computes with.
    """
    try:
        dask: Any = importlib.import_module("distributed")
    except ImportError:
        raise UsageError(LIBRARY_MISSING) from None
    with ExitStack() as stack:
        try:
            client = stack.enter_context(
                dask.Client(address, timeout=CONNECT_S, set_as_default=False)
            )
        except (TimeoutError, OSError, ValueError) as error:
            raise UsageError(
                f"no Dask scheduler answers at {address} ({error}); start one with "
                "`dask scheduler` and give the address it prints, such as tcp://10.0.0.5:8786"
            ) from error
        refuse_other_versions(versions(), _versions_of_workers(client, address))
        futures = {client.submit(work, job, pure=False): n for n, job in enumerate(jobs)}
        try:
            for future in dask.as_completed(list(futures), loop=client.loop):
                yield futures[future], future.result()
        except dask.scheduler.KilledWorker as error:
            raise UsageError(
                f"workers of {address} died of a job ({error}); look at their logs, give them "
                "more memory, or run on this machine without --scheduler"
            ) from error
        finally:
            client.cancel(list(futures))


def versions() -> Versions:
    """Return what must be equal on every worker for equal numbers."""
    here = provenance()
    packages = [(name, here.packages[name]) for name in ("visavis", "numpy", "scipy", "numba")]
    return (*packages, ("code revision", here.code_revision))


def _versions_of_workers(client: Any, address: str) -> dict[str, Versions]:
    try:
        worker_versions: dict[str, Versions] = client.run(versions)
    except ImportError as error:
        raise UsageError(
            f"the workers of {address} cannot import Visavis ({error}); install the same version "
            "there and start them again"
        ) from error
    if not worker_versions:
        raise UsageError(
            f"the scheduler at {address} has no workers; start some with `dask worker {address}`"
        )
    return worker_versions


def refuse_other_versions(here: Versions, workers: Mapping[str, Versions]) -> None:
    """Raise UsageError naming the first worker whose versions differ from these."""
    for worker, theirs in sorted(workers.items()):
        for (name, mine), (_, other) in zip(here, theirs, strict=True):
            if mine != other:
                raise UsageError(
                    f"worker {worker} has {name} {other or 'unknown'}, here it is "
                    f"{mine or 'unknown'}; install the same version, or numbers would depend on "
                    "who computed them"
                )
