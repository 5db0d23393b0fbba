"""Sessions that another program wrote are judged or refused in words, though checksums agree."""

from pathlib import Path

import pytest

from tests.recording.sessions import new_recorder, probe_manifest, record_session
from visavis.analysis.session_check import check_session
from visavis.lab.clock import SimClock
from visavis.lab.errors import DataError
from visavis.recording.folder import create_session
from visavis.recording.reader import Recording


def test_a_session_without_planned_blocks_is_judged_by_what_it_holds(tmp_path: Path) -> None:
    found = check_session(Recording(record_session(tmp_path, 2)))
    assert () == found.trials
    assert ["probe"] == [stream.stream for stream in found.streams]


@pytest.mark.parametrize("row", [{"status": "complete"}, {"trial_id": "T01", "status": ["x"]}])
def test_trials_that_no_session_writes_are_refused_by_the_session(
    tmp_path: Path, row: dict[str, object]
) -> None:
    clock, manifest = SimClock(), probe_manifest()
    trial = {"trial_id": "T01", "number": 1, "block": 0, "is_practice": False, "factors": {}}
    planned = {"blocks": [{"trials": [trial]}]}
    object.__setattr__(manifest, "plan", planned)
    with create_session(tmp_path, manifest) as folder:
        with new_recorder(folder, clock) as recorder:
            recorder.trial(row)
        with pytest.raises(DataError, match="ses-001: its trials or events hold what no session"):
            check_session(Recording(folder.path))
