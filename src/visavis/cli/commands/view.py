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
from visavis.cli.studies import folder_of, label_of_session, session_of
from visavis.cli.viewer.content import page_content, trial_lengths_ns
from visavis.cli.viewer.page import TrialsBeside, page_of
from visavis.cli.viewer.rerun_file import write_rerun
from visavis.cli.viewer.together import together_content
from visavis.lab.errors import UsageError
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.people.identifiers import means_label
from visavis.recording.cached import CachedRecording
from visavis.running.sessions.study_folder import sessions_of, study_of_folder
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
    participants: Annotated[
        str,
        typer.Option(
            "--participants",
            help="Of a study: show one --trial of several at once: all, or labels as 01,02,05.",
        ),
    ] = "",
    accept_damage: AcceptDamage = False,
    config: ConfigOption = None,
) -> None:
    """Write a page that shows a session again: the scene, gaze, body, contacts, every stream.

    The page is one file that needs no network and holds every trial; --trial chooses those that
    are there in space, for a smaller page made in less time. With --participants it shows one trial
    of several participants of a study at once.

    Example: visavis view data/simulated/stare/sub-S01B/ses-001 --trial T07 -o T07.html
    """
    if participants:
        if rerun is not None or participant or not trial or len(trial) != 1:
            raise UsageError(
                "--participants shows one trial of several people: give one --trial, and neither "
                "--participant nor --rerun"
            )
        folder = folder_of(session_path, config, "view")
        sessions = _sessions_with(folder, participants, trial[0])
        path = _free_path(output or Path(f"{folder.name}_{trial[0]}_participants.html"))
        for session in sessions:
            require_whole(session, accept=accept_damage)
        _write_together(folder, sessions, trial[0], path)
        protect_and_register("page", sessions, path.parent, [path])
        if show:
            webbrowser.open(path.resolve().as_uri())
        return
    session_path = session_of(session_path, config, participant)
    recording = CachedRecording(session_path)
    use_recorded_cast(recording)
    manifest = recording.manifest
    name = f"{manifest.study}_{manifest.participant}_ses-{manifest.session:03}.html"
    path = _free_path(rerun or (Path(name) if output is None else output))
    # Read with the study's own file: the scenes are made anew from the recording.
    require_whole(session_path, accept=accept_damage)
    study, change_note = study_of_folder(session_path.resolve().parent.parent, manifest.study)
    if change_note:
        console.print(f"[yellow]{verbatim(change_note)}[/]", soft_wrap=True)
    lengths = trial_lengths_ns(recording)
    trial_names = trial or list(lengths)
    beside = TrialsBeside(path)
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
            beside.write,
        )
    path.write_text(page_of(header, bundle), encoding="utf-8")
    size_mb = sum(file.stat().st_size for file in (path, *beside.files)) / 1e6
    summary = f"{len(trial_names)} of {len(lengths)} trials in space, {size_mb:.1f} MB"
    console.print(f"written [b]{verbatim(path)}[/], {summary}", soft_wrap=True)
    if beside.files:
        console.print(
            f"{len(beside.files)} trials are in [b]{verbatim(beside.folder)}[/], which the page "
            "loads them from: keep both together",
            soft_wrap=True,
        )
    # A page is personal data: protect and register it, so that a withdrawal finds it.
    protect_and_register("page", [session_path], path.parent, [path, *beside.files])
    if show:
        webbrowser.open(path.resolve().as_uri())


def _free_path(path: Path) -> Path:
    """Return a path where nothing is yet, in a folder that is there."""
    if path.exists():
        raise UsageError(f"{path} exists already; choose another name with -o")
    if not path.parent.is_dir():
        raise UsageError(f"there is no folder {path.parent}; make it first")
    return path


def _sessions_with(folder: Path, participants: str, trial_id: str) -> list[Path]:
    """Return the sessions of a study that have a trial, of the participants named, or of all.

    Raises:
        UsageError: somebody named is not there, or nobody has the trial.
    """
    sessions = list(sessions_of(folder))
    if participants != "all":
        labels = {session: label_of_session(session) for session in sessions}
        names = [name.strip() for name in participants.split(",") if name.strip()]
        for name in names:
            if not any(means_label(name, label) for label in labels.values()):
                there = names_or_none(dict.fromkeys(labels.values()))
                raise UsageError(f"{name} has no session in {folder}; there are {there}")
        sessions = [s for s in sessions if any(means_label(name, labels[s]) for name in names)]
    sessions_with_trial = [s for s in sessions if trial_id in trial_lengths_ns(CachedRecording(s))]
    if not sessions_with_trial:
        raise UsageError(f"nobody of {participants} in {folder} has a whole trial {trial_id}")
    labels_without = [label_of_session(s) for s in sessions if s not in sessions_with_trial]
    if labels_without:
        console.print(
            f"[yellow]without a whole {trial_id}: {verbatim(', '.join(labels_without))}[/]"
        )
    return sessions_with_trial


def _write_together(folder: Path, sessions: list[Path], trial_id: str, path: Path) -> None:
    """Write a page with one trial of several sessions."""
    recordings = [CachedRecording(session) for session in sessions]
    study, change_note = study_of_folder(folder, recordings[0].manifest.study)
    if change_note:
        console.print(f"[yellow]{verbatim(change_note)}[/]", soft_wrap=True)
    with Progress(console=console, transient=True) as bar:
        line = bar.add_task("looking at sessions", total=len(sessions))
        header, bundle = together_content(
            study,
            recordings,
            trial_id,
            lambda count, total: bar.update(line, completed=count, total=total),
        )
    path.write_text(page_of(header, bundle), encoding="utf-8")
    size_mb = path.stat().st_size / 1e6
    summary = f"{trial_id} of {len(sessions)} sessions, {size_mb:.1f} MB"
    console.print(f"written [b]{verbatim(path)}[/], {summary}", soft_wrap=True)
