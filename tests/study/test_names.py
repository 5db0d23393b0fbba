"""Nothing is planned that cannot be analysed: names and levels are refused before anything runs."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from visavis.analysis.statistics_report import table_of
from visavis.analysis.statistics_report.spelling import OneNameSpeltTwice, refuse_spellings
from visavis.lab.errors import DesignError, LabError
from visavis.protocol.plan.columns import ANALYSED_COLUMNS, ENGINE_COLUMNS
from visavis.protocol.plan.design import Factor
from visavis.recording.csv_file import write_csv
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.study_names import TABLES
from visavis.results.tables.dictionary import column_of_trial, undescribed_columns
from visavis.running.study_check import try_analysis
from visavis.study.declaration import Study
from visavis.study.names import changed_levels, is_name
from visavis.study.responses import Number
from visavis.study.trial import TrialScript
from visavis.testing import check_study

FILES = Path(__file__).with_name("unusable")
HEAD = "from visavis import *\n"
TRIAL = """
@study.trial
def trial(t):
    yield t.show(Scene("two_people", active="left"), seconds=0.2)
    yield t.ask(Rating("liking", 1, 5))
"""
R = shutil.which("Rscript") or ""
RNG = np.random.default_rng(43)


def opened_from(folder: Path, keywords: str, trial: str = TRIAL) -> OpenedStudy:
    path = folder / "own.py"
    path.write_text(f'{HEAD}study = Study("own", {keywords}, calibrate=False)\n{trial}', "utf-8")
    return find_study(str(path))


def problem_of(folder: Path, keywords: str, trial: str = TRIAL) -> str:
    """Return why a study is refused before anything runs; "" where it is not."""
    try:
        opened_from(folder, keywords, trial).experiment_to_run({})
    except LabError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", ["block", "number", "participant", "session", "status"])
def test_factor_with_the_name_of_a_column_of_trials_is_refused_when_its_file_is_read(
    name: str,
) -> None:
    with pytest.raises(DesignError, match=rf"factor_{name}\.py, line 3.*'{name}' is a column"):
        find_study(str(FILES / f"factor_{name}.py"))


def test_level_none_is_refused_when_its_file_is_read() -> None:
    with pytest.raises(DesignError, match=r"level_none\.py, line 3.*level None; levels are texts"):
        find_study(str(FILES / "level_none.py"))


def test_study_file_with_a_byte_order_mark_is_read() -> None:
    assert ("low", "high") == find_study(str(FILES / "saved_by_notepad.py")).study.factor(
        "cue"
    ).levels


def test_unit_of_a_number_is_a_text() -> None:
    study = find_study(str(FILES / "age.py"))
    with pytest.raises(DesignError, match=r"its unit is 0.*Number\(\"age\", low=0, high=100\)"):
        study.experiment_to_run({})
    assert (0, 100, "1") == ((n := Number("age", low=0, high=100)).low, n.high, n.unit)


TRIAL_NAMES = {c.name for c in (*ENGINE_COLUMNS, *ANALYSED_COLUMNS)} - {"part", "group"}


@pytest.mark.parametrize("derived", [False, True])
def test_no_column_of_any_table_can_be_called_like_a_factor(tmp_path: Path, derived: bool) -> None:
    names = sorted(n for n in {*TRIAL_NAMES, *TABLES} if is_name(n))
    for name in [*map(str, RNG.choice(names, 12)), "n", "is_simulated", "completed_01", "estimate"]:
        keywords = f'factors=[Factor("{name}", ["a", "b"])]'
        if derived:
            keywords = f'factors=[Factor("eyes", ["a", "b"])], derived={{"{name}": lambda f: "c"}}'
        assert f"{name!r} " in problem_of(tmp_path, keywords), name


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("liking", "a column of the answer liking"),
        ("liking_ms", "a column of the answer liking"),
        ("dwell_ms", "is a measure"),
        ("scene_active", "a column of a shown scene"),
        ("mine", "a column that the trial writes"),
        ("age", "a column of the table participants"),
    ],
)
def test_factor_called_like_what_the_study_measures_is_refused(
    tmp_path: Path, name: str, why: str
) -> None:
    keywords = (
        f'factors=[Factor("{name}", ["a", "b"])], measures=[dwell_on("active")], '
        'questionnaires=["demographics"]'
    )
    said = problem_of(tmp_path, keywords, f'{TRIAL}    t.row["mine"] = 1\n')
    assert why in said
    assert "own.py, line 2" in said


@pytest.mark.parametrize("name", ["if", "_hidden", "repeat", "TRUE", "T"])
def test_words_of_python_and_r_are_no_names_of_factors(tmp_path: Path, name: str) -> None:
    assert "Python or R" in problem_of(tmp_path, f'factors=[Factor("{name}", [1, 2])]')


def test_trial_and_answer_cannot_write_columns_of_every_trial(tmp_path: Path) -> None:
    factors = 'factors=[Factor("eyes", ["averted", "directed"])]'
    assert "writes 'status'" in problem_of(tmp_path, factors, f'{TRIAL}    t.row["status"] = 1\n')
    asks = TRIAL.replace('"liking"', '"reason"')
    assert "answer reason has the column 'reason'" in problem_of(tmp_path, factors, asks)


@pytest.mark.parametrize(
    "levels",
    [
        '["", "a"]',
        '[float("nan"), 1.0]',
        '[1, "1"]',
        '[True, "True"]',
        '["NA", "a"]',
        '["None", "a"]',
        '["nan", "a"]',
        '["TRUE", "a"]',
        '["T", "C"]',
        '["01", "b"]',
        '["1e3", "b"]',
        '["=a", "b"]',
        '[" a", "b"]',
        '["a\\n", "b"]',
        '["Inf", "b"]',
        '["0x1A", "b"]',
        '["1i", "b"]',
        '["Control", "control"]',
        '["1", "2.5"]',
        '[("a", 1), "b"]',
    ],
)
def test_level_that_no_table_brings_back_is_refused(tmp_path: Path, levels: str) -> None:
    assert "factor 'cue' has " in problem_of(tmp_path, f'factors=[Factor("cue", {levels})]')


@pytest.mark.parametrize(
    ("one", "other"),
    [("Control", "control"), ("far away", "faraway"), ("walk 1", "walk 01"), ("é", "e\u0301")],
)
def test_a_study_and_statistics_take_the_same_names_for_one(one: str, other: str) -> None:
    """A study refused case alone; statistics refused the others after all people had come."""
    table = table_of(pd.DataFrame({"cue": [one, other], "y": [1.0, 2.0]}))
    with pytest.raises(OneNameSpeltTwice):
        refuse_spellings(table, "cue")
    (problem,) = changed_levels("cue", [one, other])
    assert "differ by spelling alone" in problem


def random_level() -> str:
    letters = list("abcTFNAnull0123456789.eExi+-_ äß\"',;#")
    return "".join(RNG.choice(letters, RNG.integers(1, 5)))


@pytest.mark.skipif(not R, reason="R is not installed")
def test_levels_that_are_accepted_come_back_from_our_tables_in_pandas_and_r(tmp_path: Path) -> None:
    levels = list(dict.fromkeys(random_level() for _ in range(400)))
    levels += ["NA", "TRUE", "T", "nan", "1", "2.5", "None", "infinity", "a, b", "it's", "1d2"]
    accepted = [level for level in levels if not list(changed_levels("cue", [level]))]
    assert 100 < len(accepted)
    assert {"a, b", "it's", "1", "2.5"} <= set(accepted)
    for i, level in enumerate(accepted):
        write_csv(pd.DataFrame({"cue": [level]}), tmp_path / f"{i:03d}.csv")
    pandas = [str(pd.read_csv(tmp_path / f"{i:03d}.csv")["cue"][0]) for i in range(len(accepted))]
    assert accepted == pandas
    code = (
        'for (f in sort(list.files(".", "csv$"))) '
        'cat(as.character(read.csv(f, encoding = "UTF-8")$cue), "\\n", sep = "")'
    )
    r = subprocess.run(
        [R, "--encoding=UTF-8", "-e", code],
        cwd=tmp_path,
        capture_output=True,
        check=True,
        env={"LC_ALL": "C.UTF-8", "PATH": "/usr/bin:/bin:/usr/local/bin"},
    )
    assert accepted == r.stdout.decode().splitlines()


@pytest.mark.parametrize(
    ("keywords", "said"),
    [
        (
            'questionnaires=["demografics"]',
            "no questionnaire 'demografics'; did you mean 'demographics'",
        ),
        ('after_block=["ipqq"]', "no questionnaire 'ipqq'"),
        ('uses=["eye_traker"]', "no device 'eye_traker'; did you mean 'eye_tracker'"),
        ('cells=["eyez"]', "no factor within people 'eyez'; did you mean 'eyes'"),
        ('dressed_by="nowhere_at_all:dress"', "cannot be imported (ModuleNotFoundError"),
        ('sections=["nowhere_at_all:section"]', "cannot be imported (ModuleNotFoundError"),
    ],
)
def test_misspelt_name_is_refused_before_anything_runs(
    tmp_path: Path, keywords: str, said: str
) -> None:
    factors = 'factors=[Factor("eyes", ["averted", "directed"])]'
    problem = problem_of(tmp_path, f"{factors}, {keywords}")
    assert said in problem
    assert "own.py, line 2" in problem


def test_armband_that_the_study_does_not_open_is_refused_before_anything_runs(
    tmp_path: Path,
) -> None:
    keywords = 'factors=[Factor("side", ["left"])], uses=["armband_left_upper_arm"]'
    trial = TRIAL + '    yield t.vibrate("armband_left_uper_arm")\n'
    assert "did you mean 'armband_left_upper_arm'" in problem_of(tmp_path, keywords, trial)
    assert "" == problem_of(tmp_path, keywords, trial.replace("uper", "upper"))


def test_column_that_a_study_does_not_describe_is_no_agent_of_a_scene() -> None:
    columns = ["level_01", "scene_on_ns", "scene_off_ns", "scene_frames", "scene_active"]
    assert ("level_01",) == undescribed_columns(columns, {})
    assert "written by the trial" in column_of_trial("level_01", columns).description
    assert "plays 'active' in scene" in column_of_trial("scene_active", columns).description


def test_group_may_be_called_group() -> None:
    trial = [Factor("eyes", ["a", "b"])]
    for between, is_right in ((["group"], True), (["group", "kind_of"], False)):
        factors = [*trial, *(Factor(n, ["x", "y"], between=True) for n in between)]
        if is_right:
            assert "group" == Study("own", factors=factors).factor("group").name
        else:
            with pytest.raises(DesignError, match="'group' is a column"):
                Study("own", factors=factors)


def test_check_study_refuses_the_same_names() -> None:
    study = Study("own", factors=[Factor("estimate", ["a", "b"])], calibrate=False)

    @study.trial
    def trial(t: TrialScript):  # type: ignore[no-untyped-def]  # as users write it
        yield t.dark(0.1)

    with pytest.raises(DesignError, match="'estimate' is a column of the table statistics"):
        check_study(study)


@pytest.mark.parametrize(
    ("keywords", "said"),
    [
        ('exclusions={"max_trial_lost_01": 0.3}', "it takes a list.*limits by name are given to"),
        ('questionnaires="demographics"', "it takes a list"),
        ('measures=["dwell_ms"]', "measures holds 'dwell_ms', which is no Measure"),
        ("compare=(c for c in ())", "it takes a list"),
    ],
)
def test_keyword_that_takes_a_list_says_so(tmp_path: Path, keywords: str, said: str) -> None:
    with pytest.raises(DesignError, match=rf"own\.py, line 2: study own: .*{said}"):
        opened_from(tmp_path, f'factors=[Factor("eyes", ["averted"])], {keywords}')


def test_film_of_a_file_is_refused_with_what_a_film_takes(tmp_path: Path) -> None:
    factors = 'factors=[Factor("eyes", ["averted"])], on="browser"'
    trial = '@study.trial\ndef trial(t):\n    yield t.watch(Film("a.mp4", 2.0))\n'
    said = problem_of(tmp_path, factors, trial)
    assert "own.py, line 5" in said
    assert "a film shows a Scene and not 'a.mp4'" in said


def test_module_that_dresses_a_scene_is_imported_before_anything_runs(tmp_path: Path) -> None:
    factors = 'factors=[Factor("eyes", ["averted"])], dressed_by="own_dressing:picture"'
    (tmp_path / "own_dressing.py").write_text("import not_installed_here\n", "utf-8")
    assert "No module named 'not_installed_here'" in problem_of(tmp_path, factors)


def test_comparison_over_a_derived_factor_is_analysed_before_anybody_is_invited(
    tmp_path: Path,
) -> None:
    keywords = (
        'factors=[Factor("eyes", ["averted", "directed"]), Factor("side", ["left", "right"])], '
        'derived={"match": lambda f: "same" if (f["eyes"] == "averted") == (f["side"] == "left") '
        'else "other"}, cells=["eyes"], compare=[Compare("liking", within="match")]'
    )
    opened = opened_from(tmp_path, keywords)
    check_study(tmp_path / "own.py")
    try_analysis(opened, opened.experiment_to_run({}))


def test_what_would_fail_in_the_analysis_is_told_when_a_study_is_checked_or_locked(
    tmp_path: Path,
) -> None:
    trial = (
        TRIAL
        + """

@study.section
def mine(analysis, experiment):
    return analysis.finding("liking").outcome.p("eyes")
"""
    )
    keywords = (
        'factors=[Factor("eyes", ["averted", "directed"])], '
        'compare=[Compare("liking", within="eyes")]'
    )
    opened = opened_from(tmp_path, keywords, trial)
    said = r"could not be analysed: .*own\.py, line 12 in mine\(analysis=.*AttributeError"
    with pytest.raises(DesignError, match=said):
        check_study(tmp_path / "own.py")
    with pytest.raises(DesignError, match=said):
        try_analysis(opened, opened.experiment_to_run({}))
