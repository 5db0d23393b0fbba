"""The list of real recordings names bytes and licence of each, and refuses other bytes."""

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.tracker_files import fetched, judged, tracker_files
from visavis.analysis.gaze.import_report import FORMATS
from visavis.lab.errors import LabError


def test_the_list_names_ten_trackers_by_commit_bytes_and_licence() -> None:
    files = tracker_files()
    assert 10 <= len({file.tracker for file in files})
    for file in files:
        assert (40, 64) == (len(file.commit), len(file.sha256))
        assert file.licence
        assert file.rows > 0
        assert file.format in FORMATS
        assert file.address.startswith("https://raw.githubusercontent.com/")
        assert " " not in file.address


def test_a_file_of_other_bytes_is_refused_and_one_that_lacks_rows_is_told(tmp_path: Path) -> None:
    file = next(file for file in tracker_files() if file.tracker == "GazeBase")
    with pytest.raises(LabError, match="--fetch gets it from https://"):
        fetched(file, tmp_path, may_fetch=False)
    path = file.stored_in(tmp_path)
    path.parent.mkdir(parents=True)
    path.write_text("n,x,y,val\n0,1.5,1.5,0\n1,1.5,1.5,0\n", encoding="utf-8")
    with pytest.raises(LabError, match="the list says"):
        fetched(file, tmp_path, may_fetch=False)
    own = replace(file, sha256=hashlib.sha256(path.read_bytes()).hexdigest())
    assert path == fetched(own, tmp_path, may_fetch=False)
    assert [f"2 rows, {file.rows} counted"] == judged(own, path)["problems"]
