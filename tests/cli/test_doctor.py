"""visavis doctor: what is there, what is missing, what to do; kept with every session."""

import json
import shutil
import socket
import stat
from collections import namedtuple
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tests.faults.sessions import CONFIG, lab, request
from visavis.cli.app import load_lab
from visavis.cli.doctor.findings import Finding
from visavis.cli.doctor.machine import computer, libraries, licence_of
from visavis.cli.doctor.report import examine, save_with_session, verdict
from visavis.cli.doctor.wires import network, openvr_runtime, openxr_runtime, ports, runtimes
from visavis.cli.lab_companion import LabCompanion
from visavis.cli.main import app
from visavis.lab.clock import SimClock, SystemClock
from visavis.lab.config import DeviceConfig, LabConfig, Sync
from visavis.lab.errors import RecordingError, SessionAborted
from visavis.protocol.session.operator import Command, UnattendedOperator
from visavis.running.sessions.perform import perform_new

Usage = namedtuple("Usage", "total used free")


def real(role: str, driver: str, **options: Any) -> LabConfig:
    """The shipped lab with one real device and nothing else."""
    from visavis.devices.registry import OPTION_MODELS

    made = OPTION_MODELS[driver].model_validate(options).model_dump()
    device = DeviceConfig(role=role, driver=driver, simulated=False, options=made)
    return load_lab(CONFIG).model_copy(update={"devices": {role: device}})


def one(findings: tuple[Finding, ...], subject: str) -> Finding:
    return next(f for f in findings if f.subject == subject)


@pytest.fixture
def lab_file(tmp_path: Path) -> Path:
    return shutil.copyfile(CONFIG, tmp_path / "lab_config.yaml")


def test_shipped_lab_is_ready(lab_file: Path) -> None:
    result = CliRunner().invoke(app, ["doctor", "--config", str(lab_file), "--json"])
    report = json.loads(result.output)
    assert result.exit_code == 0
    assert report["verdict"] in ("ok", "note", "warning")
    assert {"computer", "libraries", "runtimes", "ports", "network", "devices", "station"} == {
        f["section"] for f in report["findings"]
    }
    assert report["licences"]["pyserial"] in ("BSD", "not stated")


def test_it_fits_eighty_columns(lab_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("visavis.cli.app.console.width", 80)
    result = CliRunner().invoke(app, ["doctor", "--config", str(lab_file)])
    assert max(map(len, result.stdout.splitlines())) <= 80
    assert "Ready" in result.output


def test_absent_device_is_missing_with_its_remedy() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound, not listening: nobody answers there
        port = taken.getsockname()[1]
        report = examine(
            real("eye_tracker", "gazepoint", address="127.0.0.1", port=port), SystemClock()
        )
    device = next(f for f in report.findings if f.section == "devices")
    assert report.is_stopped
    assert device.level == "missing"
    assert "Gazepoint Control" in device.remedy
    assert "Not ready" in verdict(report)


def test_lab_without_a_headset_is_not_ready_and_one_without_an_eye_tracker_is() -> None:
    lab = load_lab(CONFIG)

    def absence(role: str) -> tuple[str, Finding]:
        rest = {name: d for name, d in lab.devices.items() if name != role}
        report = examine(lab.model_copy(update={"devices": rest}), SimClock())
        (finding,) = (f for f in report.findings if f.subject == role)
        return finding.level, finding

    level, finding = absence("headset")
    assert level == "missing"
    assert "every study needs a headset, or a screen" in finding.found
    level, finding = absence("eye_tracker")
    assert level == "note"
    assert finding.found == "not configured; only studies that measure gaze need it"
    assert "add eye_tracker with its driver" in finding.remedy


def test_missing_runtime_is_told_once_and_its_devices_are_not_opened(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("VR_PATHREG_OVERRIDE", str(tmp_path / "nothing"))
    report = examine(real("headset", "openvr_headset"), SystemClock())
    assert one(report.findings, "SteamVR").level == "missing"
    assert one(report.findings, "headset").found == (
        "openvr_headset: needs SteamVR, which is missing"
    )


def test_missing_library_comes_with_the_line_that_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("visavis.cli.doctor.machine.is_installed", lambda library: False)
    band = real("armband_left", "neosensory_buzz")
    assert "pip install 'visavis[ble]'" in one(libraries(band), "bleak").remedy


def test_full_disk_stops_a_session(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda place: Usage(10**12, 10**12, 10**9))
    assert one(computer(load_lab(CONFIG), SimClock()), "disk").level == "missing"
    for command in (
        ("run", "stare", "--participant", "1", "--fast"),
        ("run", "stare", "--participant", "1"),
    ):
        refused = CliRunner().invoke(app, [*command, "--config", str(CONFIG)]).exception
        assert isinstance(refused, RecordingError)
        assert "1.0 GB are free" in str(refused)
        assert "a session needs 2; free some space" in str(refused)


@pytest.mark.parametrize(
    ("root", "said"),
    [("a_file/data", "is a file where a folder is needed"), ("/proc/x", "keeps no")],
)
def test_a_data_root_that_cannot_be_made_is_no_full_disk(
    root: str, said: str, tmp_path: Path
) -> None:
    (tmp_path / "a_file").touch()
    config = load_lab(CONFIG, quiet=True).model_copy(update={"data_root": tmp_path / root})
    finding = one(computer(config, SimClock()), "disk")
    assert "missing" == finding.level
    assert said in finding.found
    assert "data_root" in finding.remedy


def test_runtimes_are_found_where_their_loaders_look(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    registry = tmp_path / "openvrpaths.vrpath"
    registry.write_text(json.dumps({"runtime": [str(tmp_path)]}))
    manifest = tmp_path / "active_runtime.json"
    manifest.write_text(json.dumps({"runtime": {"library_path": "./librt.so", "name": "RT"}}))
    monkeypatch.setenv("VR_PATHREG_OVERRIDE", str(registry))
    monkeypatch.setenv("XR_RUNTIME_JSON", str(manifest))
    assert openvr_runtime() == str(tmp_path)
    assert openxr_runtime() == "RT"
    assert one(runtimes(load_lab(CONFIG)), "OpenXR").level == "ok"


def test_serial_ports_are_told_as_they_stand_in_the_configuration(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    list_ports = pytest.importorskip("serial.tools.list_ports", reason="pip install pyserial")
    Port = namedtuple("Port", "device vid pid serial_number description")
    plugged = [
        Port("COM9", 0x0403, 0x6001, "A10L", "FT232R"),
        Port("COM1", None, None, None, "on board"),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: plugged)
    (finding,) = [f for f in ports() if f.subject.startswith("COM")]
    assert finding.found.startswith("vid: 0x0403, pid: 0x6001, serial_number: A10L")


def test_firewall_hint_names_the_port_of_the_configuration() -> None:
    assert "UDP 9800" in one(network(real("body_tracker", "xsens", port=9800)), "firewall").found


def test_port_taken_by_another_program_is_told() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("", 0))
        port = other.getsockname()[1]
        finding = network(real("body_tracker", "xsens", port=port))
    assert one(finding, "body_tracker").level == "missing"


def test_unknown_licence_is_said_to_be_unknown() -> None:
    assert licence_of("no-such-distribution") == "not stated"


class Stopping(UnattendedOperator):
    """End the session at its first frame."""

    def poll(self) -> tuple[Command, ...]:
        raise KeyboardInterrupt


def test_session_in_real_time_keeps_what_the_doctor_found(tmp_path: Path) -> None:
    wanted = replace(
        request(lab(tmp_path), Stopping()), clock=SystemClock(), companion=LabCompanion()
    )
    with pytest.raises(SessionAborted):
        perform_new(wanted)
    (kept,) = tmp_path.rglob("doctor.json")
    assert 0o600 == stat.S_IMODE(kept.stat().st_mode)
    report = json.loads(kept.read_text("utf-8"))
    assert kept.parent.name == "part-01"
    assert {"headset", "eye_tracker", "responses"} == {t["role"] for t in report["trials"]}
    assert all(t["info"]["is_simulated"] for t in report["trials"])


def test_simulated_study_keeps_nothing_that_differs_between_machines(tmp_path: Path) -> None:
    with pytest.raises(SessionAborted):
        perform_new(request(lab(tmp_path), Stopping()))
    assert list(tmp_path.rglob("doctor.json")) == []


def test_device_without_pulse_is_saved_all_the_same(tmp_path: Path) -> None:
    save_with_session(tmp_path, load_lab(CONFIG), SimClock(), {})
    assert json.loads((tmp_path / "doctor.json").read_text())["trials"] == []


@pytest.mark.parametrize(
    ("sync", "level", "said"),
    [
        ({"lsl": True}, "ok", "where LabRecorder looks"),
        ({"lsl": True, "session_id": "floor-2"}, "note", "LabRecorder does not see these streams"),
    ],
)
def test_a_labs_own_lsl_session_is_told_with_what_to_set_elsewhere(
    sync: dict[str, Any], level: str, said: str
) -> None:
    config = load_lab(CONFIG)
    config = config.model_copy(update={"sync": Sync.model_validate(sync)})
    finding = one(computer(config, SimClock()), "LSL session")
    assert finding.level == level
    assert said in finding.found
    assert ("SessionID = floor-2" in finding.remedy) == (level == "note")
