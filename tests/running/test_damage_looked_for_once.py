"""A session's files are looked through for damage once, before it is measured."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from tests.sessions import STUDIES, perform
from visavis.lab.errors import DataError
from visavis.recording import reader
from visavis.recording.durable import sha256_of
from visavis.recording.integrity import DAMAGED_STATUS, TrialDamage, damage_of
from visavis.recording.manifest import read_manifest, write_manifest
from visavis.recording.reader import Recording
from visavis.running.sessions.damage import require_intact
from visavis.running.sessions.intake_list import intake_list
from visavis.running.sessions.simulation import MeasuringTask, measure_one


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return perform("duel", tmp_path_factory.mktemp("once"), repetitions=1).path


def test_whoever_finished_is_taken_in_before_a_sample_is_read(
    session: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert Recording(session).stream_names
    monkeypatch.setattr(reader, "read_stream_file", lambda *_, **__: pytest.fail("it was read"))
    assert (session,) == intake_list([session]).sessions


def test_a_session_is_measured_by_the_report_on_its_damage(session: Path) -> None:
    (report,) = require_intact([session], accept=False)
    assert report == damage_of(Recording(session))
    first = Recording(session).trials().iloc[0]
    trial = TrialDamage(
        int(first["recording_part"]),
        str(first["trial_id"]),
        int(first["attempt"]),
        DAMAGED_STATUS,
        (),
        "a sector of the disk",
    )
    lossy_report = replace(report, trials=(trial,))
    study = str(STUDIES / "duel.py")
    rows = measure_one(MeasuringTask(study, session, damage=lossy_report)).rows
    assert [DAMAGED_STATUS, "complete"] == list(rows["status"][:2])
    assert "a sector of the disk" == rows["reason"].iloc[0]
    rows = measure_one(MeasuringTask(study, session)).rows
    assert ["complete", "complete"] == list(rows["status"][:2])


def test_a_file_that_is_damaged_after_the_report_is_no_shorter_stream(
    session: Path, tmp_path: Path
) -> None:
    copy = Path(shutil.copytree(session, tmp_path / session.parent.name / session.name))
    (report,) = require_intact([copy], accept=False)
    gaze = next(copy.glob("part-*/gaze.arrows"))
    gaze.chmod(0o600)
    content = bytearray(gaze.read_bytes())
    content[len(content) // 2] ^= 1
    gaze.write_bytes(content)
    task = MeasuringTask(str(STUDIES / "duel.py"), copy, damage=report)
    with pytest.raises(DataError, match="damaged or changed after its files had been verified"):
        measure_one(task)


def test_what_was_wrong_before_it_was_written_and_hashed_is_no_shorter_stream(
    session: Path, tmp_path: Path
) -> None:
    copy = Path(shutil.copytree(session, tmp_path / session.parent.name / session.name))
    gaze = next(copy.glob("part-*/gaze.arrows"))
    gaze.chmod(0o600)
    content = bytearray(gaze.read_bytes())
    content[len(content) // 2] ^= 1
    gaze.write_bytes(content)
    manifest = read_manifest(copy)
    (part,) = manifest.parts
    streams = tuple(
        replace(s, sha256=sha256_of(gaze)) if s.name == "gaze" else s for s in part.streams
    )
    write_manifest(copy, manifest.with_part(replace(part, streams=streams)))
    (report,) = require_intact([copy], accept=False)
    task = MeasuringTask(str(STUDIES / "duel.py"), copy, damage=report)
    with pytest.raises(DataError, match="rows cannot be read"):
        measure_one(task)
