"""The report and the tables on disk: complete, marked, described, repeatable."""

import json

import pandas as pd
import pytest

from analysis.report import ReportProvenance
from experiments.crowd.analysis_parameters import AnalysisParameters
from experiments.crowd.study_outputs import write_study
from tests.experiments.crowd.synthetic_walks import tables, walks

QUICK = AnalysisParameters(n_permutations=19, n_splits=5)
PROVENANCE = ReportProvenance("crowd", "1", "virtual time", commands=("visavis analyse crowd",))


def written(folder, people=6):
    walked = walks(people)
    tracks = {(w.row["participant"], w.row["trial_id"]): w.track_m for w in walked}
    return write_study(
        tables(walked), tracks, folder, is_simulated=True, provenance=PROVENANCE, parameters=QUICK
    )


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return written(tmp_path_factory.mktemp("study"))


def test_the_report_names_rule_numbers_and_that_nobody_took_part(report):
    text = report.read_text(encoding="utf-8")
    assert "SIMULATED DATA" in text
    assert "volume (fine)" in text
    assert "71.0 (29.2)" in text
    assert ".847 (0.048)" in text or "0.847 (0.048)" in text
    assert "Equal sizes, other people" in text
    assert text.count("simulated-watermark") >= 8


def test_every_table_is_marked_and_every_column_described(report):
    names = {p.stem for p in report.parent.glob("*.csv")}
    assert {"trials", "collisions", "crossings", "cells", "statistics", "similarity"} <= names
    for path in report.parent.glob("*.csv"):
        table = pd.read_csv(path)
        described = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        assert list(described) == list(table.columns)
        assert all(entry["Description"] for entry in described.values())
        assert "is_simulated" in table.columns
        assert len(table) == len(pd.read_parquet(path.with_suffix(".parquet")))


def test_tables_with_volumes_name_their_rule(report):
    for name in ("trials", "collisions"):
        assert {"volume"} == set(pd.read_csv(report.parent / f"{name}.csv")["measure_rule"])


def test_figures_of_paths_stand_for_every_configuration(report):
    names = {p.name for p in (report.parent / "figures").glob("*.svg")}
    assert {"paths_1.svg", "paths_2.svg", "similarity.svg", "blocks.svg"} <= names


def test_one_person_still_gets_a_report(tmp_path):
    assert "not tested" in written(tmp_path, people=1).read_text(encoding="utf-8")
