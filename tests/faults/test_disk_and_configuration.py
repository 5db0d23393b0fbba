import errno
import os
import re
import subprocess
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.commands import COMMANDS
from tests.faults.sessions import (
    CONFIG,
    REPOSITORY,
    findings,
    lab,
    path_of,
    perform,
    request,
    resume,
)
from tests.sessions import SHORT_STARE
from visavis.cli.app import load_lab
from visavis.cli.main import app
from visavis.lab.clock import SimClock
from visavis.lab.errors import ConfigError, RecordingError, UsageError
from visavis.recording import durable
from visavis.recording.folder import open_session
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.data_root import DataDisk
from visavis.running.sessions.device_setup import build_rig, devices_for
from visavis.running.sessions.perform import perform_new

HEADSET = """  headset:
    driver: simulated_headset
    simulated: true
    display_rate_hz: 90
"""


def visavis(*arguments: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return COMMANDS.run(
        *["-m", "visavis.cli.main", *arguments],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "COLUMNS": "200", **environment},
    )


def configured(folder: Path, old: str = "", new: str = "") -> Path:
    """Write the shipped configuration with a change; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "lab_config.yaml"
    path.write_text(CONFIG.read_text("utf-8").replace(old, new), "utf-8")
    return path


def test_a_disk_that_fills_up_ends_the_session_and_keeps_what_was_acknowledged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = lab(tmp_path)
    acknowledged: list[str] = []
    full = False
    write = os.write

    def limited(fd: int, data: bytes) -> int:
        if full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(fd, data)

    def note(trial_id: str, done: int, planned: int) -> None:
        nonlocal full
        acknowledged.append(trial_id)
        full = trial_id == "T02"

    monkeypatch.setattr(durable.os, "write", limited)
    with pytest.raises(RecordingError) as ended:
        perform_new(replace(request(config), on_trial=note))
    monkeypatch.undo()

    said = str(ended.value)
    assert str(path_of(config)) in said
    assert "the disk is full: free some space, then resume the session" in said
    assert 5 == ended.value.exit_code
    recording = Recording(path_of(config))
    assert acknowledged == list(recording.trials()["trial_id"])
    assert "not done: T03" in findings(recording)

    full_disk = DataDisk(1.0, "1.0 GB are free, a session needs 2", "free some space")
    monkeypatch.setattr("visavis.running.sessions.data_root.data_disk", lambda _: full_disk)
    arguments = ["resume", str(path_of(config)), "--fast", "--config", str(CONFIG)]
    refused = CliRunner().invoke(app, arguments).exception
    assert isinstance(refused, RecordingError)
    assert "1.0 GB are free, a session needs 2; free some space" in str(refused)
    assert ["part-01"] == [part.name for part in path_of(config).glob("part-*")]
    assert "complete" == resume(config).status


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root writes everywhere")
def test_a_read_only_data_root_is_refused_before_anything_runs(tmp_path: Path) -> None:
    root = tmp_path / "data"
    root.mkdir()
    root.chmod(0o500)
    with pytest.raises(RecordingError, match="permission denied: set data_root"):
        perform(lab(root))


def test_a_data_root_that_refuses_folders_is_named_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(RecordingError) as refused:
        perform(lab(tmp_path / "data"))
    assert str(tmp_path) in str(refused.value)
    assert "the disk is read-only: set data_root to a writable folder" in str(refused.value)


def test_a_second_process_on_a_session_is_refused_with_the_way_out(tmp_path: Path) -> None:
    config = lab(tmp_path)
    path = perform(config, trial_s=1.0).path
    held, _ = open_session(path)
    with held, pytest.raises(UsageError, match="in use by another Visavis process") as refused:
        resume(config)
    assert str(path) in str(refused.value)


@pytest.mark.timeout(600)
def test_a_session_typed_twice_is_refused_and_nothing_is_overwritten(tmp_path: Path) -> None:
    configured(tmp_path)
    run = ("run", "stare", "--participant", "07", "--fast")
    first = visavis(*run, *SHORT_STARE, cwd=tmp_path)
    before = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*") if p.is_file()}
    again = visavis(*run, cwd=tmp_path)

    assert 0 == first.returncode, first.stderr
    assert 2 == again.returncode
    assert "already has session 1" in again.stderr
    assert "nothing was overwritten" in again.stderr
    assert "visavis resume" in again.stderr or "--session 2" in again.stderr
    assert before == {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*") if p.is_file()}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rate_hz: 120", "rate_hz: 120 Hz", "devices.eye_tracker.rate_hz: is '120 Hz'; the unit"),
        ("rate_hz: 120", "rate_khz: 0.12", "the setting is in hertz, write rate_hz: 120"),
        ("port: 50020", "prot: 50020", "did you mean 'port'?"),
        ("driver: pupil_core", "driver: pupil_cor", "did you mean 'pupil_core'?"),
        ("rate_hz: 120", "rate_hz: 0.12", "devices.eye_tracker.rate_hz: is 0.12"),
    ],
)
def test_a_wrong_option_is_told_with_file_line_and_remedy(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    path = configured(tmp_path, old, new)
    with pytest.raises(ConfigError) as refused:
        load_lab(path)

    assert said in str(refused.value)
    line = next(n for n, t in enumerate(path.read_text("utf-8").splitlines(), 1) if new in t)
    assert f"{path}:{line}: " in str(refused.value)


def test_an_unknown_fault_is_told_before_a_session_is_made(tmp_path: Path) -> None:
    config = lab(tmp_path, tracker=[{"kind": "silense"}])
    with pytest.raises(ConfigError, match=r"devices\.eye_tracker.*faults.*did you mean 'silence'"):
        perform(config)
    assert not path_of(config).exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rate_hz: 120", "rate_hz: 120\n    faults: [{kind: silense}]", "did you mean 'silence'"),
        (HEADSET, "", "devices has no headset"),
    ],
)
def test_plan_refuses_the_devices_that_run_refuses(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    path = configured(tmp_path, old, new)
    for command in ("plan", "run"):
        arguments = [command, "stare", "--participant", "1", "--config", str(path)]
        refused = CliRunner().invoke(app, arguments).exception
        assert isinstance(refused, ConfigError), refused
        assert re.search(said, str(refused))
    assert not (tmp_path / "data").exists()


def test_a_study_on_pages_is_planned_in_a_lab_without_a_headset(tmp_path: Path) -> None:
    path = configured(tmp_path, HEADSET, "")
    planned = CliRunner().invoke(app, ["plan", "interpolation", "--config", str(path)])
    assert 0 == planned.exit_code, planned.exception


def test_a_missing_role_is_named() -> None:
    config = load_lab(CONFIG)
    without = config.model_copy(update={"devices": {"headset": config.devices["headset"]}})
    with pytest.raises(ConfigError, match="stare needs eye_tracker under devices"):
        devices_for(without, find_study("stare").experiment({}))
    with pytest.raises(ConfigError, match="devices has no headset"):
        build_rig(config.model_copy(update={"devices": {}}), SimClock(), None, 1, ExitStack())


@pytest.mark.timeout(600)
def test_spaces_accents_and_a_decimal_comma_change_nothing(tmp_path: Path) -> None:
    here = tmp_path / "Étude d’été 2026, salle 3"
    configured(here)
    done = visavis(
        "run",
        "stare",
        "--participant",
        "07",
        "--fast",
        *SHORT_STARE,
        cwd=here,
        LC_ALL="de_DE.UTF-8",
        LANG="de_DE.UTF-8",
    )
    assert 0 == done.returncode, done.stderr
    session = next(here.glob("data/simulated/stare/sub-*/ses-001"))
    recording = Recording(session)
    assert "complete" == recording.status
    assert 37 == len(recording.trials())
    checked = visavis("check", str(session), cwd=tmp_path, LC_ALL="de_DE.UTF-8")
    assert "37 of 37 planned trials complete, 1 of them practice" in checked.stdout


def test_who_sees_a_body_of_their_own_is_tracked_in_every_study() -> None:
    config = load_lab(CONFIG)
    stare = find_study("stare").experiment({})
    seen = config.model_copy(
        update={"display": config.display.model_copy(update={"own_body": "female"})}
    )

    assert "body_tracker" not in devices_for(config, stare).devices
    assert "body_tracker" in devices_for(seen, stare).devices
