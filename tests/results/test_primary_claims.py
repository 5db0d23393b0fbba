"""Primary claims: named in one place, first in reports, and counted by themselves in power."""

from pathlib import Path

import pandas as pd
import pytest

from tests.results.test_headlines import DISTANCE, GAZE, analysed, headlines
from visavis import Compare, Study
from visavis.analysis.power import ANYTHING, PRIMARY
from visavis.cli.quick_tracker import tracker_of
from visavis.lab.errors import DesignError
from visavis.results.locked_plan.deviations import deviations_between
from visavis.results.opened_study import find_study
from visavis.results.outputs import statistics_rows
from visavis.results.planned_tests import planned_tests, primary_tests
from visavis.results.power import KitPower
from visavis.results.report.study_report import _ranks
from visavis.running.quick import quick_study
from visavis.study.catalogue import SHIPPED_STUDIES, declared_study

LIKED = Compare("nice", within="gaze", claim="Looks are nice", expects="directed > averted")


@pytest.mark.parametrize("name", SHIPPED_STUDIES)
def test_every_shipped_study_names_its_primary_claims(name: str) -> None:
    study = declared_study(name)
    every = planned_tests(study, find_study(name).experiment({}).compare)
    assert study.analysis.primary
    assert set(study.analysis.primary) <= set(every)


def of(compare: list[Compare], **keywords: object) -> tuple[str, ...]:
    study = Study("mood", factors=[GAZE, DISTANCE], compare=compare, **keywords)
    return primary_tests(study, compare)


def test_without_names_claims_are_primary_and_without_claims_everything_planned() -> None:
    plain = Compare("nice", within="distance")
    beside = Compare("warm", within="gaze", exploratory=True)
    assert ("nice:gaze",) == of([plain, LIKED, beside])
    assert ("nice:distance",) == of([plain, beside])
    both = Compare("nice", within=("gaze", "distance"))
    assert ("nice:gaze", "nice:distance", "nice:gaze:distance") == of([both])


def test_questions_that_a_study_answers_in_words_are_primary_before_its_claims() -> None:
    assert ("liked",) == of([LIKED], questions={"liked": "they are liked"})
    assert ("nice:gaze",) == of(
        [LIKED], questions={"liked": "they are liked"}, primary=["nice:gaze"]
    )


STUDY = """from visavis import Compare, Factor, Rating, Study

study = Study(
    "liked",
    factors=[Factor("side", ["left", "right"])],
    calibrate=False,
    compare=[Compare("nice", within="side"), Compare("warm", within="side")],
    primary=["nice:side"],
)


@study.trial
def trial(t):
    yield t.ask(Rating("nice", 1, 9))
    yield t.ask(Rating("warm", 1, 9))
"""


def test_a_primary_claim_that_is_not_planned_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "liked.py"
    path.write_text(STUDY.replace('"nice:side"', '"nice:sid"'), "utf-8")
    with pytest.raises(DesignError, match=r"liked\.py.*line 8.*'nice:sid'.*mean 'nice:side'"):
        find_study(str(path)).experiment({})


def test_a_derived_study_with_other_comparisons_does_without_the_primary_claims_of_its_base() -> (
    None
):
    base = Study("mood", factors=[GAZE], compare=[LIKED], primary=["nice:gaze"])
    other = base.with_changes(base=base, compare=[Compare("warm", within="gaze")])
    assert ("warm:gaze",) == primary_tests(other, other.analysis.compare)


@pytest.mark.parametrize(("above", "primary"), [("nice", True), ("warm", False)])
def test_power_counts_what_primary_claims_find_by_themselves(
    tmp_path: Path, above: str, primary: bool
) -> None:
    path = tmp_path / "liked.py"
    path.write_text(STUDY, "utf-8")
    power = KitPower(str(path), tracker_of, quick_study)
    rows = pd.DataFrame(
        {
            "participant": f"P{i:02d}",
            "side": side,
            **{m: (side == "left") * (i % 3 - 1 + 5.0 * (m == above)) for m in ("nice", "warm")},
        }
        for i in range(12)
        for side in ("left", "right")
    )
    found = power.resample(rows, (12,), [PRIMARY, ANYTHING], seed=1, alpha=0.001)[12]
    assert (primary, True) == tuple(found[n].is_significant for n in (PRIMARY, ANYTHING))
    assert ("nice:side",) == power.primary_tests


def test_a_report_answers_the_primary_claim_first_and_marks_the_others_as_secondary() -> None:
    values = dict.fromkeys(("warm", "nice"), lambda f, rng: 5 + 2 * (f["gaze"] == "directed"))
    values = {
        name: lambda f, rng: 5 + 2 * (f["gaze"] == "directed") + rng.normal() for name in values
    }
    found = analysed([GAZE], [Compare("warm", within="gaze"), LIKED], values)
    first, second = headlines(found)
    assert first.headline.startswith("Looks are nice")
    assert (False, True) == (first.is_secondary, second.is_secondary)
    rows = {row["measure"]: row["is_primary"] for row in statistics_rows(found[0])}
    assert {"warm": False, "nice": True} == rows
    (text,) = _ranks([first, second])
    assert "1 primary headline and 1 secondary" in text
    assert [] == list(_ranks([first]))


def test_a_changed_primary_claim_deviates_from_the_plan_and_older_plans_have_none() -> None:
    base = {"study_file_sha256": "a"}
    planned, now = {"primary": {"nice:side": "nice"}}, {"primary": {"warm:side": "warm"}}
    (gone, new) = deviations_between(base | planned, base | now)
    assert ("primary claim nice:side", "primary claim warm:side") == (gone.what, new.what)
    assert () == deviations_between(base, base | now)
