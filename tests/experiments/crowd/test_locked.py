"""The crowd study's plan can be locked, and what is analysed otherwise is named."""

from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

import visavis
from tests.experiments.crowd.tables import OPENED
from visavis.cli.main import app
from visavis.lab.clock import SimClock
from visavis.lab.config_files import EXAMPLE
from visavis.results.locked_plan.deviations import deviations_between
from visavis.running.sessions.plan_lock import content_now, lock_plan, read_lock
from visavis.running.sessions.studies import QuietNotifier, analyse_study


class Silent(QuietNotifier):
    """Hears of deviations, and keeps them."""

    def warn(self, text: str) -> None:
        """Keep quiet."""


def test_a_locked_crowd_study_keeps_comparisons_rules_and_thresholds(tmp_path: Path) -> None:
    experiment = OPENED.experiment({})
    lock_plan(tmp_path, OPENED, experiment, 1, SimClock(), participants=23)
    locked = read_lock(tmp_path)
    assert locked is not None
    plan = locked.plan
    assert {"collisions by condition (haptics)", "speed_m_s by condition (control)"} <= set(
        plan["comparisons"]
    )
    assert {"max_lost_01", "came_back", "min_walks_01"} == set(plan["exclusions"])
    assert 0.05 == plan["tests"]["dice_bound"]
    assert () == deviations_between(plan, content_now(OPENED, experiment, 1))


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"dice_bound": 0.1}, {"tests dice_bound"}),
        ({"came_back": None}, {"exclusions came_back: limit"}),
        ({"rule": "published"}, {"tests rule"}),
    ],
)
def test_a_threshold_set_otherwise_than_locked_is_a_deviation(settings, named) -> None:
    experiment = OPENED.experiment({})
    planned = content_now(OPENED, experiment, 1)
    deviations = deviations_between(planned, content_now(OPENED, experiment, 1, settings))
    assert named == {f"{d.part} {d.name}" for d in deviations}


def test_another_alpha_than_locked_is_a_deviation_of_every_comparison() -> None:
    experiment = OPENED.experiment({})
    planned = content_now(OPENED, experiment, 1)
    deviations = deviations_between(planned, content_now(OPENED, experiment, 1, {"alpha": 0.01}))
    assert {"comparisons"} == {d.part for d in deviations}
    assert len(OPENED.study.analysis.compare) == len(deviations)


def test_a_locked_crowd_study_is_analysed_and_its_report_names_what_deviates(
    tmp_path: Path,
) -> None:
    short = {"configuration": [1], "intertrial_s": 0.5, "limit_s": 3.0}
    given = [f"--set={name}={value}" for name, value in short.items()]
    locked = CliRunner().invoke(
        app,
        [
            "lock",
            "crowd",
            "--participants",
            "1",
            "--rule",
            "One.",
            "--seed",
            "1",
            *given,
            "--devices",
            "sim",
            "--config",
            str(EXAMPLE),
            "--output",
            str(tmp_path),
        ],
    )
    assert 0 == locked.exit_code, locked.output
    data = visavis.simulate("crowd", 1, output=tmp_path, parameters=short, processes=1)
    settings = ["surface=capsules", "came_back=null"]
    report = analyse_study(data.path, processes=1, measure=settings, notifier=Silent())
    deviations = pd.read_csv(report.parent / "deviations.csv")
    assert ["test rule surface", "exclusion came_back: limit"] == deviations["what"].tolist()
    assert "came_back" in report.read_text(encoding="utf-8").partition('id="plan"')[2]
