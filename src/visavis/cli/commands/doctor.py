"""doctor: what is there, what is missing, what to do."""

import textwrap
from itertools import groupby
from typing import Annotated

import typer
from rich.markup import escape

from visavis.cli.app import (
    ConfigOption,
    DevicesOption,
    JsonOption,
    app,
    console,
    load_lab,
    say,
    say_json,
    verbatim,
)
from visavis.cli.device_report import print_trials
from visavis.cli.doctor.findings import Finding
from visavis.cli.doctor.report import SELF_TEST_S, as_document, examine, verdict
from visavis.cli.doctor.station import lock as lock_station
from visavis.lab.clock import SystemClock
from visavis.lab.errors import DeviceError

SIGNS = {
    "ok": "[green]✓[/]",
    "note": "[dim]·[/]",
    "warning": "[yellow]![/]",
    "missing": "[red]✗[/]",
}
SUBJECT_WIDTH = 14
MAX_SUBJECT = 24


@app.command()
def doctor(
    self_test: Annotated[
        bool, typer.Option("--self-test", help="Listen to every device for ten seconds, too.")
    ] = False,
    lock: Annotated[
        bool,
        typer.Option(
            "--lock", help="Lock this computer's timing; every start is compared with it."
        ),
    ] = False,
    devices: DevicesOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say in one screen what is there, what is missing and what to do.

    Example: visavis doctor
    """
    lab = load_lab(config, devices, only_simulates=True, quiet=as_json)
    if lock:
        path = lock_station(lab, SystemClock())
        if not as_json:
            say(f"timing of this computer locked in [b]{verbatim(path)}[/]")
    seconds = SELF_TEST_S if self_test else 0.0
    if as_json:
        report = examine(lab, SystemClock(), self_test_s=seconds)
        say_json(as_document(report))
    else:
        activity = f"listening to every device for {seconds:g} s" if self_test else "looking"
        with console.status(activity):
            report = examine(lab, SystemClock(), self_test_s=seconds)
        _print(report.findings)
        if report.trials and self_test:
            console.print()
            print_trials(report.trials)
        console.print()
        say(verdict(report))
    if report.is_stopped:
        raise typer.Exit(DeviceError.exit_code)


def _print(findings: tuple[Finding, ...]) -> None:
    for section, own in groupby(findings, key=lambda f: f.section):
        console.print(f"[b]{section}[/]")
        rows = list(own)
        width = min(MAX_SUBJECT, max(SUBJECT_WIDTH, *(len(f.subject) for f in rows), 0))
        for finding in rows:
            _print_line(finding, width)


def _print_line(finding: Finding, width: int) -> None:
    """Print a finding as an indented paragraph, with its remedy below."""
    lead = f"  {finding.subject:<{width}} "
    for number, text in enumerate(_wrapped(finding.found, console.width - len(lead) - 2)):
        start = f"{SIGNS[finding.level]} {lead[2:]}" if not number else " " * len(lead)
        faint = finding.level == "note"
        markup = f"[dim]{escape(text)}[/]" if faint else escape(text)
        say(f"{start}{markup}")
    if finding.remedy:
        for number, text in enumerate(_wrapped(finding.remedy, console.width - len(lead) - 4)):
            arrow = "→ " if not number else "  "
            say(f"{' ' * len(lead)}{arrow}{escape(text)}")


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, max(20, width), break_on_hyphens=False) or [""]
