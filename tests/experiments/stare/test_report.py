import re
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest

from analysis.report import ReportProvenance, SessionSource
from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.figures import TrialExample
from experiments.stare.methods_text import method_paragraphs
from experiments.stare.report import kept_of
from experiments.stare.scene import distances
from experiments.stare.study_outputs import analyse_study
from lab.errors import UsageError
from tests.experiments.stare.synthetic_rows import anxiety_answers, study_rows, varied_rows
from visavis.quality import quality_of_trials
from visavis.reporting_list import OPEN, SETUP_ITEMS, reporting_table

PROVENANCE = ReportProvenance(
    study="stare",
    study_version="1",
    data_date="2026-03-02 to 2026-03-19",
    versions={"visavis": "0.1.0"},
    sessions=(SessionSource("S01", "1", "2026-03-02T10:00:00+01:00", "complete", "ab" * 32),),
    commands=("visavis analyse study",),
)


def write(folder, participants=6, **options):
    rows = options.pop("rows", None)
    rows = study_rows(participants) if rows is None else rows
    arguments = {"is_simulated": True, "provenance": PROVENANCE} | options
    return analyse_study(rows, anxiety_answers(participants), folder, **arguments)


class Words(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.parts: list[str] = []

    def handle_data(self, data):
        self.parts.append(data)


def words_of(html: str) -> str:
    parser = Words()
    parser.feed(html)
    return " ".join(parser.parts)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    rows = study_rows(8)
    rows.loc[4, "status"], rows.loc[4, "reason"] = "interrupted", "tracker silent"
    rows.loc[5, "lost_01"] = 0.8
    t_ms = np.arange(0, 16000, 8.0)
    example = TrialExample(
        "S01, T01", t_ms, np.abs(30 * np.sin(t_ms / 900)), 4.0, [(100.0, 300.0, True)], 5000.0
    )
    return write(
        tmp_path_factory.mktemp("study"),
        8,
        rows=rows,
        sensitivity_rows=varied_rows(rows),
        example=example,
    )


@pytest.fixture(scope="module")
def html(written):
    return written.report.read_text(encoding="utf-8")


def test_verdict_comes_before_any_table(html):
    text = words_of(html)

    assert "Stare-in-the-crowd effect:" in text
    assert html.index("Stare-in-the-crowd effect:") < html.index("<table")


def test_report_is_one_file_without_requests(html):
    assert not re.search(r'(?:src|href)="(?!#|data:)', html)
    for word in ("<script", "<link", "@import", "url(http"):
        assert word not in html


def test_simulated_report_marks_page_and_every_figure(html, written):
    assert 'class="banner"' in html
    figures = html.count("<figure>")
    assert figures == len(written.figures) // 2 == 8
    marks = re.findall(r'id="[\w-]*simulated-watermark"', html)
    assert figures == len(marks)


def test_real_report_has_no_mark(tmp_path):
    rows = study_rows(4).drop(columns="is_simulated")
    text = write(tmp_path, 4, rows=rows, is_simulated=False).report.read_text(encoding="utf-8")

    assert "SIMULATED" not in text.replace("watermark", "")
    assert "simulated-watermark" not in text


def test_identifiers_are_unique(html):
    identifiers = re.findall(r'\bid="([^"]+)"', html)

    assert len(identifiers) == len(set(identifiers))


def test_no_table_shows_an_undefined_number(html):
    text = words_of(html)

    assert not re.search(r"\b(nan|NaN|None|inf)\b", text)


@pytest.mark.parametrize("participants", [1, 3])
def test_few_participants_give_a_whole_report_without_undefined_numbers(tmp_path, participants):
    text = words_of(write(tmp_path, participants).report.read_text(encoding="utf-8"))

    assert not re.search(r"\b(nan|NaN|None|inf)\b", text)
    if participants < 3:
        assert "Stare-in-the-crowd effect: not tested" in text


def test_report_without_a_usable_trial_says_so(tmp_path):
    rows = study_rows(3)
    rows["lost_01"] = 1.0
    text = words_of(write(tmp_path, 3, rows=rows).report.read_text(encoding="utf-8"))

    assert "0 of 3" in text
    assert "not tested" in text


def test_everything_written_is_the_same_the_second_time(tmp_path):
    first, second = (write(tmp_path / name, 2) for name in ("a", "b"))

    for one, two in zip(
        (first.report, *first.tables, *first.figures),
        (second.report, *second.tables, *second.figures),
        strict=True,
    ):
        assert one.read_bytes() == two.read_bytes(), one.name


def test_interruption_and_exclusion_are_listed(html):
    text = words_of(html)

    assert "tracker silent" in text
    assert "80 % lost" in text


def test_reporting_list_leaves_open_what_nobody_recorded(html, written):
    found = written.analysis
    quality = quality_of_trials(
        found.trials,
        found.selection.complete,
        max_trial_lost_01=0.3,
        facts={"eye_tracker": "Pupil Core", "distances": distances()},
    )
    cells = [
        c for row in reporting_table(kept_of(found), quality, PROVENANCE).rows for c in row[1:]
    ]
    texts = [c if isinstance(c, str) else c.text for c in cells]

    assert words_of(html).count(OPEN) == len(SETUP_ITEMS) - 1  # distances are the study's own
    assert "Pupil Core" in texts
    assert texts.count(OPEN) == len(SETUP_ITEMS) - 2


def test_methods_are_written_from_the_parameters():
    text = " ".join(method_paragraphs(AnalysisParameters(max_trial_lost_01=0.4, alpha=0.01)))

    assert "more than 40 % of its time" in text
    assert ".01/30 = .000333" in text


def test_methods_state_the_measures_thresholds():
    text = " ".join(method_paragraphs(AnalysisParameters()))

    for part in ("1.0°", "150 ms", "75 ms", ".05/30 = .00167", "2.5°"):
        assert part in text


def test_tables_carry_the_simulation_mark_and_the_verdicts(written):
    tables = {p.name: pd.read_csv(p) for p in written.tables if p.suffix == ".csv"}

    assert {"trials.csv", "participants.csv", "statistics.csv", "condition_means.csv"} <= set(
        tables
    )
    assert all(t["is_simulated"].all() for t in tables.values())
    statistics = tables["statistics.csv"]
    assert statistics["sentence"].notna().all()
    main = statistics[statistics["family"] == "conditions"]
    assert len(main) == 30
    assert main["threshold"].tolist() == pytest.approx([0.05 / 30] * 30)
    assert main["effect_ci_low"].notna().all()


def test_trials_say_whether_they_were_analysed(written):
    trials = pd.read_csv(next(p for p in written.tables if p.name == "trials.csv"))
    parquet = pd.read_parquet(next(p for p in written.tables if p.suffix == ".parquet"))

    assert trials["is_analysed"].sum() == written.analysis.selection.flow.analysed
    assert not trials.loc[[4, 5], "is_analysed"].any()
    assert len(parquet) == len(trials)


def test_participants_table_joins_quality_and_answers(written):
    people = pd.read_csv(next(p for p in written.tables if p.name == "participants.csv"))

    assert people["participant"].tolist() == [f"S{i:02d}" for i in range(1, 9)]
    assert people["social_anxiety_total"].notna().all()
    assert people["accuracy_deg"].notna().all()


def test_unwritable_folder_gives_a_clear_error(tmp_path):
    (tmp_path / "taken").write_text("x")

    with pytest.raises(UsageError, match="choose a"):
        write(tmp_path / "taken", 3)
