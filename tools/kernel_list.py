"""Write `src/visavis/running/sessions/kernels.txt`: what is compiled before a study is simulated.

    python -m tools.kernel_list [stare]

A few trials of each study are simulated and measured in processes of their own: with nothing
compiled, which tells how long each kernel takes, and again, which tells the kernels that Python
calls. A test fails when sessions call one that the list lacks.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

from visavis.cli.app import load_lab
from visavis.lab.clock import cpu_time_s
from visavis.lab.compile_ahead import MEASURING, SIMULATING, kernels_in_use
from visavis.lab.config_files import EXAMPLE
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import FewTrials, perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.simulation import KERNEL_LIST, MeasuringTask, measure_one

STUDIES: Final = ("stare",)


class _Compiled:
    """Seconds that each function called from Python took to compile, with all that it calls.

    What was compiled for another by then counts nothing: it comes last, and is loaded.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._begins: list[float] = []

    def on_start(self, event: Any) -> None:
        """Begin to count."""
        self._begins.append(cpu_time_s())

    def on_end(self, event: Any) -> None:
        """Count the outermost; of several sets of types the longest."""
        took_s = cpu_time_s() - self._begins.pop()
        if self._begins:
            return
        function = event.data["dispatcher"].py_func
        name = f"{function.__module__}:{function.__qualname__}"
        self.seconds[name] = max(took_s, self.seconds.get(name, 0.0))


def used_in(study: str, folder: Path) -> dict[str, list[str]]:
    """Simulate and measure a few trials in this process; return the kernels of both."""
    opened_study = find_study(study)
    experiment = opened_study.experiment({})
    few = FewTrials(experiment.study, experiment.overrides)
    lab = load_lab(EXAMPLE, "sim", quiet=True).model_copy(update={"data_root": folder})
    request = simulated_request(opened_study, few, lab, label="S01A", index=0, seed=1)
    session = perform_new(request)
    simulating = kernels_in_use()
    measure_one(MeasuringTask(study, session))
    return {SIMULATING: sorted(simulating), MEASURING: sorted(kernels_in_use() - simulating)}


def _child(study: str) -> None:
    from numba.core.event import Listener, register

    counter = _Compiled()

    class Ear(Listener):
        """Passes on what the compiler reports."""

        on_start = staticmethod(counter.on_start)
        on_end = staticmethod(counter.on_end)

    register("numba:compile", Ear())  # type: ignore[no-untyped-call]  # numba's
    with tempfile.TemporaryDirectory() as folder:
        used = used_in(study, Path(folder))
    sys.stdout.write(json.dumps({"used": used, "seconds": counter.seconds}))


def _asked(study: str, cache: Path) -> dict[str, Any]:
    done = subprocess.run(  # noqa: S603 - this program
        [sys.executable, "-m", "tools.kernel_list", "--child", study],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        stdout=subprocess.PIPE,
        check=True,
    )
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def lines_of(study: str) -> list[str]:
    """Return a study's lines, those that take longest first."""
    with tempfile.TemporaryDirectory() as cache:
        seconds = _asked(study, Path(cache))["seconds"]
        used = _asked(study, Path(cache))["used"]
    lines = []
    for phase, kernels in used.items():
        costs = {line: seconds.get(line.partition("(")[0], 0.0) for line in kernels}
        dearest_first = sorted((-cost_s, line) for line, cost_s in costs.items())
        lines += [f"{study} {phase} {-cost_s:.1f} {line}" for cost_s, line in dearest_first]
    return lines


def main(arguments: list[str]) -> int:
    """Write the lines of the studies named; those of others stay."""
    if arguments[:1] == ["--child"]:
        _child(arguments[1])
        return 0
    path = KERNEL_LIST
    others = path.read_text("utf-8").splitlines() if path.exists() else []
    for study in arguments or STUDIES:
        kept = [line for line in others if not line.startswith(("#", f"{study} "))]
        others = [*kept, *lines_of(study)]
    head = "# study, phase, seconds to compile, kernel: python -m tools.kernel_list"
    path.write_text("\n".join((head, *others)) + "\n", "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
