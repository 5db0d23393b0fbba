import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser

import pandas as pd
import pytest

from tests.experiments.stare.synthetic_rows import (
    analysed,
    anxiety_answers,
    study_rows,
    varied_rows,
)
from visavis.analysis.report import ReportProvenance, SessionSource
from visavis.experiments.stare.study import experiment_of, study
from visavis.lab.errors import DataError, UsageError
from visavis.results.intake import questionnaire
from visavis.results.opened_study import OpenedStudy
from visavis.results.outputs import write_study
from visavis.results.quality import quality_of
from visavis.results.report.family_report import agreement_table
from visavis.results.report.methods import method_paragraphs
from visavis.results.report.reporting_list import OPEN, SETUP_ITEMS, reporting_table
from visavis.results.report.study_report import exclusion_counts_of

PROVENANCE = ReportProvenance(
    study="stare",
    study_version="1",
    data_date="2026-03-02 to 2026-03-19",
    versions={"visavis": "0.1.0"},
    sessions=(SessionSource("S01", "1", "2026-03-02T10:00:00+01:00", "complete", "ab" * 32),),
    commands=("visavis analyse study",),
)


def write(folder, participants=6, rows=None, varied=None, is_simulated=True):
    rows = study_rows(participants) if rows is None else rows
    rows = rows.assign(is_simulated=is_simulated)
    analysis = analysed(rows, anxiety_answers(participants), varied=varied)
    asked = [questionnaire(name, study.folders) for name in study.asks.questionnaires]
    write_study(analysis, experiment_of(), asked, PROVENANCE, folder, study.report.setup)
    return analysis


def test_agreement_of_simulated_people_is_called_no_evidence():
    analysis = analysed(study_rows(6), anxiety_answers(6))
    for is_simulated, expected in ((True, 1), (False, 0)):
        table = agreement_table(replace(analysis, is_simulated=is_simulated))
        assert table is not None
        assert expected == table.note.count("simulated and fitted to the published study")


class Words(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.parts: list[str] = []

    def handle_data(self, data):
        self.parts.append(data)


@cache  # many tests read the words of the same page
def words_of(html: str) -> str:
    parser = Words()
    parser.feed(html)
    return " ".join(parser.parts)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("study")


@pytest.fixture(scope="module")
def analysis(folder):
    rows = study_rows(8)
    rows.loc[4, "status"], rows.loc[4, "reason"] = "interrupted", "tracker silent"
    rows.loc[5, "lost_01"] = 0.8
    return write(folder, 8, rows, varied_rows(rows))


@pytest.fixture(scope="module")
def html(analysis, folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def test_verdict_comes_before_any_table(html):
    text = words_of(html)

    assert "Stare-in-the-crowd effect:" in text
    assert html.index("Stare-in-the-crowd effect:") < html.index("<table")


def test_results_name_conditions_and_units_in_words(html):
    text = " ".join(words_of(html).split())

    assert "Dwell time (ms), averted-then-directed" in text
    assert "of averted minus directed, n = 8" in text
    assert "Dwell time, AD" not in text
    assert "Means of further measures" not in text


def test_differences_are_drawn_as_tables_tell_them(html):
    text = " ".join(words_of(html).split())

    assert "the first level minus the second as in the tables" in text
    assert "A − D" in text
    assert "D − A " not in text


def test_answers_are_told_by_question_and_scored_questionnaires_by_score(tmp_path):
    people = anxiety_answers(4).assign(vr_experience=[1, 1, 3, 5], age=[24, 25, 31, 40])
    people["social_anxiety_fear"] = [20.0, 30.0, 25.0, 25.0]
    people["phone_overheard.fear"] = [0, 1, 1, 3]
    asked = [questionnaire(name, study.folders) for name in study.asks.questionnaires]
    rows = study_rows(4).assign(is_simulated=True)
    write_study(
        analysed(rows, people), experiment_of(), asked, PROVENANCE, tmp_path, study.report.setup
    )
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    text = " ".join(words_of(html).split())

    assert "Age 30.0 (7.3) years." in text
    assert "experience with virtual reality do you have? none 2, some 1, almost daily 1." in text
    assert re.search(r"Social anxiety \(.*?\): scores \d rows? Score Mean \(SD\) People", text)
    assert "fear 25.0 (4.1) 4" in text
    assert re.search(r"every answer, 1 question .*? not at all 1, a little 2, very much 1\.", text)
    assert "Phone overheard.fear" not in text


def test_report_is_one_file_without_requests(html):
    assert not re.search(r'(?:src|href)="(?!#|data:)', html)
    for word in ("<script ", "fetch(", "<link", "@import", "url(http"):
        assert word not in html


def test_simulated_report_marks_page_and_every_figure(html, folder):
    assert 'class="banner"' in html
    figures = len(re.findall(r"<figure(?: data-csv=[^>]*)?>", html))
    assert figures == len(list((folder / "figures").glob("*.svg"))) == 9
    marks = re.findall(r'id="[\w-]*simulated-watermark"', html)
    assert figures == len(marks)


@pytest.mark.slow  # a browser
def test_the_report_prints_on_ten_pages(analysis, folder, browser):
    page = browser.new_page()
    page.goto((folder / "report.html").as_uri())
    sheets = page.pdf(format="A4", prefer_css_page_size=True)
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", sheets)) <= 10


@pytest.fixture(scope="module")
def of_three(tmp_path_factory):
    """Return the folder of a report on three people who took part."""
    made = tmp_path_factory.mktemp("three")
    write(made, 3, is_simulated=False)
    return made


def test_real_report_has_no_mark(of_three):
    text = (of_three / "report.html").read_text(encoding="utf-8")

    assert "SIMULATED" not in text.replace("watermark", "")
    assert "simulated-watermark" not in text


def test_identifiers_are_unique(html):
    identifiers = re.findall(r'\bid="([^"]+)"', html)

    assert len(identifiers) == len(set(identifiers))


def test_no_table_shows_an_undefined_number(html):
    text = words_of(html)

    assert not re.search(r"\b(nan|NaN|None|inf)\b", text)


def test_few_participants_give_a_whole_report_without_undefined_numbers(tmp_path, of_three):
    write(tmp_path, 1)
    for folder in (tmp_path, of_three):
        text = words_of((folder / "report.html").read_text(encoding="utf-8"))
        assert not re.search(r"\b(nan|NaN|None|inf)\b", text)
        assert ("Stare-in-the-crowd effect: not tested" in text) == (folder == tmp_path)


def test_study_without_a_usable_trial_is_not_analysed_and_says_why(tmp_path):
    with pytest.raises(DataError, match="216 trials: 100% lost"):
        write(tmp_path, 3, study_rows(3).assign(lost_01=1.0))


def test_everything_written_is_the_same_the_second_time(tmp_path, of_three):
    write(tmp_path, 3, is_simulated=False)
    first = sorted(p for p in of_three.rglob("*") if p.is_file())

    assert len(first) > 20
    for one in first:
        two = tmp_path / one.relative_to(of_three)
        assert one.read_bytes() == two.read_bytes(), one.name


def test_interruption_and_exclusion_are_listed(html):
    text = words_of(html)

    assert "tracker silent" in text
    assert "1 trial: share of the trial without usable gaze above 0.3" in text


def test_reporting_list_leaves_open_what_nobody_recorded(html, analysis):
    quality = quality_of(analysis, {"eye_tracker": "Pupil Core", **study.report.setup})
    table = reporting_table(exclusion_counts_of(analysis), quality, PROVENANCE)
    cells = [c for row in table.rows for c in row[1:]]
    texts = [c if isinstance(c, str) else c.text for c in cells]

    # viewing is the study's own answer
    assert words_of(html).count(OPEN) == len(SETUP_ITEMS) - 1
    assert "Pupil Core" in texts
    assert sum(t.startswith(OPEN) for t in texts) == len(SETUP_ITEMS) - 2


@cache
def analysis_of_four(**settings):
    return analysed(study_rows(4), anxiety_answers(4), **settings)


def methods(parameters=None, **settings):
    analysis = analysis_of_four(**settings)
    paragraphs = method_paragraphs(analysis, study_experiment(parameters or {}))
    return " ".join(" ".join(paragraphs).split())


def study_experiment(parameters):
    return OpenedStudy(study).experiment(parameters)


def test_methods_are_written_from_the_thresholds_in_force():
    text = methods(max_trial_lost_01=0.4, alpha=0.01)

    assert "share of the trial without usable gaze (max_trial_lost_01) above 0.4" in text
    assert ".01/30 = .000333" in text


def test_methods_tell_of_shares_and_looks_as_a_reader_thinks_of_them():
    text = methods()

    assert "A look of 0 ms" not in text
    assert "where nobody looked, the change came at 0.5 of the trial's 16 s" in text


def test_methods_state_the_measures_thresholds_and_the_rules_of_samples():
    text = methods()

    for part in ("1.0°", "150 ms", "75 ms", ".05/30 = .00167", "above 2.5"):
        assert part in text
    assert "confidence below 0.6" in text
    assert "sorted in" in text


def test_methods_are_written_from_the_plans_parameters():
    text = methods({"trial_s": 8.0, "repetitions": 3, "switch_at_01": 0.25, "pad_deg": 0.5})

    assert "Every combination came 3 times: 108 trials" in text
    assert "the change came at 0.25 of the trial's 8 s" in text
    assert "angular padding of 0.5°" in text


def test_tables_carry_the_simulation_mark_and_the_verdicts(analysis, folder):
    tables = {p.name: pd.read_csv(p) for p in folder.glob("*.csv")}

    assert {"trials.csv", "participants.csv", "statistics.csv", "cell_means.csv"} <= set(tables)
    assert all(t["is_simulated"].all() for t in tables.values())
    statistics = tables["statistics.csv"]
    assert statistics["sentence"].notna().all()
    main = statistics[statistics["family"] == "conditions"]
    assert len(main) == 30
    assert main["threshold"].tolist() == pytest.approx([0.05 / 30] * 30)
    assert main["effect_ci_low"].notna().all()


def test_trials_say_whether_they_were_analysed(analysis, folder):
    trials = pd.read_csv(folder / "trials.csv")
    parquet = pd.read_parquet(folder / "trials.parquet")

    assert trials["is_analysed"].sum() == len(analysis.selection.counted)
    assert not trials.loc[[4, 5], "is_analysed"].any()
    assert len(parquet) == len(trials)


def test_participants_table_joins_quality_and_answers(analysis, folder):
    people = pd.read_csv(folder / "participants.csv")

    assert people["participant"].tolist() == [f"S{i:02d}" for i in range(1, 9)]
    assert people["social_anxiety_total"].notna().all()
    assert people["accuracy_deg"].notna().all()


def test_unwritable_folder_gives_a_clear_error(tmp_path):
    (tmp_path / "taken").write_text("x")

    with pytest.raises(UsageError, match="choose a"):
        write(tmp_path / "taken", 3)
