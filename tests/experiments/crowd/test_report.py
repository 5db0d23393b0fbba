"""The report and the tables on disk: complete, marked, described, repeatable."""

import json
from dataclasses import replace

import pandas as pd
import pytest

from analysis.report import ReportProvenance, SessionSource
from experiments.crowd.analysis_parameters import AnalysisParameters
from experiments.crowd.columns import TRIALS
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


def test_what_was_added_beside_published_measures_stands_in_tables_and_means(report):
    own = ("shoulders_to_gap_narrow_deg", "crossings_narrow")
    for name, columns in (("trials", own), ("condition_means", own[:1])):
        table = pd.read_csv(report.parent / f"{name}.csv")
        described = json.loads((report.parent / f"{name}.json").read_text(encoding="utf-8"))
        assert set(columns) <= set(table.columns)
        for column in columns:
            assert "as the session recorded it" != described[column]["Description"]


@pytest.mark.parametrize(
    "column",
    [
        "tracked_s",
        "collisions_per_tracked_min",
        "frozen_segments",
        "frozen_segments_measured",
        "shoulders_to_gap_narrow_deg",
    ],
)
def test_columns_of_walks_are_described_with_their_unit(column):
    assert {c.name: c.unit for c in TRIALS}[column]


def test_tables_with_volumes_name_their_rule(report):
    for name in ("trials", "collisions", "condition_means", "statistics"):
        table = pd.read_csv(report.parent / f"{name}.csv")
        assert {"volume"} == set(table["measure_rule"])
        assert {"fine"} == set(table["measure_surface"])


def test_pictures_with_volumes_name_their_rule(report):
    text = report.read_text(encoding="utf-8")
    for title in ("The published measures by block", "Collisions by body part", "Further measures"):
        caption = text[text.index(title) :][:200_000].partition("</figcaption>")[0]
        assert "volume (fine)" in caption


def test_figures_of_paths_stand_for_every_configuration(report):
    names = {p.name for p in (report.parent / "figures").glob("*.svg")}
    assert {"paths_1.svg", "paths_2.svg", "similarity.svg", "blocks.svg"} <= names


def test_one_person_still_gets_a_report(tmp_path):
    assert "not tested" in written(tmp_path, people=1).read_text(encoding="utf-8")


def test_a_study_with_everybody_left_out_still_gets_a_report(tmp_path):
    walked = walks(4)
    for walk in walked:
        walk.row["came_back"] = False
    report = write_study(
        tables(walked), {}, tmp_path, is_simulated=True, provenance=PROVENANCE, parameters=QUICK
    )
    text = report.read_text(encoding="utf-8")
    assert "0 of 4" in text
    assert "did not come back" in text


def test_real_walks_are_not_marked_as_simulated(tmp_path):
    walked = walks(3)
    for walk in walked:
        walk.row["is_simulated"] = False
    report = write_study(
        tables(walked), {}, tmp_path, is_simulated=False, provenance=PROVENANCE, parameters=QUICK
    )
    text = report.read_text(encoding="utf-8")
    assert "SIMULATED" not in text
    assert {False} == set(pd.read_csv(tmp_path / "statistics.csv")["is_simulated"])


def test_recordings_that_are_not_whole_are_named(tmp_path):
    broken = SessionSource("S00", "ses-001", "2026-01-01", "crashed", "0" * 64, "abc")
    walked = walks(3)
    report = write_study(
        tables(walked),
        {},
        tmp_path,
        is_simulated=True,
        provenance=replace(PROVENANCE, sessions=(broken,)),
        parameters=QUICK,
    )
    section = report.read_text(encoding="utf-8").partition('id="exclusions"')[2]
    assert "Recordings that are not whole" in section
    assert "crashed" in section.partition("Methods")[0]


def test_the_control_group_is_counted_and_its_volumes_name_their_rule(tmp_path):
    walked = [*walks(4, group="haptics"), *walks(3, 5, effect=False, group="control")]
    report = write_study(
        tables(walked), {}, tmp_path, is_simulated=True, provenance=PROVENANCE, parameters=QUICK
    )
    text = report.read_text(encoding="utf-8")
    assert "7 of 7 (4 haptics, 3 control)" in text
    section = text.partition('id="control"')[2].partition("</section>")[0]
    assert "volume (fine)" in section
    means = pd.read_csv(tmp_path / "condition_means.csv")
    assert {"haptics": 12, "control": 9} == means["group"].value_counts().to_dict()
