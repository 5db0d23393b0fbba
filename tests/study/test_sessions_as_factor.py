"""Sessions of one person are a factor: planned, simulated, told of when missing, compared."""

import shutil
from dataclasses import replace
from datetime import datetime, timedelta

import pandas as pd
import pytest
from typer.testing import CliRunner

from tests.study.simulated_study import invoked, quick_targets
from visavis.cli.main import app
from visavis.cli.quick_tracker import tracker_of
from visavis.lab.errors import DesignError, SessionAborted, UsageError
from visavis.recording.manifest import read_manifest
from visavis.results.opened_study import find_study
from visavis.running.new_study import write_examples
from visavis.running.quick import quick_study
from visavis.running.sessions.next_session import next_session
from visavis.running.sessions.session_request import simulated_request

STUDY = """
from visavis import Compare, Factor, Measure, Rating, Study, Text

study = Study(
    "visits",
    factors=[Factor("size", [1, 2]), Factor("arm", ["a", "b"], between=True)],
    sessions=["before", "after"], days_between=(6, 8),
    repetitions=2,
    intertrial_s=0.1,
    calibrate=False,
    measures=[Measure("seen", "1", "Seen after")],
    compare=[Compare("calm", within="session", between="arm"), Compare("seen", within="session")],
)


@study.trial
def trial(t):
    yield t.show(Text(t.session, height_deg=t.size), seconds=0.2)
    yield t.ask(Rating("calm", 1, 7))
    t.row["seen"] = 1.0 if t.session == "after" else 0.0


@study.answer
def answer(seen, response, rng):
    return round(3 + 2 * (seen.visit == 2) + 0.5 * rng.standard_normal())
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("visits") / "visits.py"
    path.write_text(STUDY, "utf-8")
    return path


@pytest.fixture(scope="module")
def folder(file):
    words = ["simulate", str(file), "--participants", "6", "--output", str(file.parent / "out")]
    with quick_targets():
        invoked(*words, "--processes", "1")
    return file.parent / "out" / "simulated" / "visits"


def analysed(folder, *words):
    result = CliRunner().invoke(app, ["analyse", str(folder), "--processes", "1", *words])
    assert result.exit_code == 0, result.output
    return " ".join(result.output.split())


def test_simulate_makes_every_session_of_everybody(folder):
    assert 12 == len(list(folder.glob("sub-*/ses-*/manifest.json")))


def test_every_session_has_an_order_and_chance_of_its_own(folder):
    plans = [read_manifest(p).plan for p in sorted(folder.glob("sub-S01B/ses-*"))]
    first, second = ([t["seed"] for b in plan["blocks"] for t in b["trials"]] for plan in plans)
    assert not set(first) & set(second)
    assert plans[0]["group"] == plans[1]["group"]


def test_tables_and_comparisons_carry_the_session(folder):
    analysed(folder)
    rows = pd.read_csv(folder / "derived" / "trials.csv")
    assert {"before": 24, "after": 24} == dict(rows["session"].value_counts())
    assert [1, 2] == sorted(rows["session_number"].unique())
    by = rows.groupby("session")["seen"].mean()
    assert {"before": 0.0, "after": 1.0} == dict(by)
    assert 6 == len(pd.read_csv(folder / "derived" / "participants.csv"))
    report = (folder / "derived" / "report.html").read_text("utf-8")
    assert "session (before, after; within participants)" in report


def test_who_misses_a_session_is_named_with_the_rule_of_the_test(folder, tmp_path):
    mine = tmp_path / "visits"
    shutil.copytree(folder, mine)
    shutil.rmtree(mine / "sub-S02C" / "ses-002")
    said = analysed(mine, "--accept-damage")
    assert "S02C has no session after" in said
    assert "complete cases" in said
    assert 6 == len(pd.read_csv(mine / "derived" / "participants.csv"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ('sessions=["before"]', "two or more"),
        ('sessions=["before", "before"]', "twice"),
        ('sessions="before"', "takes a list"),
        ('sessions=["before", "after"], parameters={"session": 1}', "session"),
        ('days_between=(3, 1), sessions=["before", "after"]', "days_between"),
        ("days_between=(1, 3)", "days_between"),
    ],
)
def test_impossible_sessions_are_refused_by_name(tmp_path, change, says):
    declared = 'sessions=["before", "after"], days_between=(6, 8)'
    (tmp_path / "visits.py").write_text(STUDY.replace(declared, change), "utf-8")
    with pytest.raises(DesignError, match=says):
        find_study(str(tmp_path / "visits.py"))


def test_run_takes_the_next_session_and_tells_when_it_is_due(folder, tmp_path):
    person = tmp_path / "sub-S01B"
    shutil.copytree(folder / "sub-S01B" / "ses-001", person / "ses-001")
    ended = datetime.fromisoformat(read_manifest(person / "ses-001").parts[-1].ended_wall_iso)

    def due(days):
        now = (ended + timedelta(days=days)).isoformat()
        return next_session(person, ["before", "after"], (6, 8), now)

    assert [True, False, False] == [due(days).is_early for days in (5, 6, 9)]
    assert [False, False, True] == [due(days).is_late for days in (5, 8, 9)]
    first, last = (f"{ended + timedelta(days=days):%Y-%m-%d}" for days in (6, 8))
    assert f"session 2 (after) is due from {first} to {last}" == due(5).words
    shutil.copytree(folder / "sub-S01B" / "ses-002", person / "ses-002")
    with pytest.raises(UsageError, match="all 2 sessions"):
        due(9)


def test_a_session_that_the_study_does_not_have_is_refused(file):
    experiment = find_study(str(file)).experiment({})
    assert "after" == experiment.of_session(2).session_name
    with pytest.raises(DesignError, match="there is no session 3"):
        experiment.of_session(3)


def test_power_compares_sessions(file):
    study = find_study(str(file))
    rows = quick_study(study, study.experiment({}), tracker_of, [0, 1], seed=1).trials
    assert {"before": 8, "after": 8} == dict(rows["session"].value_counts())
    means = rows.groupby("session")["calm"].mean()
    assert means["after"] > means["before"]


def killed_once(study, *words, **keywords):
    """Return a request that ends in the middle of one person's second session."""
    request = simulated_request(study, *words, **keywords)
    killed = (keywords["label"], keywords["session"]) == ("S02C", 2)

    def on_trial(_, count, __):
        if count == 1:
            raise KeyboardInterrupt

    return replace(request, on_trial=on_trial) if killed else request


def test_the_ready_study_goes_from_plan_to_report_and_on_after_a_kill(tmp_path):
    write_examples(tmp_path)
    study = str(tmp_path / "before_after.py")
    planned = CliRunner().invoke(app, ["plan", study, "--session", "2"])
    assert planned.exit_code == 0, planned.output
    words = ["simulate", study, "--participants", "6", "--output", str(tmp_path), "--processes=1"]
    words += ["--set", "repetitions=1", "--set", "scene_s=0.5"]
    with quick_targets(killed_once):
        stopped = CliRunner().invoke(app, words)
    assert isinstance(stopped.exception, SessionAborted)
    with quick_targets():
        assert "1 were interrupted; their rest is simulated" in invoked(*words)
    folder = tmp_path / "simulated" / "before_after"
    assert 2 == len(read_manifest(folder / "sub-S02C" / "ses-002").parts)
    analysed(folder)
    rows = pd.read_csv(folder / "derived" / "trials.csv")
    counts = rows[rows["status"] == "complete"].groupby(["eyes", "session"]).size()
    assert {6} == set(counts)
    findings = pd.read_csv(folder / "derived" / "statistics.csv")
    terms = {frozenset(str(term).split(":")) for term in findings["term"]}
    assert frozenset({"session", "eyes"}) in terms
    assert {"ease", "presence"} <= set(findings["measure"])
