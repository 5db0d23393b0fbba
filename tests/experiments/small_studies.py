"""Small studies whose recordings and tables are pinned, and their fingerprints.

`python -m tests.experiments.small_studies [NAME …]` pins them anew: only after a change that is
meant to change what is recorded or computed, and that says so in the changelog.
"""

import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import pandas as pd
from typer.testing import CliRunner

from benchmarks.crowd_participants import quick_study as quick_crowd
from tests.experiments.crowd.synthetic_walks import tables, walks
from tests.experiments.crowd.tables import analysed as analysed_crowd
from tests.experiments.fingerprint import (
    fingerprint_of_sessions,
    fingerprint_of_study,
    fingerprint_of_table,
    read_fingerprint,
    write_fingerprint,
)
from tests.experiments.former_tables import FORMER, fingerprint_as_pinned
from tests.experiments.stare.synthetic_rows import analysed
from tests.experiments.waving.quick_sessions import quick_analysis
from tests.experiments.waving.quick_sessions import quick_study as quick_waving
from tests.store import STORE
from visavis.cli.main import app
from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.crowd.design import CONTROL_GROUP, HAPTICS_GROUP
from visavis.experiments.crowd.sections import similarity_rows
from visavis.experiments.stare.study import experiment_of as stare_experiment
from visavis.experiments.stare.study import study as stare
from visavis.lab.config_files import EXAMPLE
from visavis.recording.csv_file import write_csv
from visavis.recording.folder import SIMULATED_ROOT
from visavis.results.opened_study import OpenedStudy
from visavis.results.outputs import contrast_rows, statistics_rows
from visavis.running.quick import quick_study
from visavis.running.sessions.study_folder import DERIVED_FOLDER
from visavis.study.look_measures import MAIN_MEASURES

PINNED: Final = Path(__file__).parent / "pinned"
SEED: Final = 1


@dataclass(frozen=True)
class SmallStudy:
    """Parameters that make a study small, and how it is measured."""

    study: str
    parameters: Mapping[str, Any]
    measure: tuple[str, ...] = field(default=())


SESSIONS: Final = {
    "stare": SmallStudy(
        "stare", {"trial_s": 2.0, "intertrial_s": 0.5, "practice_s": 2.0, "repetitions": 1}
    ),
    "crowd": SmallStudy("crowd", {"configurations": 1, "intertrial_s": 0.5}, ("surface=capsules",)),
    "waving": SmallStudy(
        "waving",
        {
            "clerk": ["clerk_left"],
            "increment": 0.1,
            "before_s": 0.3,
            "wave_s": 0.6,
            "after_s": 0.1,
            "intertrial_s": 0.1,
            "blocks": 1,
        },
    ),
}
"""Two simulated people of each study, as `visavis simulate` and `visavis analyse` treat them."""


def simulated(name: str, root: Path) -> Path:
    """Return the folder of a small study, simulated below `root`."""
    small = SESSIONS[name]
    given = [f"--set={key}={value}" for key, value in small.parameters.items()]
    few = ["--participants", "2", "--seed", str(SEED), "--processes", "1"]

    def simulate(at: Path) -> Path:
        _visavis("simulate", small.study, *few, *given, "--output", at, "--config", EXAMPLE)
        return at / SIMULATED_ROOT / small.study

    return STORE.copy(f"small {name}", simulate, root)


def sessions(name: str, root: Path) -> dict[str, Any]:
    """Simulate and analyse two people of a study; return the fingerprint."""
    small = SESSIONS[name]
    folder = simulated(name, root)
    how = [f"--set={setting}" for setting in small.measure]
    _visavis("analyse", folder, "--processes", "1", *how)
    if name in FORMER:
        return {
            **fingerprint_of_sessions(folder),
            **as_pinned(name, folder / DERIVED_FOLDER, root),
        }
    return fingerprint_of_study(folder)


def _visavis(*command: object) -> None:
    result = CliRunner().invoke(app, [str(word) for word in command])
    if result.exception is not None:
        raise result.exception


def as_pinned(name: str, tables: Path, root: Path) -> dict[str, Any]:
    """Return the fingerprint of tables in the layout they had when they were pinned."""
    out = root / "former"
    out.mkdir()
    pinned = read_fingerprint(PINNED / f"{name}.json")
    return fingerprint_as_pinned(FORMER[name], pinned, tables, out)


def quick_stare_tables() -> dict[str, pd.DataFrame]:
    """Return rows and statistics of sixteen people without sessions."""
    made = quick_study(OpenedStudy(stare), stare_experiment(), tracker_of, range(16), seed=SEED)
    for table in (made.trials, made.people):
        table["participant"] = table["participant"].str[-3:]
    numbers = [*MAIN_MEASURES, "lost_01", "switch_ms"]
    made.trials[numbers] = made.trials[numbers].astype(float)
    analysis = analysed(made.trials, made.people)
    return {
        "trials": made.trials,
        "answers": made.people,
        "cell_means": analysis.cell_means(),
        "statistics": pd.DataFrame(statistics_rows(analysis)),
    }


def quick_waving_tables() -> dict[str, pd.DataFrame]:
    """Return rows and statistics of sixteen people without sessions, one clerk waving briefly."""
    # The waves of the small sessions, which take a while to plan.
    one = {
        k: SESSIONS["waving"].parameters[k] for k in ("clerk", "increment", "before_s", "wave_s")
    }
    trials = quick_waving(16, SEED, parameters=one)
    analysis = quick_analysis(trials, one)
    return {
        "trials": trials,
        "cell_means": analysis.cell_means(),
        "statistics": pd.DataFrame(statistics_rows(analysis)),
        "contrasts": pd.DataFrame(contrast_rows(analysis)),
    }


def quick_crowd_tables() -> dict[str, pd.DataFrame]:
    """Return the walks of two people without sessions; statistics of sixteen made-up people."""
    drawn = [
        *walks(12, group=HAPTICS_GROUP),
        *walks(4, seed=3, group=CONTROL_GROUP, effect=False),
    ]
    analysis = analysed_crowd(tables(drawn), n_permutations=99, n_splits=10)
    walked = quick_crowd(2, SEED, parameters={"configurations": [1]})
    return {
        "quick_walks": walked.trials.assign(cells=[str(sorted(c)) for c in walked.cells]),
        "cell_means": analysis.cell_means(),
        "statistics": pd.DataFrame(statistics_rows(analysis)),
        "contrasts": pd.DataFrame(contrast_rows(analysis)),
        "similarity": pd.DataFrame([r for g in analysis.further for r in similarity_rows(g)]),
    }


QUICK: Final[Mapping[str, Callable[[], dict[str, pd.DataFrame]]]] = {
    "quick_stare": quick_stare_tables,
    "quick_crowd": quick_crowd_tables,
    "quick_waving": quick_waving_tables,
}
NAMES: Final = (*SESSIONS, *QUICK)


def fingerprint(name: str, root: Path) -> dict[str, Any]:
    """Return the fingerprint of a small study by name; `root` is an empty folder to write to."""
    if name in SESSIONS:
        return sessions(name, root)
    found: dict[str, Any] = {}
    for table, frame in QUICK[name]().items():
        path = root / f"{table}.csv"
        write_csv(frame, path)
        found.update(fingerprint_of_table(path))
    return as_pinned(name, root, root) if name in FORMER else found


if __name__ == "__main__":
    for chosen in sys.argv[1:] or NAMES:
        with tempfile.TemporaryDirectory() as temporary:
            write_fingerprint(fingerprint(chosen, Path(temporary)), PINNED / f"{chosen}.json")
        sys.stdout.write(f"{chosen} pinned\n")
