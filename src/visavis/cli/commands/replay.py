"""replay: perform a recorded session again and find the first difference."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from visavis.cli.app import (
    ConfigOption,
    OfParticipant,
    SessionArgument,
    app,
    console,
    load_lab,
    say,
    verbatim,
)
from visavis.cli.commands.checking import EXIT_RED
from visavis.cli.studies import session_of
from visavis.lab.errors import UsageError
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import HEADS_AT_ONSET, OpenedStudy
from visavis.running.sessions.study_folder import study_of_session
from visavis.running.sessions.verification import is_in_real_time, verify
from visavis.study.cast import use_recorded_cast


@app.command()
def replay(
    session_path: SessionArgument,
    does_verify: Annotated[
        bool,
        typer.Option("--verify", help="Compare with what was recorded, bit for bit."),
    ] = False,
    participant: OfParticipant = "",
    config: ConfigOption = None,
) -> None:
    """Perform a recorded session again, and say where the two first differ.

    A session simulated on the virtual clock runs once more, by the same plan and drivers; of
    people, and of a simulation in real time, what the devices measured is evaluated again. Exit
    code 5 when anything differs. To see a session again, use `visavis view` or `visavis film`.

    Example: visavis replay data/simulated/stare/sub-S01B/ses-001 --verify
    """
    if not does_verify:
        raise UsageError(
            "replay performs a session again and compares: add --verify. To look at a session, "
            f"type visavis view {session_path}; for a film of a trial, visavis film {session_path} "
            "--trial T07 -o T07.mp4"
        )
    session_path = session_of(session_path, config, participant)
    recording = CachedRecording(session_path)
    use_recorded_cast(recording)
    study, change_note = study_of_session(recording)
    if change_note:
        say(f"[yellow]{verbatim(change_note)}[/]")
    _verify(recording, study, config)


def _verify(recording: CachedRecording, study: OpenedStudy, config: Path | None) -> None:
    lab = load_lab(config, "sim", only_simulates=True)
    in_real_time = recording.is_simulated and is_in_real_time(recording)
    if in_real_time:
        say(
            "simulated in real time, which no other run repeats bit for bit (--fast does): "
            "compared are its plan, and where gaze fell, from the samples as recorded"
        )
    if any(study.took_heads_at_onset(recording, part.number) for part in recording.manifest.parts):
        say(f"[yellow]{HEADS_AT_ONSET}[/]: it is compared so")
    with (
        console.status("performing the session again"),
        TemporaryDirectory(prefix="visavis") as scratch,
    ):
        verdict = verify(recording, study, lab, Path(scratch))
    rows = sum(verdict.row_counts.values())
    left_out_note = f"; not compared: {', '.join(verdict.left_out)}" if verdict.left_out else ""
    for number in verdict.ended_early:
        say(f"part {number} was cut off; what is there of it was compared")
    if verdict.first is None and verdict.is_fed:
        say(
            f"[green]the same, bit for bit[/]: {rows} gaze samples, evaluated again from gaze, "
            "head and scenes as recorded; "
            + ("its plan is the same, too" if in_real_time else "people are not performed again")
        )
        return
    if verdict.first is None:
        say(
            f"[green]the same, bit for bit[/]: {rows} rows of {len(verdict.row_counts)} streams, "
            f"events and trial rows{left_out_note}"
        )
        return
    say(f"[red]differs[/], first {verbatim(verdict.first.as_sentence())}")
    for name, count in verdict.differing.items():
        say(f"  {verbatim(name)}: {count} of {verdict.row_counts[name]} rows differ")
    raise typer.Exit(EXIT_RED)
