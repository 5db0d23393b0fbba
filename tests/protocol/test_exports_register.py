"""What was made inside a study's folder is found there after the folder has moved."""

from pathlib import Path

from visavis.lab.clock import SimClock
from visavis.protocol.people.exports_register import ANALYSIS, register_export, registered_exports
from visavis.running.sessions.folder_check import study_problems


def test_a_moved_study_still_knows_what_was_made_in_it(tmp_path: Path) -> None:
    study, elsewhere = tmp_path / "here" / "stare", tmp_path / "out"
    (study / "derived").mkdir(parents=True)
    elsewhere.mkdir()
    inside, outside = study / "derived" / "trials.csv", elsewhere / "a.csv"
    inside.write_text("dwell_ms\n1\n", "utf-8")
    outside.write_text("dwell_ms\n1\n", "utf-8")
    register_export(study, SimClock(), ANALYSIS, study / "derived", ["S01B"], [inside])
    register_export(study, SimClock(), "parquet", elsewhere, ["S01B"], [outside])

    moved = tmp_path / "there" / "stare"
    moved.parent.mkdir()
    study.rename(moved)

    wheres = [export.where for export in registered_exports(moved)]
    assert [moved / "derived", elsewhere] == wheres
    assert () == study_problems(moved)
    (moved / "derived" / "trials.csv").write_text("dwell_ms\n2\n", "utf-8")
    (problem,) = study_problems(moved)
    assert "trials.csv is not as analysis wrote it" in problem
