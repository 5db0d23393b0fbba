"""A manifest is read as it was written or not at all, and comes back from its copy."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.recording.sessions import record_session
from visavis.lab.errors import RecordingError
from visavis.recording.integrity import damage_of
from visavis.recording.journal import encode_line
from visavis.recording.journal_file import read_journal
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording
from visavis.recording.recovery import recover
from visavis.recording.sealed import seal, unseal

STORED = Path(__file__).parent / "data" / "format_1/simulated/probe/sub-P01/ses-001"


@pytest.fixture
def session(tmp_path: Path) -> Path:
    return record_session(tmp_path, 1)


def rewritten(at: Path, /, **changes: Any) -> None:
    """Write a manifest with other fields and a right checksum, as another program might."""
    path = at / "manifest.json"
    path.write_bytes(seal({**unseal(path.read_bytes()).content, **changes}))


def test_no_flipped_bit_of_a_manifest_is_read(session: Path) -> None:
    path = session / "manifest.json"
    data = path.read_bytes()
    rng = np.random.default_rng(1)
    for _ in range(300):
        at, bit = int(rng.integers(len(data))), 1 << int(rng.integers(8))
        path.write_bytes(data[:at] + bytes([data[at] ^ bit]) + data[at + 1 :])
        with pytest.raises(RecordingError, match=r"visavis recover|newer Visavis"):
            read_manifest(session)


def test_a_manifest_cut_anywhere_is_not_read(session: Path) -> None:
    path = session / "manifest.json"
    data = path.read_bytes()
    for cut in range(0, len(data), 7):
        path.write_bytes(data[:cut])
        with pytest.raises(RecordingError):
            read_manifest(session)


@pytest.mark.parametrize("how", ["flip", "cut", "gone"])
def test_recovery_puts_a_damaged_manifest_back_from_its_copy(session: Path, how: str) -> None:
    path = session / "manifest.json"
    data = path.read_bytes()
    if how == "gone":
        path.unlink()
    else:
        path.write_bytes(data[:-9] if how == "cut" else data.replace(b'"seed": 7', b'"seed": 6'))
    with pytest.raises(RecordingError, match="visavis recover"):
        Recording(session)
    report = recover(session)
    assert data == path.read_bytes()
    assert "put back from its copy" in report.repaired[0]
    assert "complete" == Recording(session).status


def test_recovery_renews_a_damaged_copy(session: Path) -> None:
    copy = session / "manifest.copy.json"
    data = copy.read_bytes()
    copy.write_bytes(data[:-5])
    assert "manifest.copy.json is damaged" in damage_of(Recording(session)).notes[0]
    assert not damage_of(Recording(session)).is_damaged
    recover(session)
    assert data == copy.read_bytes()
    assert () == damage_of(Recording(session)).notes


def test_without_an_intact_copy_recovery_says_what_is_wrong(session: Path) -> None:
    for name in ("manifest.json", "manifest.copy.json"):
        (session / name).write_bytes(b"{")
    with pytest.raises(RecordingError, match=r"manifest\.json cannot be read"):
        recover(session)


def test_a_manifest_without_checksum_is_read_and_said_to_have_none(tmp_path: Path) -> None:
    session = tmp_path / "sub-P01" / "ses-001"
    shutil.copytree(STORED, session)
    report = damage_of(Recording(session))
    assert not report.is_damaged
    assert "before manifests had checksums" in report.notes[0]


@pytest.mark.parametrize(
    "changes",
    [
        {"participant": "../../x"},
        {"participant": ""},
        {"study": "../x"},
        {"session": 0},
        {"session": "1"},
        {"seed": 1.5},
        {"is_simulated": "yes"},
        {"plan": []},
        {"plan": {"blocks": {}}},
        {"plan": {"blocks": [{"trials": [[]]}]}},
        {"plan": {"blocks": [{"trials": [{"trial_id": 1}]}]}},
        {"parts": [{"number": "../part", "status": "complete"}]},
        {"parts": {}},
        {"strange": 1},
    ],
)
def test_what_a_manifest_may_not_hold_is_named(session: Path, changes: dict[str, Any]) -> None:
    rewritten(session, **changes)
    with pytest.raises(RecordingError, match="lacks or misstates a field"):
        Recording(session)


@pytest.mark.parametrize(
    ("key", "value"),
    [("number", "../../etc"), ("number", 0), ("number", True), ("status", "fine"), ("journal", 3)],
)
def test_a_part_that_is_none_is_named(session: Path, key: str, value: object) -> None:
    part = unseal((session / "manifest.json").read_bytes()).content["parts"][0]
    rewritten(session, parts=[{**part, key: value}])
    with pytest.raises(RecordingError, match="lacks or misstates a field"):
        Recording(session)


@pytest.mark.parametrize("file", ["../../manifest.json", "/etc/passwd", "other.arrows"])
def test_a_stream_in_another_folder_is_named(session: Path, file: str) -> None:
    part = unseal((session / "manifest.json").read_bytes()).content["parts"][0]
    stream = {**part["streams"][0], "file": file}
    rewritten(session, parts=[{**part, "streams": [stream]}])
    with pytest.raises(RecordingError, match="not a file of a stream"):
        Recording(session)


def test_deep_json_is_named(session: Path) -> None:
    for depth in (200, 200_000):
        text = b'{"format_version": 2, "plan": ' + b"[" * depth + b"]" * depth + b"}"
        (session / "manifest.json").write_bytes(text)
        with pytest.raises(RecordingError, match="nested deeper"):
            Recording(session)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with names")
@pytest.mark.parametrize("file", ["manifest.json", "part-01/probe.arrows", "part-01/events.jsonl"])
def test_a_pipe_instead_of_a_file_is_named_and_not_waited_for(session: Path, file: str) -> None:
    (session / file).unlink()
    os.mkfifo(session / file)
    with pytest.raises(RecordingError, match="not a regular file"):
        damage_of(Recording(session))


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege there")
@pytest.mark.parametrize(
    "file", ["manifest.json", "manifest.copy.json", "part-01", "part-01/probe.arrows"]
)
def test_a_link_in_a_session_is_refused_and_nothing_is_moved(session: Path, file: str) -> None:
    elsewhere = session.parent / "elsewhere"
    (session / file).rename(elsewhere)
    (session / file).symlink_to(elsewhere)
    for read in (Recording, recover):
        with pytest.raises(RecordingError, match=f"{file} is a link, to .*elsewhere"):
            read(session)
    assert (session / file).is_symlink()
    assert elsewhere.exists()


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege there")
def test_a_link_that_the_manifest_does_not_name_is_refused_too(session: Path) -> None:
    (session / "part-01" / "more.arrows").symlink_to(session / "part-01" / "probe.arrows")
    with pytest.raises(RecordingError, match="is a link"):
        read_manifest(session)


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege there")
def test_a_data_folder_may_be_reached_through_a_link(session: Path, tmp_path: Path) -> None:
    other_disk = tmp_path / "link"
    other_disk.symlink_to(session.parent)
    assert not damage_of(Recording(other_disk / session.name)).is_damaged


def test_files_beside_the_streams_are_hashed_too(tmp_path: Path) -> None:
    from tests.recording.sessions import new_recorder, probe_manifest
    from visavis.lab.clock import SimClock
    from visavis.recording.folder import create_session

    with create_session(tmp_path, probe_manifest()) as folder:
        recorder = new_recorder(folder, SimClock())
        beside = folder.path / "part-01" / "doctor.json"
        beside.write_text(json.dumps({"says": "well"}))
        folder.end_part(SimClock(), recorder.close("complete"))
    assert not damage_of(Recording(folder.path)).is_damaged
    beside.write_text(json.dumps({"says": "bell"}))
    assert "doctor.json: SHA-256 differs" in damage_of(Recording(folder.path)).problems[0]


def test_a_trial_named_as_a_path_is_no_trial(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    rows = [{"trial_id": name} for name in ("T1", "../../T2", "a\\b", ".hidden", "T 3")]
    path.write_bytes(b"".join(encode_line({"kind": "trial", "t_ns": 0, "row": r}) for r in rows))
    content = read_journal(path)
    assert ["T1", "T 3"] == [t["row"]["trial_id"] for t in content.trials]
    assert 3 == content.damaged_lines


@pytest.mark.parametrize(
    "entry",
    [
        {"kind": "trial", "t_ns": 0},
        {"kind": "trial", "t_ns": 0, "row": []},
        {"kind": "event", "t_ns": "0", "name": "x", "payload": {}},
        {"kind": "end"},
        {"nothing": 1},
    ],
)
def test_a_journal_line_without_what_it_must_have_is_damaged(
    tmp_path: Path, entry: dict[str, Any]
) -> None:
    path = tmp_path / "events.jsonl"
    path.write_bytes(encode_line(entry) + encode_line({"kind": "end", "lines": 1}))
    assert 1 == read_journal(path).damaged_lines
