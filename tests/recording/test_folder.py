import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.recording.sessions import (
    new_recorder,
    probe_manifest,
    record_session,
    record_trials,
)
from visavis.lab.clock import SimClock
from visavis.lab.errors import RecordingError, UsageError
from visavis.recording import durable
from visavis.recording.folder import create_session, open_session, session_dir
from visavis.recording.lock import is_held, lock_path
from visavis.recording.reader import Recording


def test_sessions_lie_where_the_layout_says(tmp_path: Path) -> None:
    path = record_session(tmp_path)
    assert tmp_path / "simulated" / "probe" / "sub-P01" / "ses-001" == path
    assert {"manifest.json", "manifest.copy.json", "part-01"} == {p.name for p in path.iterdir()}


def test_a_finished_session_is_refused_with_its_way_out(tmp_path: Path) -> None:
    record_session(tmp_path)
    with pytest.raises(UsageError, match=r"never overwritten; run a further one: add --session 2"):
        create_session(tmp_path, probe_manifest())


@pytest.mark.parametrize("label", ["", "P 1", "P_1", "../x", "é1"])
def test_labels_other_than_letters_and_digits_are_refused(tmp_path: Path, label: str) -> None:
    with pytest.raises(UsageError, match="only letters and digits"):
        session_dir(tmp_path, "probe", label, 1, is_simulated=True)


def test_session_number_out_of_range_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="between 1 and 999"):
        session_dir(tmp_path, "probe", "P01", 0, is_simulated=True)


def test_paths_with_spaces_and_accents_work(tmp_path: Path) -> None:
    path = record_session(tmp_path / "Étude n° 1 – öffentlich")
    assert Recording(path).verify().is_intact


HOLD = """
import sys
from pathlib import Path
from visavis.recording.folder import open_session
open_session(Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""


def test_second_process_is_refused_until_the_first_dies(tmp_path: Path) -> None:
    path = record_session(tmp_path)
    assert not is_held(path)
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as holder:
        assert holder.stdout is not None
        assert b"held\n" == holder.stdout.readline()
        assert is_held(path)
        with pytest.raises(UsageError, match="in use by another Visavis process"):
            open_session(path)
        holder.kill()
    folder, _ = open_session(path)
    folder.close()


def test_two_creations_of_one_session_give_one(tmp_path: Path) -> None:
    with (
        create_session(tmp_path, probe_manifest()),
        pytest.raises(UsageError, match="in use by another Visavis process"),
    ):
        create_session(tmp_path, probe_manifest())


def test_resumption_adds_a_part_and_touches_no_file_of_the_first(tmp_path: Path) -> None:
    clock = SimClock()
    with create_session(tmp_path, probe_manifest()) as folder:
        recorder = new_recorder(folder, clock)
        record_trials(recorder, clock, range(1))
        path = folder.path
    before = {p: p.read_bytes() for p in (path / "part-01").iterdir()}
    folder, report = open_session(path)
    assert (1, "running", "crashed") == (
        report.trials,
        report.parts[0].status_before,
        report.parts[0].status,
    )
    with folder:
        second = new_recorder(folder, clock)
        record_trials(second, clock, range(1, 3))
        folder.end_part(clock, second.close("complete"))
    assert before == {p: p.read_bytes() for p in (path / "part-01").iterdir()}
    recording = Recording(path)
    assert ("crashed", "complete", "complete") == (
        recording.part_status(1),
        recording.part_status(2),
        recording.status,
    )
    assert ["T00", "T01", "T02"] == recording.trials()["trial_id"].tolist()
    assert recording.verify().is_intact
    recorder.close("aborted")


def test_part_begun_twice_is_refused(tmp_path: Path) -> None:
    clock = SimClock()
    with create_session(tmp_path, probe_manifest()) as folder:
        folder.begin_part(clock)
        with pytest.raises(UsageError, match="being recorded already"):
            folder.begin_part(clock)


def test_left_over_of_a_killed_creation_is_no_obstacle(tmp_path: Path) -> None:
    path = session_dir(tmp_path, "probe", "P01", 1, is_simulated=True)
    (path.parent / ".ses-001.new").mkdir(parents=True)
    create_session(tmp_path, probe_manifest()).close()
    assert {"manifest.json", "manifest.copy.json"} == {p.name for p in path.iterdir()}


def test_manifest_is_old_or_new_when_its_replacement_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimClock()
    with create_session(tmp_path, probe_manifest()) as folder:
        before = (folder.path / "manifest.json").read_bytes()

        def full(fd: int, data: memoryview) -> int:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(durable.os, "write", full)
        with pytest.raises(RecordingError, match=r"manifest\.json.*free some space"):
            folder.begin_part(clock)
        assert before == (folder.path / "manifest.json").read_bytes()


def test_read_only_root_says_where_to_change_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As root permissions do not bind, so the refusal comes from the calls themselves.
    def refuse(*_: object, **__: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(RecordingError, match="set data_root to a folder you may write to"):
        create_session(tmp_path, probe_manifest())
    monkeypatch.undo()
    path = record_session(tmp_path)
    monkeypatch.setattr(durable.os, "open", refuse)
    with pytest.raises(RecordingError, match="set data_root to a folder you may write to"):
        open_session(path)


@pytest.mark.skipif(
    os.name == "nt" or os.geteuid() == 0, reason="permissions do not bind the superuser"
)
def test_read_only_folder_is_refused_by_the_system_too(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    with pytest.raises(RecordingError, match="permission denied"):
        create_session(tmp_path, probe_manifest())
    tmp_path.chmod(0o755)


@pytest.mark.parametrize(
    "make", [os.mkfifo, lambda path: path.symlink_to(path.name)], ids=["pipe", "loop"]
)
def test_what_stands_in_a_locks_place_is_not_waited_for(
    make: Callable[[Path], None], tmp_path: Path
) -> None:
    make(lock_path(tmp_path / "ses-001"))
    try:
        is_waited_for = is_held(tmp_path / "ses-001")
    except RecordingError as error:
        is_waited_for = "delete it if nobody does" not in str(error)
    assert is_waited_for is False
