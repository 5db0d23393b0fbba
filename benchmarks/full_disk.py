"""Let the disk run full at each of a session's first writes, resume it, and check what is left.

python -m benchmarks.full_disk [--first 1] [--writes 200] [--every 1] [--json] [--seed 1]

A short stare session in a headset and a session of the interpolation study on a page, both on the
virtual clock. At the k-th write below the data root, and by turns: the disk takes half of it and
is full from then on; takes nothing and is full from then on; or refuses this write alone. Then
there is room again: the session is resumed, recovered where every trial was done, or begun anew
where it had no folder yet. `red`
counts sessions whose check is not green of what is recorded, `lost` acknowledged trials that are
gone, `stuck` sessions that could not be finished, `listed` studies whose list of sessions
would stop an analysis. A session costs about half a second of a processor; `--first 101` goes on
where `--writes 100` ended.
"""

import argparse
import errno
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.kill_resume import SHORT, TIMING, ShortStudy, fast_config
from visavis.analysis.session_check import check_session
from visavis.analysis.session_verdict import Level
from visavis.lab.errors import LabError
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.recording.recovery import recover
from visavis.results.opened_study import find_study
from visavis.running.page.perform import perform_new as perform_new_on_page
from visavis.running.page.perform import perform_rest as perform_rest_on_page
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_list import require_whole
from visavis.running.sessions.session_request import Request, simulated_request

PLACES = ("headset", "page")
STUDY_OF = {"headset": "stare", "page": "interpolation"}
FAILURES = ("half a write, then full", "full", "one write")


@dataclass
class Outcome:
    """What the full disks cost; everything but `sessions` should be 0."""

    sessions: int = 0
    red: int = 0
    lost: int = 0
    stuck: int = 0
    listed: int = 0

    @property
    def is_clean(self) -> bool:
        """Tell whether nothing was lost, and everything is green."""
        return not (self.red or self.lost or self.stuck or self.listed)


@contextmanager
def full_disk(at: int, failure: str) -> Iterator[None]:
    """Let the k-th write of durable files fail, from 1; `failure` is one of FAILURES."""
    real: Callable[..., int] = os.write
    n = 0

    def write(fd: int, data: Any) -> int:
        nonlocal n
        n += 1
        if n == at and failure.startswith("half") and len(data) > 1:
            return real(fd, data[: len(data) // 2])
        if n == at or (n > at and failure != "one write"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(fd, data)

    os.write = write  # put back below
    try:
        yield
    finally:
        os.write = real


def request_of(place: str, root: Path, on_trial: Callable[[str, int, int], None]) -> Request:
    """Return a short session at a place."""
    config = fast_config().model_copy(update={"data_root": root, "key_root": root.parent / "keys"})
    study = find_study(STUDY_OF[place])
    experiment = (
        study.experiment({})
        if place == "page"
        else ShortStudy(study.study, SHORT[STUDY_OF[place]].parameters)
    )
    request = simulated_request(
        study, experiment, config, label="S01", index=0, seed=1, on_trial=on_trial
    )
    return request if place == "page" else replace(request, timing=TIMING)


def fill_up(place: str, at: int, failure: str, root: Path, outcome: Outcome) -> str:
    """Perform a session on a disk that runs full, and the rest; return what is wrong with it."""
    data_root = root / "data"
    acknowledged: set[str] = set()

    def note(trial_id: str, _done: int, _planned: int) -> None:
        acknowledged.add(trial_id)

    new, rest = (
        (perform_new_on_page, perform_rest_on_page)
        if place == "page"
        else (perform_new, perform_rest)
    )
    outcome.sessions += 1
    try:
        with full_disk(at, failure):
            new(request_of(place, data_root, note))
    except LabError:
        pass
    path = session_dir(data_root, STUDY_OF[place], "S01", 1, is_simulated=True)
    finished_trials = set(acknowledged)
    try:
        if not path.exists():
            new(request_of(place, data_root, note))
        elif Recording(path).status != "complete":
            rest(request_of(place, data_root, note), path)
        else:
            recover(path)
    except LabError as error:
        outcome.stuck += 1
        return str(error)
    recording = Recording(path)
    trials = recording.trials()
    lost = finished_trials - set(map(str, trials["trial_id"]))
    findings = check_session(recording).findings
    red = [f.message for f in findings if f.level is Level.RED]
    red += [f.message for f in findings if f.subject == "recording" and f.level is not Level.GREEN]
    listed = []
    try:
        require_whole(path.parent.parent, accept=False)
    except LabError as error:
        listed.append(str(error))
    outcome.lost += len(lost)
    outcome.red += bool(red)
    outcome.listed += bool(listed)
    return "; ".join([*sorted(lost), *red, *listed])


def measure(place: str, writes: Sequence[int], seed: int, root: Path) -> tuple[Outcome, list[str]]:
    """Return what disks that run full at these writes cost, and what was wrong, a line each."""
    outcome, wrong = Outcome(), []
    for at in writes:
        failure = FAILURES[(at + seed) % len(FAILURES)]
        with tempfile.TemporaryDirectory(dir=root) as folder:
            text = fill_up(place, at, failure, Path(folder), outcome)
        if text:
            wrong.append(f"{place}, write {at} ({failure}): {text}")
    return outcome, wrong


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 1 if anything was lost or is red."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--first", type=int, default=1, help="the write to begin with")
    parser.add_argument("--writes", type=int, default=200, help="the write to end with")
    parser.add_argument("--every", type=int, default=1, help="only each so many")
    parser.add_argument("--seed", type=int, default=1, help="which failure comes first")
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    chosen = parser.parse_args(arguments)
    writes = range(chosen.first, chosen.writes + 1, chosen.every)
    results: dict[str, Outcome] = {}
    with tempfile.TemporaryDirectory() as root:
        for place in PLACES:
            results[place], wrong = measure(place, writes, chosen.seed, Path(root))
            for line in wrong:
                print(line, file=sys.stderr)
    if chosen.json:
        print(json.dumps({place: asdict(outcome) for place, outcome in results.items()}))
    else:
        print(f"{'':10}{'sessions':>10}{'red':>6}{'lost':>6}{'stuck':>7}{'listed':>8}")
        for place, r in results.items():
            print(f"{place:10}{r.sessions:>10}{r.red:>6}{r.lost:>6}{r.stuck:>7}{r.listed:>8}")
    return 0 if all(outcome.is_clean for outcome in results.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
