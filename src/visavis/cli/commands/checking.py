"""check, recover: what is on disk after a session."""

import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from visavis.analysis.foreign_check import XDF_ENDINGS, check_foreign
from visavis.analysis.report.notation import count_of
from visavis.analysis.session_check import check_session
from visavis.analysis.session_verdict import Level, SessionCheck
from visavis.cli.app import (
    ConfigOption,
    JsonOption,
    OfParticipant,
    SessionArgument,
    app,
    console,
    new_file,
    say,
    say_json,
    say_plainly,
    verbatim,
)
from visavis.cli.studies import folder_of, require_session, session_of
from visavis.lab.errors import LedgerError, RecordingError, UsageError
from visavis.recording.reader import Recording
from visavis.recording.recovery import recover as recover_session
from visavis.running.sessions.bill_of_lading import (
    MISSING,
    BillOfLading,
    bill_of_lading,
    compare_bill,
    write_bill,
)
from visavis.running.sessions.folder_check import (
    is_study,
    luminances_of,
    repair_study,
    study_problems,
)
from visavis.running.sessions.session_list import sign_list
from visavis.running.sessions.study_folder import session_folders

EXIT_RED = 5
DATA_SET = "dataset_description.json"
STYLE = {Level.GREEN: "green", Level.AMBER: "yellow", Level.RED: "bold red"}
MARK = {Level.GREEN: "✓", Level.AMBER: "!", Level.RED: "✗"}
PRESSES = (
    "responses are presses of keys and buttons; who chooses an answer by looking at it needs none"
)
ANSWER = {
    Level.GREEN: "They can leave.",
    Level.AMBER: "They can leave once you have looked at this.",
    Level.RED: "Keep them here.",
}


@app.command()
def check(
    session_path: SessionArgument,
    participant: OfParticipant = "",
    trials: Annotated[bool, typer.Option("--trials", help="List every trial.")] = False,
    sign: Annotated[
        bool,
        typer.Option("--sign", help="Of a study: sign off that what is gone is no part of it."),
    ] = False,
    baseline: Annotated[
        Path | None,
        typer.Option("--baseline", help="Of a study: write its bill of lading to this file."),
    ] = None,
    against: Annotated[
        str,
        typer.Option("--against", help="Of a study: compare with such a file, or with its hash."),
    ] = "",
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Can they leave? Compare what was planned with what was recorded.

    Given a study's folder, it verifies every file of every session, the settings and the ledger,
    misses every session that was ever begun there and that nobody withdrew, and prints the bill of
    lading: who was registered, who came, what each left, and its hash, which a report names. With
    --against a copy on another computer is compared with that.

    Recordings made elsewhere (an XDF file, a BIDS data set) are judged by their times: missing
    clock offsets, stamps that go back, gaps, rates, streams apart from the others.

    Example: visavis check data/simulated/stare/sub-S07H/ses-001
    """
    if session_path.name.lower().endswith(XDF_ENDINGS) or (session_path / DATA_SET).is_file():
        _check_foreign(session_path, as_json=as_json)
        return
    if participant:
        session_path = session_of(session_path, config, participant)
    elif not session_path.is_dir():
        session_path = folder_of(session_path, config)
    if is_study(session_path):
        for name in sign_list(session_path) if sign else ():
            say_plainly(f"signed off, no part of the study any more: {name}")
        _check_study(session_path, baseline, against, as_json=as_json, list_trials=trials)
        return
    if against or baseline is not None:
        raise UsageError("--baseline and --against are of a whole study; give its folder")
    require_session(session_path)
    verdict = check_session(Recording(session_path))
    if as_json:
        content = {**asdict(verdict), "redo": verdict.redo, "verdict": verdict.level.name.lower()}
        say_json(content)
    else:
        print_check(verdict, session_path, list_trials=trials)
    if verdict.level is Level.RED:
        raise typer.Exit(EXIT_RED)


def _check_foreign(path: Path, *, as_json: bool) -> None:
    verdicts = check_foreign(path)
    if as_json:
        content = [{**asdict(v), "level": v.level.name.lower()} for v in verdicts]
        say_json(content)
    else:
        for verdict in verdicts:
            rate = "" if verdict.rate_hz is None else f", {verdict.rate_hz:.1f} Hz"
            say(
                f"[{STYLE[verdict.level]}]{MARK[verdict.level]}[/] [b]{verbatim(verdict.name)}[/]  "
                f"{verdict.samples} samples{rate}"
                + ("" if verdict.findings else "  nothing wrong with its times")
            )
            for what, to_do in verdict.findings:
                say(f"    {verbatim(what)}\n      → {verbatim(to_do)}")
    if any(v.level is Level.RED for v in verdicts):
        raise typer.Exit(EXIT_RED)


def _check_study(
    folder: Path, baseline: Path | None, against: str, *, as_json: bool, list_trials: bool = False
) -> None:
    if baseline is not None:
        new_file(baseline)
    problems = study_problems(folder)
    bill = None
    with suppress(LedgerError, RecordingError):  # already listed among the problems
        bill = bill_of_lading(folder)
        problems += compare_bill(bill, against) if against else ()
    if baseline is not None and bill is not None:
        if problems:
            problems += (f"{baseline} was not written: mend what is named above first",)
        else:
            write_bill(bill, baseline)
    sessions = session_folders(folder)
    count = len(sessions)
    unfinished_sessions, by_table = _unfinished(sessions), luminances_of(sessions)
    verdicts: dict[Path, SessionCheck] = {}
    for session in sessions if list_trials else ():
        with suppress(RecordingError):  # already listed among the problems
            verdicts[session] = check_session(Recording(session))
    if as_json:
        content = {
            "sessions": count,
            "problems": problems,
            "unfinished": list(unfinished_sessions),
            "luminances": {sha: list(map(str, own)) for (sha, _), own in by_table.items()},
        }
        if bill is not None:
            content["bill_of_lading"] = {
                "sha256": bill.sha256,
                "lines": [asdict(line) for line in bill.lines],
            }
        if list_trials:
            content["trials"] = {
                str(s.relative_to(folder)): [asdict(t) for t in verdict.trials]
                for s, verdict in verdicts.items()
            }
        say_json(content)
    elif problems:
        for problem in problems:
            console.print(
                f"{MARK[Level.RED]} {problem}", style="red", markup=False, highlight=False
            )
        say(
            f"[bold]→ run `visavis recover {verbatim(shlex.quote(str(folder)))}`; "
            "it puts back what has an intact copy[/]"
        )
    else:
        console.print(f"[green]{count_of(count, 'session')}, every file verified[/]")
    if bill is not None and not as_json:
        _print_bill(bill)
    if not as_json:
        for path, (status, complete_count, trial_count) in unfinished_sessions.items():
            way_on = (
                "it goes on now"
                if status == "running"
                else f"visavis resume {shlex.quote(str(path))}"
            )
            say_plainly(
                f"{MARK[Level.AMBER]} not finished: {path}, {complete_count} of {trial_count} "
                f"trials; {way_on}",
                style="yellow",
            )
        if len(by_table) > 1:
            _print_luminances(folder, by_table)
        for session, verdict in verdicts.items():
            print_check(verdict, session, list_trials=True)
    if problems or any(verdict.level is Level.RED for verdict in verdicts.values()):
        raise typer.Exit(EXIT_RED)


def _print_luminances(folder: Path, by_table: Mapping[tuple[str, str], Sequence[Path]]) -> None:
    """Name the sessions of each table of luminances; their greys are not the same light."""
    say_plainly(
        f"{MARK[Level.AMBER]} sessions were drawn by different tables of luminances; compare their "
        "contrasts with care",
        style="yellow",
    )
    for (sha256, screen), sessions in by_table.items():
        table = f"table {sha256[:12]} of {screen}" if sha256 else "no table"
        names = ", ".join(str(session.relative_to(folder)) for session in sessions)
        say_plainly(f"    {table}: {names}", style="yellow")


def _print_bill(bill: BillOfLading) -> None:
    table = Table(box=None, pad_edge=False)
    for name in ("participant", "session", "", "trials", "files", "MB", "last seen"):
        table.add_column(name, justify="right" if name in ("trials", "files", "MB") else "left")
    for line in bill.lines:
        figures = (str(line.trials), str(line.files), f"{line.size_bytes / 1e6:.1f}")
        table.add_row(
            line.participant,
            line.session or "–",
            line.state,
            *(figures if line.files else ("–", "–", "–")),
            line.last_seen[:16] or "–",
            style="bold red" if line.state == MISSING else "",
        )
    console.print(table)
    console.print(f"bill of lading: [b]{bill.sha256}[/]", soft_wrap=True, highlight=False)


def _unfinished(sessions: Sequence[Path]) -> dict[str, tuple[str, int, int]]:
    """Return status, finished trials and planned trials of every unfinished session."""
    progress_by_path: dict[str, tuple[str, int, int]] = {}
    for session in sessions:
        with suppress(RecordingError):  # already listed among the problems
            recording = Recording(session)
            parts = recording.manifest.parts
            if not parts or parts[-1].status != "complete":
                trials = check_session(recording).trials
                complete_count = sum(t.status == "complete" for t in trials)
                progress_by_path[str(session)] = (recording.status, complete_count, len(trials))
    return progress_by_path


def print_check(verdict: SessionCheck, path: Path, *, list_trials: bool = False) -> None:
    """Print a verdict: its findings, its streams, and what to redo."""
    mark = "  [magenta]SIMULATED[/]" if verdict.is_simulated else ""
    console.print(
        f"[{STYLE[verdict.level]}]{verdict.level.name}  {ANSWER[verdict.level]}[/]"
        f"  participant {verdict.participant}{mark}"
    )
    table = Table(box=None, pad_edge=False)
    for name in ("", "what", "finding"):
        table.add_column(name)
    for finding in sorted(verdict.findings, key=lambda finding: -finding.level):
        mark = f"[{STYLE[finding.level]}]{MARK[finding.level]}[/]"
        table.add_row(mark, finding.subject, finding.message)
    console.print(table)
    streams = Table("stream", "samples", "expected", "rate", "longest gap", box=None)
    for s in verdict.streams:
        streams.add_row(
            f"{'' if s.level is Level.GREEN else MARK[s.level] + ' '}{s.stream}",
            str(s.rows),
            "–" if s.expected is None else str(s.expected),
            "–" if s.rate_hz is None else f"{s.rate_hz:.1f} Hz",
            "–" if s.longest_gap_ms is None else f"{s.longest_gap_ms:.0f} ms",
            style=STYLE[s.level] if s.level is not Level.GREEN else "",
        )
    if verdict.streams:
        console.print(streams)
    if any(s.stream == "responses" for s in verdict.streams):
        say(f"[dim]{PRESSES}[/]")
    if list_trials:
        rows = Table("trial", "block", "status", "attempts", "gaze valid/received/expected")
        for t in verdict.trials:
            counts = (
                "–"
                if t.gaze_expected is None
                else f"{t.gaze_valid}/{t.gaze_received}/{t.gaze_expected}"
            )
            rows.add_row(
                t.trial_id,
                str(t.block),
                t.status,
                str(t.attempts),
                counts,
                style="" if t.gaze_level is Level.GREEN else STYLE[t.gaze_level],
            )
        console.print(rows)
    for step in verdict.redo:
        console.print(f"[bold]→ {verbatim(step)}[/]")
    say(f"[dim]{verbatim(path)}[/]")


@app.command()
def recover(
    session_path: Annotated[
        Path, typer.Argument(help="Folder of a session (ses-…), or of a study.")
    ],
    as_json: JsonOption = False,
) -> None:
    """Take stock of a crashed session; raw files are never changed.

    Manifests, settings and ledgers that are damaged are put back from their copies.

    Example: visavis recover data/simulated/stare/sub-S07H/ses-001
    """
    if is_study(session_path):
        repairs = repair_study(session_path)
        for line in repairs:
            say_plainly(line)
        if not repairs:
            console.print("nothing needed to be put back")
        return
    require_session(session_path)
    report = recover_session(session_path)
    if as_json:
        say_json(asdict(report))
        return
    for line in report.repaired:
        say_plainly(line)
    console.print(f"[b]{report.trials}[/b] finished trials are safe in {verbatim(session_path)}")
    for part in report.parts:
        console.print(f"part {part.number}: {verbatim(part.status)}")
        for stream in part.streams:
            console.print(f"  {verbatim(stream.name)}: {stream.rows} rows")
        for problem in part.problems:
            console.print(f"  [yellow]{verbatim(problem)}[/]")
    status = Recording(session_path).status
    verb = (
        "Complete; look at it with: visavis check"
        if status == "complete"
        else ("Continue with: visavis resume")
    )
    say(f"{verb} {verbatim(session_path)}")
