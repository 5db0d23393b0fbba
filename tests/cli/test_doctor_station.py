"""A station's timing: locked once, compared at every start, and told where it is no longer kept."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.faults.sessions import CONFIG, lab
from visavis.cli.commands import session as session_commands
from visavis.cli.doctor import station
from visavis.cli.doctor.findings import Finding
from visavis.cli.doctor.report import FILE_NAME, save_with_session
from visavis.cli.doctor.station import (
    Station,
    compare_stations,
    lock,
    locked,
    station_findings,
    station_path,
)
from visavis.cli.main import app
from visavis.lab.clock import SimClock, SystemClock
from visavis.lab.config import LabConfig
from visavis.lab.errors import UsageError

KEPT = Station(
    "2026-03-02T10:00:00+01:00",
    {"wake_ms": 0.1, "late_frames_01": 0.0, "write_ms": 4.0},
    {"picture": 18.0, "sound": 40.0},
    {"system": "Linux 6.1", "processors": "8", "monitors": "2560×1440 at 144 Hz"},
)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LabConfig:
    """Return a lab whose computer measures what was locked, in no time."""
    monkeypatch.setattr(station, "measure", lambda *_: KEPT)
    return lab(tmp_path)


def test_what_was_locked_is_read_again(here: LabConfig) -> None:
    lock(here, SystemClock())
    assert KEPT == locked(here)


def test_a_station_as_it_was_locked_is_told_in_one_line() -> None:
    (finding,) = compare_stations(KEPT, KEPT)
    assert ("ok", True) == (finding.level, finding.found.startswith("as locked on 2026-03-02"))


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("wake_ms", 0.8, "wakes late by (median) 0.8 ms; locked on 2026-03-02: "),
        ("late_frames_01", 0.2, "frames begun late 20 %; locked on 2026-03-02: "),
        ("write_ms", 30.0, "64 kB safe on disk after (median) 30.0 ms; locked on 2026-03-02: "),
    ],
)
def test_a_figure_that_became_worse_is_told_beside_the_one_locked(
    name: str, value: float, says: str
) -> None:
    (finding,) = compare_stations(KEPT, replace(KEPT, figures={**KEPT.figures, name: value}))
    assert ("warning", True) == (finding.level, finding.found.startswith(says))


@pytest.mark.parametrize(("name", "value"), [("wake_ms", 0.6), ("write_ms", 20.0)])
def test_a_busier_moment_is_no_other_station(name: str, value: float) -> None:
    (finding,) = compare_stations(KEPT, replace(KEPT, figures={**KEPT.figures, name: value}))
    assert "ok" == finding.level


@pytest.mark.parametrize(
    ("delay_ms", "level"), [(20.9, "ok"), (21.1, "warning"), (14.9, "warning")]
)
def test_a_chain_of_devices_that_is_late_otherwise_is_told(delay_ms: float, level: str) -> None:
    now = replace(KEPT, delays_ms={"picture": delay_ms, "sound": 40.0})
    assert level == compare_stations(KEPT, now)[0].level


def test_what_figures_depend_on_is_told_when_it_changes() -> None:
    now = replace(KEPT, depends_on={**KEPT.depends_on, "monitors": "2560×1440 at 60 Hz"})
    (finding,) = compare_stations(KEPT, now)
    assert "2560×1440 at 60 Hz; locked on 2026-03-02 with 2560×1440 at 144 Hz" == finding.found


def test_locking_again_keeps_what_was_locked_before(here: LabConfig) -> None:
    first = lock(here, SystemClock()).read_text("utf-8")
    lock(here, SystemClock())
    lock(here, SystemClock())
    former = sorted(station_path(here).parent.glob("*.until_*.json"))
    assert [first, first] == [path.read_text("utf-8") for path in former]


def test_a_station_never_locked_is_a_note_with_the_command_that_locks_it(here: LabConfig) -> None:
    (finding,) = station_findings(here, SystemClock())
    assert ("note", True) == (finding.level, "visavis doctor --lock" in finding.remedy)


def test_a_damaged_file_is_told_with_the_way_out(here: LabConfig) -> None:
    path = station_path(here)
    path.parent.mkdir(parents=True)
    path.write_text('{"made": 1}', "utf-8")
    with pytest.raises(UsageError, match=r"delete it and lock again: visavis doctor --lock"):
        locked(here)
    assert "warning" == station_findings(here, SystemClock())[0].level


def test_nothing_is_measured_on_a_virtual_clock(here: LabConfig) -> None:
    assert () == station_findings(here, SimClock())


def test_doctor_locks_this_computer_and_then_compares(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    config = tmp_path / "lab_config.yaml"
    config.write_bytes(CONFIG.read_bytes())
    done = CliRunner().invoke(app, ["doctor", "--lock", "--json", "--config", str(config)])
    findings = [f for f in json.loads(done.output)["findings"] if f["section"] == "station"]
    assert 1 == len(list((tmp_path / "data" / "stations").glob("*.json")))
    assert all("locked on" in f["found"] for f in findings)
    assert findings


def test_the_operator_is_told_at_the_start_and_the_session_keeps_it(
    here: LabConfig, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    findings = (
        Finding("station", "timing", "warning", "frames begun late 20 %", "close programs"),
    )
    session_commands._tell_station(findings)
    assert "station: frames begun late 20 %\n  → close programs" in capsys.readouterr().err
    save_with_session(tmp_path, here, SimClock(), {}, findings)
    kept = json.loads((tmp_path / FILE_NAME).read_text("utf-8"))["findings"]
    assert "frames begun late 20 %" in [f["found"] for f in kept if f["section"] == "station"]
