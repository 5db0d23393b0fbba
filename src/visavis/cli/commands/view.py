"""view: show a recorded session on one page in the browser."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from visavis.cli.app import (
    AcceptDamage,
    ConfigOption,
    OfParticipant,
    SessionArgument,
    app,
    console,
    verbatim,
)
from visavis.cli.personal_copies import protect_and_register, require_whole
from visavis.cli.studies import session_of
from visavis.cli.viewer.content import page_content, trial_lengths_ns
from visavis.cli.viewer.page import page_of
from visavis.cli.viewer.rerun_file import write_rerun
from visavis.lab.errors import UsageError
from visavis.recording.cached import CachedRecording
from visavis.running.sessions.study_folder import study_of_folder
from visavis.study.cast import use_recorded_cast


@app.command()
def view(
    session_path: SessionArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="The page; beside nothing else: SESSION.html here."),
    ] = None,
    trial: Annotated[
        list[str] | None,
        typer.Option("--trial", help="Show this trial alone in space; give it again for more."),
    ] = None,
    rerun: Annotated[
        Path | None,
        typer.Option("--rerun", help="Write a file for the Rerun viewer (.rrd) instead."),
    ] = None,
    show: Annotated[bool, typer.Option("--show", help="Open it in the browser.")] = False,
    participant: OfParticipant = "",
    accept_damage: AcceptDamage = False,
    config: ConfigOption = None,
) -> None:
    """Write a page that shows a session again: the scene, gaze, body, contacts, every stream.

    The page is one file that needs no network and holds every trial; --trial chooses those that
    are there in space, for a smaller page made in less time.

    Example: visavis view data/simulated/stare/sub-S01B/ses-001 --trial T07 -o T07.html
    """
    session_path = session_of(session_path, config, participant)
    recording = CachedRecording(session_path)
    use_recorded_cast(recording)
    manifest = recording.manifest
    name = f"{manifest.study}_{manifest.participant}_ses-{manifest.session:03}.html"
    path = rerun or (Path(name) if output is None else output)
    if path.exists():
        raise UsageError(f"{path} exists already; choose another name with -o")
    if not path.parent.is_dir():
        raise UsageError(f"there is no folder {path.parent}; make it first")
    # Read with the study's own file: the scenes are made anew from the recording.
    require_whole(session_path, accept=accept_damage)
    study, change_note = study_of_folder(session_path.resolve().parent.parent, manifest.study)
    if change_note:
        console.print(f"[yellow]{verbatim(change_note)}[/]", soft_wrap=True)
    lengths = trial_lengths_ns(recording)
    trial_names = trial or list(lengths)
    with Progress(console=console, transient=True) as bar:
        line = bar.add_task("looking at trials", total=len(trial_names))
        if rerun is not None:
            write_rerun(
                study,
                recording,
                trial_names,
                path,
                lambda count, total: bar.update(line, completed=count, total=total),
            )
            console.print(f"written [b]{verbatim(path)}[/]; rerun {verbatim(path)} shows it")
            return
        header, bundle = page_content(
            study,
            recording,
            trial_names,
            lambda count, total: bar.update(line, completed=count, total=total),
        )
    path.write_text(page_of(header, bundle), encoding="utf-8")
    size_mb = path.stat().st_size / 1e6
    summary = f"{len(trial_names)} of {len(lengths)} trials in space, {size_mb:.1f} MB"
    console.print(f"written [b]{verbatim(path)}[/], {summary}", soft_wrap=True)
    # A page is personal data: protect and register it, so that a withdrawal finds it.
    protect_and_register("page", [session_path], path.parent, [path])
    if show:
        webbrowser.open(path.resolve().as_uri())
