from pathlib import Path

import numpy as np
import pytest

from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.stare.design import MAX_AGENTS, MIN_AGENTS
from visavis.experiments.stare.study import study
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study
from visavis.running.sessions.simulation import (
    MeasuringTask,
    SimulationTask,
    measure_one,
    simulate_one,
)

SHORT = {"repetitions": 1, "trial_s": 6.0}
SEED, INDEX = 7, 2


@pytest.mark.parametrize("agents", [MAX_AGENTS, MIN_AGENTS])
def test_the_short_path_measures_what_the_full_engine_measures(tmp_path: Path, agents: int) -> None:
    parameters = {**SHORT, "agents": agents}
    config = load_config(EXAMPLE).model_copy(update={"data_root": tmp_path})
    session = simulate_one(SimulationTask("stare", config, "P1", INDEX, "", SEED, True, parameters))
    rows = measure_one(MeasuringTask("stare", session)).rows
    full = rows[~rows["is_practice"].astype(bool)].sort_values("number").reset_index(drop=True)
    opened = OpenedStudy(study)
    quick = quick_study(
        opened, opened.experiment(parameters), tracker_of, [INDEX], seed=SEED
    ).trials

    assert list(full["trial_id"]) == list(quick["trial_id"])
    assert list(full["condition"]) == list(quick["condition"])
    # Agents' blinks, which the short path leaves out, let a few trials take another course.
    dwell_differs_ms = (full["dwell_ms"] - quick["dwell_ms"]).abs()
    assert (dwell_differs_ms <= 60).mean() >= 0.85
    assert (full["fixation_count"] == quick["fixation_count"]).mean() >= 0.85
    assert full["dwell_ms"].mean() == pytest.approx(quick["dwell_ms"].mean(), rel=0.15)
    assert full["lost_01"].mean() == pytest.approx(quick["lost_01"].mean(), abs=0.01)
    both = full["switch_ms"].notna() & quick["switch_ms"].notna()
    assert both.sum() == 18
    assert np.median((full["switch_ms"] - quick["switch_ms"])[both].abs()) < 12
