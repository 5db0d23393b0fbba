"""Examine a lab (computer, libraries, runtimes, ports, network, devices) and save the report."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from visavis.cli.app import as_json_value
from visavis.cli.doctor.findings import Finding, worst
from visavis.cli.doctor.machine import COMPUTER, computer, libraries, licence_of
from visavis.cli.doctor.station import station_findings
from visavis.cli.doctor.wires import RUNTIME_NAMES, RUNTIMES, network, ports, runtimes
from visavis.cli.showing_devices import shown_pictures
from visavis.cli.sync_records import MAX_AGE_DAYS, age_days, newest
from visavis.devices.bench import Trial, capture
from visavis.devices.contracts import Device
from visavis.devices.registry import driver_spec, driver_specs
from visavis.lab.clock import Clock
from visavis.lab.config import DeviceConfig, LabConfig
from visavis.lab.config_files import CONFIG_NAME, EXAMPLE
from visavis.running.sessions.device_setup import roles_expected

DEVICES = "devices"
SELF_TEST_S = 10.0
GLANCE_S = 0.5
LOW_BATTERY_01 = 0.2
FILE_NAME = "doctor.json"
NOT_YET = "not calibrated"


@dataclass(frozen=True)
class Report:
    """All findings on a lab; `trials` are the devices that were opened and listened to."""

    made_wall_iso: str
    config: str
    findings: tuple[Finding, ...]
    trials: tuple[Trial, ...] = ()
    licences: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_stopped(self) -> bool:
        """True when something is missing that every session needs."""
        return worst(self.findings) == "missing"


def examine(lab: LabConfig, clock: Clock, *, self_test_s: float = 0.0) -> Report:
    """Examine the whole lab. Real devices are opened briefly; a self-test opens all of them."""
    surroundings = _surroundings(lab, clock)
    absent = {f.subject: f for f in surroundings if f.section == RUNTIMES and f.level == "missing"}
    devices = [d for d in lab.devices.values() if self_test_s or not d.simulated]
    trials = [_without_runtime(d, absent) for d in devices]
    devices_to_open = [d for d, trial in zip(devices, trials, strict=True) if trial is None]
    captured_trials = iter(
        capture(devices_to_open, clock, self_test_s or GLANCE_S, prepare=shown_pictures(lab))
        if devices_to_open
        else ()
    )
    all_trials = tuple(trial if trial is not None else next(captured_trials) for trial in trials)
    findings = (
        _configuration(lab),
        *surroundings,
        *_devices(lab, all_trials),
        _sync_test(lab, clock),
        *station_findings(lab, clock),
    )
    return Report(clock.wall_iso(), str(lab.path), findings, all_trials, _licences())


def save_with_session(
    part_dir: Path,
    lab: LabConfig,
    clock: Clock,
    devices: Mapping[str, Device],
    station: tuple[Finding, ...] = (),
) -> None:
    """Write `doctor.json` into a part of a session: the surroundings and the open devices.

    `station` are the findings on the computer's timing just before the session.
    """
    trials = tuple(
        Trial(
            role,
            device.info.driver,
            device.info.is_simulated,
            info=device.info,
            health=device.health(),
            faults=device.check(),
        )
        for role, device in devices.items()
    )
    report = Report(
        clock.wall_iso(),
        str(lab.path),
        (*_surroundings(lab, clock, are_open=True), *_devices(lab, trials), *station),
        trials,
        _licences(),
    )
    text = json.dumps(as_document(report), ensure_ascii=False, indent=1)
    (part_dir / FILE_NAME).write_text(text + "\n", "utf-8")


def as_document(report: Report) -> dict[str, Any]:
    """Return a report as plain values."""
    plain: dict[str, Any] = json.loads(json.dumps(asdict(report), default=as_json_value))
    plain["verdict"] = worst(report.findings)
    return plain


def verdict(report: Report) -> str:
    """Return the last line of the report: whether a session can run."""
    counts = dict.fromkeys(("missing", "warning"), 0)
    for finding in report.findings:
        if finding.level in counts:
            counts[finding.level] += 1
    if counts["missing"]:
        things = "thing is" if counts["missing"] == 1 else "things are"
        return f"[bold red]Not ready.[/] {counts['missing']} {things} missing: see ✗ above."
    if counts["warning"]:
        return f"[yellow]Ready, with {counts['warning']} to look at:[/] see ! above."
    return "[green]Ready.[/]"


def _configuration(lab: LabConfig) -> Finding:
    if lab.path == EXAMPLE:
        return Finding(
            COMPUTER,
            "configuration",
            "missing",
            f"no {CONFIG_NAME} in this folder or above",
            "run: visavis init (or give the path of yours: --config FILE)",
        )
    return Finding(COMPUTER, "configuration", "ok", f"{lab.path} ({lab.lab})")


def _sync_test(lab: LabConfig, clock: Clock) -> Finding:
    """Return age and offsets of the lab's newest synchronisation test."""
    record = newest(lab)
    remedy = "run: visavis sync-test (docs/synchronisation.md)"
    if record is None:
        return Finding(DEVICES, "sync-test", "note", "delays were never measured here", remedy)
    days = age_days(record, clock.wall_iso())
    offsets = ", ".join(f"{name} {ms:g}" for name, ms in record.get("offsets_ms", {}).items())
    text = f"{days:.0f} days old: {offsets or 'nothing was answered'}"
    if days > MAX_AGE_DAYS or not offsets:
        return Finding(DEVICES, "sync-test", "note", text, remedy)
    return Finding(DEVICES, "sync-test", "ok", text)


def _surroundings(lab: LabConfig, clock: Clock, *, are_open: bool = False) -> tuple[Finding, ...]:
    return (
        *computer(lab, clock),
        *libraries(lab),
        *runtimes(lab),
        *ports(),
        *network(lab, are_open=are_open),
    )


def _devices(lab: LabConfig, trials: Sequence[Trial]) -> list[Finding]:
    by_role = {trial.role: trial for trial in trials}
    rows = [_device(d, by_role[r]) for r, d in lab.devices.items() if r in by_role]
    for trial in trials:
        for fault in trial.faults:
            if NOT_YET in fault.message:
                continue  # no finding: every session begins with a calibration
            level = "missing" if fault.severity == "blocking" else "warning"
            rows.append(Finding(DEVICES, trial.role, level, fault.message, fault.remedy))  # type: ignore[arg-type]  # one of two levels
    rows += [_absence(role) for role in roles_expected(lab) if role not in lab.devices]
    simulated_roles = [r for r in lab.devices if r not in by_role]
    if simulated_roles:
        rows.append(Finding(DEVICES, "simulated", "note", ", ".join(simulated_roles)))
    return rows


def _absence(role: str) -> Finding:
    """Return what it means that a role has no device: not every study measures gaze."""
    remedy = f"add {role} with its driver under devices (docs/configuration.md)"
    if role == "eye_tracker":
        text = "not configured; only studies that measure gaze need it"
        return Finding(DEVICES, role, "note", text, remedy)
    text = "not configured; every study needs a headset, or a screen (display.on_screen)"
    return Finding(DEVICES, role, "missing", text, remedy)


def _without_runtime(device: DeviceConfig, absent: Mapping[str, Finding]) -> Trial | None:
    """Return the error of a device whose runtime is missing; there is no use in opening it."""
    runtime = RUNTIME_NAMES.get(driver_spec(device.driver).wire.runtime, "")
    if device.simulated or runtime not in absent:
        return None
    return Trial(device.role, device.driver, False, error=f"needs {runtime}, which is missing")


def _device(device: DeviceConfig, trial: Trial) -> Finding:
    if trial.error:
        return Finding(
            DEVICES, device.role, "missing", f"{device.driver}: {trial.error}", trial.remedy
        )
    description = device.driver
    if trial.info is not None:
        names = (trial.info.vendor, trial.info.model, trial.info.serial)
        description = " ".join(n for n in names if n and n != "simulated")
        description += f", {trial.info.transport}"
    rates = [
        f"{s.rate_hz:.0f} of {s.nominal_rate_hz:g} Hz"
        for s in trial.streams
        if s.rate_hz and s.nominal_rate_hz
    ]
    battery = trial.health.battery_01 if trial.health else None
    if battery is not None:
        rates.append(f"battery {battery:.0%}")
    mark = ", simulated" if device.simulated else ""
    text = ", ".join([description, *rates[:2]]) + mark
    if battery is not None and battery < LOW_BATTERY_01:
        return Finding(DEVICES, device.role, "warning", text, "charge it before the session")
    silent = [s.stream for s in trial.streams if s.nominal_rate_hz and not s.samples]
    if silent:
        return Finding(
            DEVICES,
            device.role,
            "warning",
            f"{text}; no {', '.join(silent)} came",
            f"look longer: visavis devices test {device.role}",
        )
    return Finding(DEVICES, device.role, "ok", text)


def _licences() -> dict[str, str]:
    names = sorted({f.wire.library.distribution for f in driver_specs() if f.wire.library})
    return {name: licence_of(name) for name in names}
