"""Damage is told by stream and trial; what a killed process leaves behind is none."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.recording.sessions import new_recorder, probe_batch, probe_manifest
from visavis.lab.clock import NS_PER_MS, SimClock
from visavis.recording import reader
from visavis.recording.durable import sha256_of
from visavis.recording.folder import create_session
from visavis.recording.integrity import DAMAGED_STATUS, LOST_STATUS, analysed_trials, damage_of
from visavis.recording.manifest import read_manifest, write_manifest
from visavis.recording.reader import Recording
from visavis.recording.recovery import recover

ROWS = 100
TRIAL_NS = ROWS * 10 * NS_PER_MS
PAUSE_NS = 50 * NS_PER_MS
"""A trial begins this long after its first sample, and ends this long before its last."""
PLAN = {
    "participant_index": 0,
    "group": "A",
    "blocks": [
        {
            "trials": [
                {
                    "trial_id": f"T{i}",
                    "number": i,
                    "block": 0,
                    "is_practice": False,
                    "factors": {"side": "left"},
                }
                for i in range(4)
            ]
        }
    ],
}


def record(root: Path, *, is_closed: bool = True) -> Path:
    """Record four trials of a second each."""
    clock = SimClock()
    with create_session(root, replace(probe_manifest(), plan=PLAN)) as folder:
        recorder = new_recorder(folder, clock)
        for i in range(4):
            recorder.event("trial_start", i * TRIAL_NS, trial_id=f"T{i}", attempt=1)
            for first in range(i * ROWS, (i + 1) * ROWS, 10):
                recorder.append(probe_batch(first, 10))
            clock.sleep_until_ns((i + 1) * TRIAL_NS)
            row = {"trial_id": f"T{i}", "attempt": 1, "status": "complete", "side": "left"}
            times = {
                "t_start_ns": i * TRIAL_NS + PAUSE_NS,
                "t_end_ns": (i + 1) * TRIAL_NS - PAUSE_NS,
            }
            recorder.trial({**row, **times})
        if is_closed:
            folder.end_part(clock, recorder.close("complete"))
        return folder.path


def change(path: Path, how: Callable[[bytes], bytes]) -> None:
    data = path.read_bytes()
    path.chmod(0o644)
    path.write_bytes(how(data))


def flipped(at: int) -> Callable[[bytes], bytes]:
    return lambda data: data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


def statuses(session: Path, **more: Any) -> dict[str, str]:
    rows = analysed_trials(Recording(session), **more)
    return dict(zip(rows["trial_id"], rows["status"], strict=True))


def test_an_intact_session_has_no_damage_and_its_rows_stay_as_recorded(tmp_path: Path) -> None:
    recording = Recording(record(tmp_path))
    assert not damage_of(recording).is_damaged
    assert recording.trials().equals(analysed_trials(recording))


def test_files_that_are_the_bytes_that_were_written_are_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = Recording(record(tmp_path))
    monkeypatch.setattr(reader, "read_stream_file", lambda *_, **__: pytest.fail("it was read"))
    monkeypatch.setattr(reader, "read_journal", lambda *_: pytest.fail("it was read"))
    assert not damage_of(recording).is_damaged


def test_a_stream_that_nobody_declared_is_damage_beside_files_as_they_were_written(
    tmp_path: Path,
) -> None:
    session = record(tmp_path)
    stream = next(session.glob("part-*/*.arrows"))
    stream.with_stem("another").write_bytes(stream.read_bytes())
    problems = damage_of(Recording(session)).problems
    assert any(problem.endswith("another.arrows is no file of this part") for problem in problems)


@pytest.mark.parametrize("name", ["*.arrows", "events.jsonl"])
def test_a_file_that_is_gone_is_damage_beside_others_as_they_were_written(
    name: str, tmp_path: Path
) -> None:
    session = record(tmp_path)
    next(session.glob(f"part-*/{name}")).unlink()
    assert damage_of(Recording(session)).is_damaged


def test_a_file_that_was_hashed_after_writing_had_failed_is_read(tmp_path: Path) -> None:
    session = record(tmp_path)
    stream = next(session.glob("part-*/*.arrows"))
    change(stream, flipped(stream.stat().st_size // 2))
    manifest = read_manifest(session)
    (part,) = manifest.parts
    (summary,) = part.streams
    hashed_late = replace(summary, sha256=sha256_of(stream), closed_cleanly=False)
    write_manifest(session, manifest.with_part(replace(part, streams=(hashed_late,))))
    assert damage_of(Recording(session)).is_damaged


def test_trials_that_lost_samples_are_named_and_no_others(tmp_path: Path) -> None:
    session = record(tmp_path)
    stream = session / "part-01" / "probe.arrows"
    change(stream, flipped(stream.stat().st_size * 3 // 8))  # in the second trial
    report = damage_of(Recording(session))
    assert [("T1", DAMAGED_STATUS, ("probe",))] == [
        (t.trial_id, t.status, t.streams) for t in report.trials
    ]
    assert 100 == report.streams[0].rows_lost  # a batch of one second on the virtual clock
    assert 400 == report.streams[0].rows_written
    assert "probe (part 1): 100 of 400 rows cannot be read, during 1 trial (T1)" in report.summary()
    expected = {"T0": "complete", "T1": DAMAGED_STATUS, "T2": "complete", "T3": "complete"}
    assert expected == statuses(session)
    assert "complete" == statuses(session, needs=("gaze",))["T1"]


def test_a_stream_cut_short_strikes_the_trials_behind_the_cut(tmp_path: Path) -> None:
    session = record(tmp_path)
    change(session / "part-01" / "probe.arrows", lambda data: data[: len(data) * 5 // 8])
    expected = {"T0": "complete", "T1": "complete", "T2": DAMAGED_STATUS, "T3": DAMAGED_STATUS}
    assert expected == statuses(session)


def test_a_stream_that_is_gone_strikes_every_trial(tmp_path: Path) -> None:
    session = record(tmp_path)
    (session / "part-01" / "probe.arrows").unlink()
    assert {DAMAGED_STATUS} == set(statuses(session).values())


def test_another_sessions_stream_strikes_every_trial(tmp_path: Path) -> None:
    session = record(tmp_path / "a")
    clock = SimClock()
    with create_session(tmp_path / "b", probe_manifest()) as folder:
        recorder = new_recorder(folder, clock)
        recorder.append(probe_batch(1, 400))
        folder.end_part(clock, recorder.close("complete"))
    other = (folder.path / "part-01" / "probe.arrows").read_bytes()
    change(session / "part-01" / "probe.arrows", lambda _: other)
    report = damage_of(Recording(session))
    assert report.streams[0].is_untrusted
    assert {DAMAGED_STATUS} == set(statuses(session).values())
    assert "not the one that was recorded" in " ".join(report.summary())


@pytest.mark.parametrize("with_start", [True, False])
def test_a_trial_whose_line_is_destroyed_is_lost_with_what_was_planned(
    tmp_path: Path, with_start: bool
) -> None:
    session = record(tmp_path)

    def destroy(data: bytes) -> bytes:
        lines = data.splitlines(True)
        for i, line in enumerate(lines):
            if b'"T2"' in line and (b'"kind":"trial"' in line or with_start):
                lines[i] = b"#" + line[1:]
        return b"".join(lines)

    change(session / "part-01" / "events.jsonl", destroy)
    report = damage_of(Recording(session))
    assert [("T2", LOST_STATUS)] == [(t.trial_id, t.status) for t in report.trials]
    rows = analysed_trials(Recording(session)).set_index("trial_id")
    assert LOST_STATUS == rows.loc["T2", "status"]
    assert "left" == rows.loc["T2", "side"]
    assert rows.loc["T2"].isna()["t_end_ns"]
    assert "cannot be read" in rows.loc["T2", "reason"]


def test_a_session_moved_under_another_persons_name_is_named(tmp_path: Path) -> None:
    session = record(tmp_path)
    other = session.parent.with_name("sub-P02") / session.name
    other.parent.mkdir()
    session.rename(other)
    report = damage_of(Recording(other))
    assert "is of sub-P01/ses-001, not of sub-P02/ses-001" in report.problems[0]
    assert report.summary() == report.problems


def test_what_a_killed_process_leaves_behind_is_no_damage(tmp_path: Path) -> None:
    session = record(tmp_path, is_closed=False)
    for name, torn in (("probe.arrows", b"\xff\xff\xff\xff torn"), ("events.jsonl", b'{"kind"')):
        with (session / "part-01" / name).open("ab") as file:
            file.write(torn)
    assert not damage_of(Recording(session)).is_damaged
    recover(session)
    assert not damage_of(Recording(session)).is_damaged


@pytest.mark.parametrize("n_bytes", [0, 3, 60])
def test_a_header_that_a_full_disk_cut_is_no_damage_and_one_with_samples_is(
    n_bytes: int, tmp_path: Path
) -> None:
    session = record(tmp_path, is_closed=False)
    file = session / "part-01" / "probe.arrows"
    torn = session / "part-01" / "other.arrows"
    torn.write_bytes(file.read_bytes()[:n_bytes])
    recover(session)
    assert not damage_of(Recording(session)).is_damaged
    file_with_samples = file.read_bytes()
    change(torn, lambda _: file_with_samples[:4] + b"\xff\xff\xff\x7f" + file_with_samples[8:])
    assert damage_of(Recording(session)).is_damaged


def test_a_bare_header_that_a_full_disk_left_before_it_was_declared_is_no_damage(
    tmp_path: Path,
) -> None:
    session = record(tmp_path, is_closed=False)
    file, stray = (session / "part-01" / f"{name}.arrows" for name in ("probe", "other"))
    content = file.read_bytes()
    header = 8 + int.from_bytes(content[4:8], "little")
    stray.write_bytes(content[:header])
    recover(session)
    manifest = read_manifest(session)  # which an earlier version wrote without this stream
    part = manifest.parts[0]
    streams = tuple(s for s in part.streams if s.name != "other")
    write_manifest(session, replace(manifest, parts=(replace(part, streams=streams),)))
    assert not damage_of(Recording(session)).is_damaged
    change(stray, lambda _: content)
    assert damage_of(Recording(session)).is_damaged


def test_a_part_that_ended_before_its_journal_is_no_damage_and_a_lost_journal_is(
    tmp_path: Path,
) -> None:
    session = record(tmp_path, is_closed=False)
    (session / "part-01" / "events.jsonl").unlink()
    recover(session)
    assert damage_of(Recording(session)).is_damaged

    with create_session(tmp_path / "other", replace(probe_manifest(), plan=PLAN)) as folder:
        folder.begin_part(SimClock())
        unbegun = folder.path
    recover(unbegun)
    assert not damage_of(Recording(unbegun)).is_damaged


def test_a_crashed_part_damaged_afterwards_is_damaged(tmp_path: Path) -> None:
    session = record(tmp_path, is_closed=False)
    recover(session)
    change(session / "part-01" / "probe.arrows", lambda data: data[: len(data) * 5 // 8])
    assert {"T2", "T3"} == {t.trial_id for t in damage_of(Recording(session)).trials}
