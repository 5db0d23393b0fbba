"""What each source says beside what its study does: complete, with reasons, and in the README."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import pytest
from typer.testing import CliRunner

from tests.experiments.stare.synthetic_rows import analysed, anxiety_answers, study_rows
from tools.fidelity_tables import readme_of, section_of
from visavis.analysis.report import Cell, Fold, Table
from visavis.cli.main import app
from visavis.experiments.stare.study import experiment_of
from visavis.lab.errors import DesignError, UsageError
from visavis.protocol.plan.design import Factor
from visavis.results.fidelity import (
    FidelityRow,
    counts_of,
    design_names,
    design_values,
    fidelity_rows,
    fidelity_section,
    stale_facts,
)
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.study.actions import Action
from visavis.study.catalogue import SHIPPED_STUDIES
from visavis.study.declaration import Study
from visavis.study.derive import derive
from visavis.study.experiment import StudyExperiment
from visavis.study.source import Fact, PrintedOrder, Source
from visavis.study.trial import TrialScript

STUDIES = tuple(SHIPPED_STUDIES)
BEFORE_RESULTS = {"design", "procedure"}
Says: TypeAlias = Callable[[Fact], OpenedStudy]


@pytest.fixture
def says(monkeypatch: pytest.MonkeyPatch) -> Says:
    """Let the source of `stare` say one thing more; return the study as commands open it."""

    def opened_with(fact: Fact) -> OpenedStudy:
        opened_study = find_study("stare")
        report = opened_study.study.report
        assert report.source is not None
        source = replace(report.source, facts=(*report.source.facts, fact))
        monkeypatch.setattr(opened_study.study, "report", replace(report, source=source))
        return opened_study

    return opened_with


@pytest.mark.parametrize("name", STUDIES)
def test_every_difference_from_a_source_has_its_reason(name: str) -> None:
    experiment = find_study(name).experiment({})
    rows = fidelity_rows(experiment)
    assert [] == [row.what for row in rows if row.lacks_reason]
    assert () == stale_facts(experiment)
    assert {row.kind for row in rows} >= BEFORE_RESULTS


@pytest.mark.parametrize("name", STUDIES)
def test_a_readme_holds_what_the_study_declares_of_its_source(name: str) -> None:
    section = section_of(name)
    assert section
    assert section in readme_of(name).read_text(encoding="utf-8"), "python -m tools.fidelity_tables"


@pytest.mark.parametrize("name", STUDIES)
def test_the_names_of_a_design_are_those_of_its_values(name: str) -> None:
    experiment = find_study(name).experiment({})
    assert set(design_values(experiment)) == set(design_names(experiment))


def test_a_number_of_the_design_is_read_from_it() -> None:
    rows = {r.what: r for r in fidelity_rows(find_study("stare").experiment({"repetitions": 1}))}
    assert ("72", "36", "different") == (
        rows["trials"].printed,
        rows["trials"].here,
        rows["trials"].verdict,
    )
    set_here = rows["repetitions of condition and place"]
    assert "this study was set so (its own: 2)" == set_here.because


@pytest.mark.parametrize(
    ("name", "overrides", "what", "its_own"),
    [
        ("stare", {"repetitions": 1}, "trials", "72"),
        ("waving", {"clerk": ["clerk_left"]}, "trials", "54"),
        ("waving", {"clerk": ["clerk_left"]}, "clerks", "clerk_left, clerk_middle, clerk_right"),
        ("waving", {"blocks": 1}, "trials", None),
    ],
)
def test_what_follows_from_a_setting_has_that_for_a_reason(
    name: str, overrides: dict[str, Any], what: str, its_own: str | None
) -> None:
    rows = {row.what: row for row in fidelity_rows(find_study(name).experiment(overrides))}
    assert [] == [row.what for row in rows.values() if row.lacks_reason]
    because = "" if its_own is None else f"this study was set so (its own: {its_own})"
    assert because == rows[what].because


def test_a_number_that_differs_in_a_derived_study_has_that_for_a_reason() -> None:
    said = Source("A. Author (2020)", facts=[Fact("design", "trials", 4, "p. 1", of="trials")])
    sides = [Factor("side", ("left", "right"))]
    base = Study("base", factors=sides, repetitions=2, source=said)
    base.trial(waits)
    fewer = OpenedStudy(derive(base, "fewer", repetitions=1))
    (row,) = fidelity_rows(fewer.experiment({}))
    assert "different, because this study was derived so (its base: 4)" == row.verdict_text


def test_a_number_that_differs_lacks_a_reason(says: Says) -> None:
    opened_study = says(Fact("design", "seconds between trials", 4, "p. 1", of="intertrial_s"))
    rows = fidelity_rows(opened_study.experiment({}))
    assert ["seconds between trials"] == [row.what for row in rows if row.lacks_reason]
    result = CliRunner().invoke(app, ["fidelity", "stare"])
    assert 1 == result.exit_code
    assert "seconds between trials: different, and no reason is declared" in result.stderr


def test_a_reason_for_no_difference_is_stale(says: Says) -> None:
    fact = Fact("design", "dark", 3, "p. 1", of="intertrial_s", because="we like it so")
    assert ("dark",) == stale_facts(says(fact).experiment({}))


def test_a_fact_about_no_value_of_the_design_is_refused(says: Says) -> None:
    opened_study = says(Fact("design", "dark", 3, "p. 1", of="intertrials_s"))
    with pytest.raises(DesignError, match=r"no value of the design 'intertrials_s'.*intertrial_s"):
        opened_study.experiment({})


def test_an_order_of_no_factor_of_the_design_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    opened_study = find_study("stare")
    report = opened_study.study.report
    assert report.source is not None
    order = PrintedOrder("D > A", "dwell_ms", "p. 1", factor="conditions")
    source = replace(report.source, orders=(order,))
    monkeypatch.setattr(opened_study.study, "report", replace(report, source=source))
    with pytest.raises(DesignError, match="no factor 'conditions'; did you mean 'condition'"):
        opened_study.experiment({})


def waits(t: TrialScript) -> Iterator[Action]:
    """Perform a trial in which nothing is shown."""
    yield t.wait(0.1)


def test_a_derived_study_keeps_the_source_of_its_base_and_says_what_it_left_out() -> None:
    sides = Factor("side", ("left", "right"))
    said = Source("A. Author (2020)", facts=[Fact("design", "hands", 2, "p. 1", of="hand")])
    base = Study("base", factors=[sides, Factor("hand", ("left", "right"))], source=said)
    base.trial(waits)
    verdicts = [
        fidelity_rows(OpenedStudy(study).experiment({}))[0].verdict_text
        for study in (base, derive(base, "fewer", factors=[sides]))
    ]
    assert ["same", "different, because this study was derived without hand"] == verdicts


def test_an_operator_sees_the_source_beside_the_study() -> None:
    result = CliRunner().invoke(app, ["fidelity", "waving", "--markdown"])
    assert 0 == result.exit_code
    assert "| trials | 54 | section 2.3.1 | 54 | same |" in result.stdout
    assert "| Accuracy by technique | F(1, 15) = 7.09, p = .017, η²p = .32 |" in result.stdout


def test_a_report_says_which_printed_orders_its_data_show() -> None:
    analysis = analysed(study_rows(6), anxiety_answers(6))
    (section,) = fidelity_section(analysis, experiment_of())
    (orders,) = [block for block in section.blocks if isinstance(block, Table)]
    verdicts = {row[0]: row[2] for row in orders.rows}
    assert Cell("holds", "agree") == verdicts["Dwell time by condition: D > A"]
    assert {"Design", "Tests"} <= {
        block.summary.split(":")[0] for block in section.blocks if isinstance(block, Fold)
    }


def test_a_report_says_of_an_order_about_an_absent_level_that_it_is_not_measured() -> None:
    whole = analysed(study_rows(6), anxiety_answers(6))
    rows = whole.selection.rows
    others = replace(whole.selection, rows=rows[rows["condition"] != "A"])
    analysis = replace(whole, selection=others)
    (section,) = fidelity_section(analysis, experiment_of())
    (orders,) = [block for block in section.blocks if isinstance(block, Table)]
    verdicts = {row[0]: row[2] for row in orders.rows}
    assert Cell("not measured", "weak") == verdicts["Dwell time by condition: D > A"]


def test_a_study_without_a_source_is_told_how_to_declare_one(tmp_path: Path) -> None:
    file = tmp_path / "plain.py"
    file.write_text(PLAIN, encoding="utf-8")
    with pytest.raises(UsageError, match=r"plain declares no source.*facts=\[Fact"):
        CliRunner().invoke(app, ["fidelity", str(file)], catch_exceptions=False)


def test_own_studies_have_the_table_too(tmp_path: Path) -> None:
    file = tmp_path / "plain.py"
    fact = 'Fact("design", "trials", 2, "p. 3", of="trials")'
    said = f'source=Source("A. Author (2020)", 12, facts=[{fact}]),'
    file.write_text(PLAIN.replace("# source", said), encoding="utf-8")
    result = CliRunner().invoke(app, ["fidelity", str(file), "--markdown"])
    assert "| trials | 2 | p. 3 | 2 | same |" in result.stdout


def rows_saying(says: Says, fact: Fact) -> FidelityRow:
    rows = fidelity_rows(says(fact).experiment({}))
    return next(row for row in rows if row.what == fact.what)


def test_words_that_are_not_the_printed_ones_need_a_reason(says: Says) -> None:
    row = rows_saying(says, Fact("procedure", "how near", "2 m", "p. 1", here="1.2 m"))
    assert row.lacks_reason
    assert "different, because (no reason is declared)" == row.verdict_text


def test_words_that_are_the_printed_ones_need_none(says: Says) -> None:
    fact = Fact("procedure", "dark", "3 s", "p. 1", here="{intertrial_s} s")
    assert "same" == rows_saying(says, fact).verdict_text
    with_reason = replace(fact, what="dim", because="we like it so")
    assert ("dim",) == stale_facts(says(with_reason).experiment({}))


def test_a_reason_without_what_is_done_here_is_refused() -> None:
    with pytest.raises(DesignError, match=r"'how near'.*here= or of="):
        Fact("procedure", "how near", "2 m", "p. 1", because="rooms are small")


@pytest.mark.parametrize("here", ["{nope} m", "{", "{} m", "{intertrial_s.x}", "{intertrial_s:d}"])
def test_braces_around_no_value_of_the_design_are_refused(says: Says, here: str) -> None:
    fact = Fact("procedure", "how near", "2 m", "p. 1", here=here, because="rooms are small")
    opened_study = says(fact)
    with pytest.raises(DesignError, match=r"'how near'.*there are.*intertrial_s"):
        opened_study.experiment({})
    with pytest.raises(DesignError, match=r"'how near'.*there are.*intertrial_s"):
        fidelity_rows(StudyExperiment(opened_study.study))


def sided(name: str, *facts: Fact) -> Study:
    factors = [Factor("side", ("left", "right")), Factor("hand", ("left", "right"))]
    study = Study(name, factors=factors, source=Source("A. Author (2020)", facts=facts))
    study.trial(waits)
    return study


def test_no_reason_is_invented_for_a_value_that_no_base_has() -> None:
    fact = Fact("design", "walks", 2, "p. 1", of="trails")
    derived = derive(sided("base", fact), "fewer", factors=[Factor("side", ("left", "right"))])
    with pytest.raises(DesignError, match=r"'walks'.*'trails'.*trials"):
        fidelity_rows(StudyExperiment(derived))


def test_words_about_what_a_derived_study_left_out_say_so() -> None:
    fact = Fact("design", "hands", "both", "p. 1", here="{hand}", because="of two")
    derived = derive(sided("base", fact), "fewer", factors=[Factor("side", ("left", "right"))])
    (row,) = fidelity_rows(StudyExperiment(derived))
    assert "different, because this study was derived without hand" == row.verdict_text


@pytest.mark.parametrize("name", STUDIES)
def test_printed_results_are_never_called_the_same(name: str) -> None:
    rows = fidelity_rows(find_study(name).experiment({}))
    declared = [fact.what for fact in source_of(name).facts]
    assert set() == {
        row.verdict
        for row in rows
        if row.kind in ("test", "result")
        and row.what not in (*declared, "participants")
        and not row.because
    } - {"not compared"}
    assert set() == {row.verdict for row in rows if row.kind == "result"} & {"same"}


def source_of(name: str) -> Source:
    source = find_study(name).study.report.source
    assert source is not None
    return source


def test_printed_tests_of_several_groups_say_of_which() -> None:
    rows = fidelity_rows(find_study("interpolation").experiment({}))
    names = [row.what for row in rows if row.kind == "test"]
    assert len(names) == len(set(names))
    assert {"naturalness by method (novice)", "naturalness by method (recruited_by = 1)"} <= {
        *names
    }


def test_orders_are_expected_of_simulated_people_and_not_checked() -> None:
    rows = fidelity_rows(find_study("interpolation").experiment({}))
    orders = [row for row in rows if row.what == "order"]
    assert {"not compared", "different"} == {row.verdict for row in orders}
    assert all(
        "not checked here" in row.here and "benchmarks.printed_orders" in row.here
        for row in orders
        if row.verdict == "not compared"
    )
    assert "naturalness by method: squad > slerp, lineuler" in {row.printed for row in orders}
    assert "not compared" in counts_of(rows)


PLAIN = """
from visavis import Choice, Fact, Factor, Source, Study

study = Study("plain", factors=[Factor("side", ("left", "right"))], calibrate=False,
    # source
)


@study.trial
def trial(t):
    yield t.wait(0.1)
"""
