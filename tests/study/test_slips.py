"""Slips in a study file are refused before anybody comes, with the line and what was meant."""

from contextlib import suppress
from pathlib import Path

import pytest

from visavis.lab.errors import DesignError
from visavis.results.opened_study import find_study
from visavis.study.catalogue import SHIPPED_STUDIES
from visavis.study.study_errors import forgotten_yields
from visavis.study.trial import STEPS

STUDY = """from visavis import Choice, Compare, Confusion, Factor, Rating, Scene, Study, dwell_on

study = Study(
    "mood",
    factors=[Factor("distance", [1.0, 2.5]), Factor("eyes", ["averted", "directed"])],
    practice=1,
    measures=[dwell_on("active")],
    compare=[
        Compare("comfort", within=["distance", "eyes"]),
        Compare("dwell_ms", within="eyes"),
    ],
    sections=[Confusion("eyes", "seen")],
)


@study.trial
def trial(t):
    yield t.show(Scene("person", distance_m=t.distance, eyes=t.eyes), seconds=1.5)
    yield t.ask(Rating("comfort", 1, 7))
    yield t.ask(Choice("seen", ["averted", "directed"]))
"""
SLIPS = [
    ('Compare("comfort"', 'Compare("comfrot"', 9, "no measure 'comfrot'; did you mean 'comfort'?"),
    ('within="eyes"', 'within="eye"', 10, "no factor 'eye'; did you mean 'eyes'?"),
    (
        'within="eyes"',
        'within="eyes", expects="directd > averted"',
        10,
        "'directd > averted' names 'directd', which is no level; did you mean 'directed'?",
    ),
    (
        'within="eyes"',
        'within="eyes", claim="Looking back"',
        10,
        "claims 'Looking back' and has no direction; say which level gives the greater values",
    ),
    (
        '"distance", "eyes"]',
        '"distance", "eyes"], expects="eyes: directed > averted; far: 1.0 > 2.5"',
        9,
        "expects something of 'far', which is no factor of it; there are distance, eyes",
    ),
    (
        'Compare("dwell_ms", within="eyes"',
        'Compare("dwell_ms", within="distance", only={"eyes": "direct"}',
        10,
        "names 'direct', which is no level of eyes; did you mean 'directed'?",
    ),
    ('dwell_on("active")', 'dwell_on("actve")', 7, "no role 'actve'; did you mean 'active'?"),
    ("distance_m=", "distance=", 18, "scene person takes no 'distance'; did you mean 'distance_m'"),
    ("eyes=t.eyes", "eys=t.eyes", 18, "scene person takes no 'eys'; did you mean 'eyes'"),
    ('"person"', '"persn"', 18, "no scene 'persn'; did you mean 'person'"),
    ("t.distance", "t.distnace", 18, "step 'distnace'; did you mean distance?"),
    ("t.show", "t.shwo", 18, "step 'shwo'; did you mean show?"),
    ("seconds=1.5", "second=1.5", 18, "show takes no 'second'; did you mean 'seconds'"),
    ("1, 7)", "1, hgh=7)", 19, "Rating takes no 'hgh'; did you mean 'high'"),
    ('"eyes", "seen"', '"eyes", "sen"', 12, "no choice 'sen'; did you mean 'seen'?"),
    ('"eyes", "seen"', '"ayes", "seen"', 12, "no factor or column 'ayes'; did you mean 'eyes'?"),
    ('"seen")]', '"seen", by="eys")]', 12, "no factor 'eys'; did you mean 'eyes'?"),
    ("practice=1", "practise=1", 3, "Study takes no 'practise'; did you mean 'practice'"),
    ('within="eyes"', 'witin="eyes"', 10, "Compare takes no 'witin'; did you mean 'within'"),
    ("yield t.show", "t.show", 18, "t.show(…) is made and not performed; write yield t.show(…)"),
    (
        "yield t.show",
        "look = t.show",
        18,
        "t.show(…) is made and not performed; write look = yield t.show(…)",
    ),
    ("@study.trial", "@study.trail", 16, "a study has no 'trail'; did you mean 'trial'?"),
]


@pytest.mark.parametrize(("right", "wrong", "line", "said"), SLIPS, ids=[s[1] for s in SLIPS])
def test_a_slip_is_refused_with_its_line_and_what_was_meant(
    tmp_path: Path, right: str, wrong: str, line: int, said: str
) -> None:
    path = tmp_path / "mood.py"
    assert right in STUDY
    path.write_text(STUDY.replace(right, wrong, 1), "utf-8")

    with pytest.raises(DesignError) as refused:
        find_study(str(path)).experiment({})

    assert f"{path}, line {line}" in str(refused.value)
    assert said in str(refused.value)


def test_a_misspelt_keyword_is_answered_with_the_nearest_and_no_list(tmp_path: Path) -> None:
    path = tmp_path / "mood.py"
    path.write_text(STUDY.replace("practice=1", "practise=1", 1), "utf-8")
    with pytest.raises(DesignError) as refused:
        find_study(str(path))
    assert str(refused.value).endswith("Study takes no 'practise'; did you mean 'practice'?")


def test_of_an_unlike_keyword_none_of_the_list_is_what_decorators_set(tmp_path: Path) -> None:
    path = tmp_path / "mood.py"
    path.write_text(STUDY.replace("practice=1", "xyzzy=1", 1), "utf-8")
    with pytest.raises(DesignError) as refused:
        find_study(str(path))
    _, _, listed = str(refused.value).partition("it takes ")
    assert "factors, items, repetitions" in listed
    assert [] == [n for n in listed.split(", ") if n.endswith("_of") or n == "makers"]


def test_steps_kept_or_passed_on_are_not_forgotten(tmp_path: Path) -> None:
    path = tmp_path / "mood.py"
    kept = "    look = t.show(Scene('person'), seconds=1)\n    yield look\n    t.note = 1\n"
    path.write_text(STUDY.replace("def trial(t):\n", f"def trial(t):\n{kept}"), "utf-8")
    with suppress(DesignError):  # whatever else is said of it
        find_study(str(path))
    assert [] == list(forgotten_yields(path, STEPS))


def test_a_study_without_slips_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "mood.py"
    path.write_text(STUDY, "utf-8")

    assert 4 == len(find_study(str(path)).experiment({}).read)


@pytest.mark.parametrize("name", SHIPPED_STUDIES)
def test_no_shipped_study_has_slips(name: str) -> None:
    assert find_study(name).experiment({}).read


ZONES = [
    ('within=["eyes", "zone"], expects="zone: near > far"', ""),
    ('within=["eyes", "zone"], expects="eyes: averted > directed; zone: near > far"', "3 levels"),
    ('within="zone", test="rm", expects="near > far", one_sided=True', "3 levels"),
    ('within="zone", test="rm", expects="near > middle > far"', ""),
]


@pytest.mark.parametrize(("keywords", "said"), ZONES, ids=[z[0] for z in ZONES])
def test_a_direction_of_a_derived_column_is_between_its_own_levels(
    tmp_path: Path, keywords: str, said: str
) -> None:
    """It was held against the levels of other factors, or against none: then an interaction or a
    one-sided test of three levels took the test over all three for that of the two it names."""
    zone = '{1.0: "near", 2.5: "middle", 4.0: "far"}[trial["distance"]]'
    right = 'Compare("comfort", within=["distance", "eyes"])'
    text = STUDY.replace(right, f'Compare("comfort", {keywords})', 1)
    text = text.replace("practice=1,", f'practice=1, derived={{"zone": lambda trial: {zone}}},', 1)
    path = tmp_path / "mood.py"
    path.write_text(text.replace("[1.0, 2.5]", "[1.0, 2.5, 4.0]", 1), "utf-8")

    if not said:
        assert find_study(str(path)).experiment({}).compare
        return
    with pytest.raises(DesignError, match=f"line 9.* zone has {said}"):
        find_study(str(path)).experiment({})


IMPOSSIBLE = [
    (
        'model="lmm", options=[("covariates", ("part",))]',
        "covariates goes with rm, anova, not with",
    ),
    (
        'test="art", options=[("bayes", True)]',
        "a Bayes factor stands beside the tests t, rm, anova",
    ),
    ('test="rm", options=[("bayes", True), ("covariates", ("part",))]', "without covariates"),
]


@pytest.mark.parametrize(("choice", "said"), IMPOSSIBLE, ids=["lmm", "art", "rm"])
def test_a_choice_that_a_comparison_s_test_does_not_have_is_refused_before_anybody_takes_part(
    tmp_path: Path, choice: str, said: str
) -> None:
    path = tmp_path / "mood.py"
    path.write_text(STUDY.replace('within="eyes"', f'within="eyes", {choice}'), "utf-8")

    with pytest.raises(DesignError, match=rf"mood\.py, line \d+: the comparison .*{said}"):
        find_study(str(path)).experiment_to_run({})


def test_a_motion_s_own_settings_are_taken_by_its_scene(tmp_path: Path) -> None:
    path = tmp_path / "mood.py"
    path.write_text(STUDY.replace('"person"', '"person", motion="idle", lively=0.5'), "utf-8")

    assert find_study(str(path)).experiment({}).read


RULE = 'Exclusion("min_comfort_ms", "trial", "comfort_ms", 200, "too fast", above=False)'
WITH_RULE = STUDY.replace("Confusion, Factor", "Confusion, Exclusion, Factor").replace(
    "practice=1,", f"practice=1,\n    exclusions=[{RULE}],"
)
RULE_SLIPS = [
    ('"comfort_ms"', '"comfrot_ms"', "no column of trials 'comfrot_ms'; did you mean 'comfort_ms'"),
    ('"trial"', '"trail"', "level is 'trail'; did you mean 'trial'?"),
    ('"trial", "comfort_ms"', '"participant", "bad_trial_01"', "did you mean 'bad_trials_01'?"),
]


@pytest.mark.parametrize(("right", "wrong", "said"), RULE_SLIPS, ids=[s[1] for s in RULE_SLIPS])
def test_an_exclusion_that_would_leave_out_nobody_is_refused(
    tmp_path: Path, right: str, wrong: str, said: str
) -> None:
    path = tmp_path / "mood.py"
    assert right in WITH_RULE
    path.write_text(WITH_RULE.replace(right, wrong, 1), "utf-8")

    with pytest.raises(DesignError) as refused:
        find_study(str(path)).experiment({})

    assert f"{path}, line 7" in str(refused.value)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    "column",
    [
        "comfort",
        "comfort_ms",
        "seen",
        "distance",
        "dwell_ms",
        "scene_frames",
        "attempt",
        "gaze_lost_01",
        "frames_dropped",
    ],
)
def test_an_exclusion_may_be_about_any_column_of_trials(tmp_path: Path, column: str) -> None:
    path = tmp_path / "mood.py"
    path.write_text(WITH_RULE.replace('"comfort_ms"', f'"{column}"'), "utf-8")

    assert find_study(str(path)).experiment({}).read


FORMER = {
    'Study("duel", unasked=("free",))': "'skip_after_block'",
    "from visavis import unopinionated": "'neutral_answer'",
    "from protocol.steps import Show": "docs/what-moved.md",
    "from visavis.boards import Ways": "docs/what-moved.md",
}


@pytest.mark.parametrize("line", FORMER)
def test_a_name_of_the_version_before_is_answered_with_the_new_one_or_where_it_stands(
    tmp_path: Path, line: str
) -> None:
    file = tmp_path / "duel.py"
    file.write_text(f"from visavis import Study\n{line}\n", "utf-8")
    with pytest.raises(DesignError, match=rf"duel\.py, line 2: .*{FORMER[line]}"):
        find_study(str(file))


def test_a_module_that_a_lab_lacks_is_no_matter_of_versions(tmp_path: Path) -> None:
    file = tmp_path / "duel.py"
    file.write_text("import no_such_module_here\n", "utf-8")
    with pytest.raises(DesignError) as problem:
        find_study(str(file))
    assert "moved" not in str(problem.value)
