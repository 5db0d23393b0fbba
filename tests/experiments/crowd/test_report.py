"""The report and the tables on disk: complete, marked, described, repeatable."""

import json
from dataclasses import replace
from io import StringIO

import pandas as pd
import pytest

from tests.experiments.crowd.synthetic_walks import tables, walks
from tests.experiments.crowd.tables import OPENED, analysed
from visavis.analysis.report import ReportProvenance, SessionSource
from visavis.experiments.crowd.columns import TRIALS
from visavis.experiments.crowd.figures_walks import walks_figure
from visavis.lab.errors import DataError
from visavis.results.outputs import write_study
from visavis.results.time_course import TIME_COURSE
from visavis.results.unusual import VIEWS, view_name

PROVENANCE = ReportProvenance("crowd", "1", "virtual time", commands=("visavis analyse crowd",))


def written(folder, walked=None, provenance=PROVENANCE):
    """Write a study's analysis and return its report; six people by default."""
    return write(tables(walks(6) if walked is None else walked), folder, provenance)


def write(study_tables, folder, provenance=PROVENANCE, make_views=None):
    """Write the analysis of a study's tables and return its report."""
    analysis = analysed(study_tables, n_permutations=19, n_splits=5)
    groups = {"group": list(analysis.levels["group"])} if "group" in analysis.levels else {}
    experiment = OPENED.experiment(groups)
    return write_study(analysis, experiment, [], provenance, folder, make_views=make_views)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return written(tmp_path_factory.mktemp("study"))


def test_the_report_names_rule_numbers_and_that_nobody_took_part(report):
    text = report.read_text(encoding="utf-8")
    assert "SIMULATED DATA" in text
    assert "rule volume, surface characters" in text
    assert "71.00 (29.20)" in text
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
    for name in ("trials", "collisions", "crossings", "cells", "pulses", "blocks"):
        table = pd.read_csv(report.parent / f"{name}.csv")
        assert len(table) == len(pd.read_parquet(report.parent / f"{name}.parquet"))


def test_what_was_added_beside_published_measures_stands_in_tables_and_means(report):
    own = ("shoulders_to_gap_narrow_deg", "crossings_narrow")
    for name, columns in (("trials", own), ("cell_means", own[:1])):
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
        "shoulders_to_gap_narrow_deg",
    ],
)
def test_columns_of_walks_are_described_with_their_unit(column):
    assert {c.name: c.unit for c in TRIALS}[column]


def test_tables_with_volumes_name_their_rule(report):
    for name in ("trials", "collisions", "cell_means", "statistics", "contrasts"):
        table = pd.read_csv(report.parent / f"{name}.csv")
        assert {"volume"} == set(table["measure_rule"])
        assert {"characters"} == set(table["measure_surface"])


def test_pictures_with_volumes_name_their_rule(report):
    text = report.read_text(encoding="utf-8")
    for title in ("Largest common volume by block", "Collisions by body part"):
        caption = text[text.index(title) :][:200_000].partition("</figcaption>")[0]
        assert "rule volume, surface characters" in caption


def test_figures_of_paths_stand_for_every_configuration(report):
    names = {p.name for p in (report.parent / "figures").glob("*.svg")}
    assert {"paths_1.svg", "paths_2.svg", "similarity.svg", "collisions_by_condition.svg"} <= names


def test_single_walks_stand_from_above_with_their_contacts_and_each_opens_its_page(of_three):
    report, view_trials = of_three
    text = report.read_text(encoding="utf-8")
    assert (report.parent / "figures" / "walks.svg").exists()
    assert ["T01", "T11", "T21"] == [one.trial_id for one in view_trials]
    section = text.partition('id="walks"')[2].partition("</section")[0]
    for one in view_trials:
        assert f"views/{one.participant}_ses-001.html#trial={one.trial_id}" in section


def test_a_walk_of_the_median_length_stands_for_its_block():
    walked = walks(3, configurations=1)
    for walk, path_m in zip(walked, [30.0, 31, 29, 40, 33, 28, 20, 32, 40], strict=True):
        walk.row["path_m"] = path_m
    analysis = analysed(tables(walked), n_permutations=19, n_splits=5)
    figure, shown = walks_figure(analysis, analysis.further[0])
    assert ["S00", "S02", "S00"] == [one.participant for one in shown]
    data = pd.read_csv(StringIO(figure.data))
    met = data[data["is_of"] == "collision"]
    assert [[0.5, -0.5]] == met[["x_m", "z_m"]].drop_duplicates().to_numpy().tolist()
    ways = data[data["is_of"] == "way"].drop_duplicates(["participant", "trial_id"])
    assert [(one.participant, one.trial_id) for one in shown] == list(
        ways[["participant", "trial_id"]].itertuples(index=False, name=None)
    )
    assert "NoHaptic1: 30.0 m, 1 collision, the median length of its block" == shown[0].why


def test_looks_at_people_over_time_stand_by_block_where_gaze_was_recorded(of_three):
    report, _ = of_three
    assert "share of usable gaze on people" in report.read_text(encoding="utf-8")
    looks = pd.read_csv(report.parent / "time_course.csv")
    assert {"NoHaptic1": 6, "Haptic": 6, "NoHaptic2": 6} == looks[
        "condition"
    ].value_counts().to_dict()
    assert {0.25} == set(looks["on_agent_01"])


def test_one_person_still_gets_a_report(tmp_path):
    assert "not tested" in written(tmp_path, walks(1)).read_text(encoding="utf-8")


def test_a_study_with_everybody_left_out_says_so():
    walked = walks(4)
    for walk in walked:
        walk.row["came_back"] = False
    with pytest.raises(DataError, match="did not come back"):
        analysed(tables(walked))


@pytest.fixture(scope="module")
def of_three(tmp_path_factory):
    """Return the report on three people who took part, one of whose recordings is not whole, and
    the walks whose pages it view_trials for; gaze was recorded.
    """
    walked = walks(3)
    for walk in walked:
        walk.row["is_simulated"] = False
    study_tables = tables(walked)
    key = ["participant", "session", "trial_id", "attempt", "condition"]
    steps = [study_tables["trials"][key].assign(t_ms=t, on_agent_01=0.25) for t in (125.0, 375.0)]
    study_tables[TIME_COURSE] = pd.concat(steps)
    broken = SessionSource("S00", "ses-001", "2026-01-01", "crashed", "0" * 64, "abc")
    provenance = replace(PROVENANCE, sessions=(broken,))
    view_trials = []

    def make_views(folder, trials):
        view_trials.extend(trials)
        (folder / VIEWS).mkdir()
        for one in trials:
            (folder / VIEWS / view_name(one.participant, one.session)).touch()

    folder = tmp_path_factory.mktemp("three")
    return write(study_tables, folder, provenance, make_views=make_views), view_trials


def test_real_walks_are_not_marked_as_simulated(of_three):
    report, _ = of_three
    assert "SIMULATED" not in report.read_text(encoding="utf-8")
    assert {False} == set(pd.read_csv(report.parent / "statistics.csv")["is_simulated"])


def test_recordings_that_are_not_whole_are_named(of_three):
    report, _ = of_three
    assert "crashed" in report.read_text(encoding="utf-8").partition('id="provenance"')[2]


def test_the_control_group_is_counted_tested_apart_and_compared(tmp_path):
    walked = [*walks(4, group="haptics"), *walks(3, 5, effect=False, group="control")]
    text = written(tmp_path, walked).read_text(encoding="utf-8")
    assert "7 of 7 (4 haptics, 3 control)" in text
    means = pd.read_csv(tmp_path / "cell_means.csv")
    assert {"haptics": 12, "control": 9} == means["group"].value_counts().to_dict()
    tests = set(pd.read_csv(tmp_path / "statistics.csv")["comparison"])
    assert {
        "speed_m_s by condition (haptics)",
        "speed_m_s by condition (control)",
        "speed_m_s by condition × group",
    } <= tests
    assert (tmp_path / "figures" / "speed_m_s_by_condition_control.svg").exists()
