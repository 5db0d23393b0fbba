import json

import pandas as pd
import pytest

from tests.experiments.stare.synthetic_rows import (
    analysed,
    anxiety_answers,
    study_rows,
    varied_rows,
)
from visavis.analysis.plots import write_figure
from visavis.analysis.report import ReportProvenance
from visavis.experiments.stare.study import experiment_of, study
from visavis.lab.errors import DataError
from visavis.results.intake import questionnaire
from visavis.results.outputs import write_study
from visavis.results.tables.column_types import column_type, with_column_types
from visavis.results.tables.dictionary import trial_columns

COLUMNS = trial_columns(experiment_of(), ())


def typed_trials(rows):
    return with_column_types(rows, COLUMNS)


def test_types_do_not_depend_on_the_data():
    full = pd.DataFrame({"switch_ns": [1], "before_on_at_onset": [True], "reason": ["x"]})
    empty = pd.DataFrame({"switch_ns": [None], "before_on_at_onset": [None], "reason": [None]})
    floats = pd.DataFrame({"switch_ns": [float("nan")], "dwell_ms": [3]})

    assert typed_trials(full).dtypes.equals(typed_trials(empty).dtypes)
    assert typed_trials(full).dtypes.astype(str).tolist() == ["Int64", "boolean", "string"]
    assert typed_trials(floats).dtypes.astype(str).tolist() == ["Int64", "Float64"]
    both = pd.concat([typed_trials(full), typed_trials(empty)])
    assert both.dtypes.equals(typed_trials(full).dtypes)


def test_nanoseconds_keep_every_digit_beside_missing_ones():
    exact = 2**60 + 1
    rows = pd.DataFrame({"clock_offset_ns": pd.Series([exact, None], dtype=object)})

    assert typed_trials(rows)["clock_offset_ns"].iloc[0] == exact


def test_type_of_a_column_follows_from_its_unit_and_name():
    types = {name: column_type(column) for name, column in COLUMNS.items()}

    assert types["before_lost_01"] == "Float64"
    assert types["raw_fixation_count"] == "Int64"
    assert types["is_practice"] == "boolean"
    assert types["trial_id"] == "string"


def test_words_in_a_column_of_numbers_are_refused():
    with pytest.raises(DataError, match="dwell_ms"):
        typed_trials(pd.DataFrame({"dwell_ms": ["long"]}))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A study's folder, and the figures that were written to it."""
    rows = study_rows(4)
    people = anxiety_answers(4).assign(vision=[1, 2, 3, 1], drift_deg=[0.1, 0.2, 0.3, 0.4])
    out = tmp_path_factory.mktemp("tables")
    analysis = analysed(rows, people, varied=varied_rows(rows))
    asked = [questionnaire(name, study.folders) for name in study.asks.questionnaires]
    figures = []

    def write(drawn, folder):
        figures.append(drawn)
        return write_figure(drawn, folder)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("visavis.results.outputs.write_figure", write)
        write_study(analysis, experiment_of(), asked, ReportProvenance("stare", "1", ""), out)
    return out, figures


@pytest.fixture(scope="module")
def folder(written):
    return written[0]


@pytest.mark.parametrize(
    "table", ["trials", "participants", "cell_means", "statistics", "sensitivity"]
)
def test_every_column_of_a_table_is_described(folder, table):
    described = json.loads((folder / f"{table}.json").read_text(encoding="utf-8"))

    assert list(described) == list(pd.read_csv(folder / f"{table}.csv").columns)
    assert all(entry["Description"] for entry in described.values())


def test_coded_answers_have_the_levels_of_the_questionnaire(folder):
    described = json.loads((folder / "participants.json").read_text(encoding="utf-8"))

    assert described["vision"]["Levels"]["2"] == "corrected with contact lenses"
    assert described["social_anxiety_total"]["Description"].endswith("0 to 144")
    assert described["age"]["Units"] == "years"


def test_a_figure_is_let_go_of_once_it_is_written(written):
    folder, figures = written

    assert len(figures) > 3
    assert [] == [d.name for d in figures if d.figure.axes]
    assert {d.name for d in figures} == {p.stem for p in (folder / "figures").glob("*.png")}
