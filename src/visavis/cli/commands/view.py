"""view: show a recorded session on one page in the browser."""

import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Final

import typer
from rich.progress import Progress

from visavis.cli.app import (
    AcceptDamage,
    ConfigOption,
    OfParticipant,
    SessionArgument,
    app,
    console,
    load_lab,
    verbatim,
)
from visavis.cli.ending import let_signals_interrupt
from visavis.cli.personal_copies import protect_and_register, require_whole
from visavis.cli.studies import folder_of, label_of_session, session_of
from visavis.cli.viewer.content import page_content, trial_lengths_ns
from visavis.cli.viewer.page import TrialsBeside, page_of
from visavis.cli.viewer.rerun_file import write_rerun
from visavis.cli.viewer.together import together_content
from visavis.cli.way_in import DEFAULT_HOST, Way, listening_of
from visavis.lab.clock import SystemClock
from visavis.lab.errors import ConfigError, UsageError
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.people.identifiers import means_label
from visavis.recording.cached import CachedRecording
from visavis.running.page.seen_trial import is_on_page
from visavis.running.sessions.study_folder import sessions_of, study_of_session
from visavis.study.cast import use_recorded_cast

PORT: Final = 8080
"""Where a page for a headset is served; a free one where something else is there."""


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
    headset: Annotated[
        bool,
        typer.Option("--headset", help="Serve it for a headset: stand where they stood (WebXR)."),
    ] = False,
    lan: Annotated[
        bool,
        typer.Option("--lan", help="With --headset: https on the lab's network, for headsets."),
    ] = False,
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
    of several participants of a study at once. With --headset it is served until Ctrl-C, with a
    button that enters VR; a file is kept only where -o names one.

    Example: visavis view data/simulated/stare/sub-S01B/ses-001 --trial T07 -o T07.html
    """
    if lan and not headset:
        raise UsageError("--lan is the way of a headset to the page: say --headset, too")
    if headset and rerun is not None:
        raise UsageError("--rerun writes a file that no headset shows: give it without --headset")
    if participants and (rerun is not None or participant or not trial or len(trial) != 1):
        raise UsageError(
            "--participants shows one trial of several people: give one --trial, and neither "
            "--participant nor --rerun"
        )
    trial_id = trial[0] if trial else ""
    serve = _serving(config, is_lan=lan) if headset else None
    with _folder_of_page(is_temporary=serve is not None and output is None) as folder:
        if participants:
            place = folder_of(session_path, config, "view")
            sessions = _sessions_with(place, participants, trial_id)
            name = f"{place.name}_{trial_id}_participants.html"
        else:
            sessions = [session_of(session_path, config, participant)]
            manifest = CachedRecording(sessions[0]).manifest
            name = f"{manifest.study}_{manifest.participant}_ses-{manifest.session:03}.html"
        path = _free_path(rerun or output or folder / name)
        for session in sessions:
            if serve is not None:
                _require_place(session)
            require_whole(session, accept=accept_damage)
        if rerun is not None:
            _write_again(sessions[0], trial, path, is_rerun=True)
            return
        if participants:
            files = _write_together(place, sessions, trial_id, path, in_headset=headset)
        else:
            files = _write_again(sessions[0], trial, path, in_headset=headset)
        if serve is None or output is not None:
            # A page is personal data: protect and register it, so that a withdrawal finds it.
            protect_and_register("page", sessions, path.parent, files)
        if serve is not None:
            if output is None:
                console.print("The page is deleted at the end; -o FILE keeps one.")
            serve(path, files[1:], shows=show)
        elif show:
            webbrowser.open(path.resolve().as_uri())


@contextmanager
def _folder_of_page(*, is_temporary: bool) -> Iterator[Path]:
    """Yield where a page without a name of its own is written: here, or where nothing is left."""
    if not is_temporary:
        yield Path()
        return
    let_signals_interrupt()
    with TemporaryDirectory(prefix="visavis-") as folder:
        yield Path(folder)


def _serving(config: Path | None, *, is_lan: bool) -> Callable[..., None]:
    """Return what serves a page for a headset; what it lacks is said before the page is made.

    Raises:
        ConfigError: a library is not installed.
        UsageError: this computer is on no network.
    """
    try:
        # Late: aiohttp comes with visavis[browser], which pages that are files do not need.
        from visavis.cli.viewer.serving import serve_page
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"--headset needs {error.name}, which is not installed; run: pip install "
            "'visavis[browser]'"
        ) from error
    way = Way("", DEFAULT_HOST, PORT, is_lan=is_lan)
    keys = load_lab(config, only_simulates=True, quiet=True).key_root if is_lan else Path()
    return partial(serve_page, way, listening_of(way, keys, SystemClock()))


def _require_place(session: Path) -> None:
    """Refuse a session in which nobody stood anywhere.

    Raises:
        UsageError: saying why it has no place for a headset.
    """
    recording = CachedRecording(session)
    if is_on_page(recording):
        raise UsageError(
            f"{session} was performed on a page, which has no place to stand in; view it without "
            "--headset"
        )
    if "head" not in recording.stream_names:
        raise UsageError(
            f"{session} has no stream of the head, so nobody knows where they stood; view it "
            "without --headset"
        )


def _write_again(
    session: Path,
    trial: list[str] | None,
    path: Path,
    *,
    is_rerun: bool = False,
    in_headset: bool = False,
) -> list[Path]:
    """Write a session's page, or its file for Rerun; return the files, the page first."""
    recording = CachedRecording(session)
    use_recorded_cast(recording)
    # Read with the study's own file: the scenes are made anew from the recording.
    study, change_note = study_of_session(recording)
    if change_note:
        console.print(f"[yellow]{verbatim(change_note)}[/]", soft_wrap=True)
    lengths = trial_lengths_ns(recording)
    trial_names = trial or list(lengths)
    beside = TrialsBeside(path)
    with Progress(console=console, transient=True) as bar:
        line = bar.add_task("looking at trials", total=len(trial_names))

        def advance(count: int, total: int) -> None:
            bar.update(line, completed=count, total=total)

        if is_rerun:
            write_rerun(study, recording, trial_names, path, advance)
            console.print(f"written [b]{verbatim(path)}[/]; rerun {verbatim(path)} shows it")
            return [path]
        header, bundle = page_content(study, recording, trial_names, advance, beside.write)
    if in_headset:
        header["headset"] = True
    if change_note and is_on_page(recording):  # elsewhere what was shown is in the recording
        header["warning"] = "the study has changed since: drawn as it is now"
    path.write_text(page_of(header, bundle), encoding="utf-8")
    size_mb = sum(file.stat().st_size for file in (path, *beside.files)) / 1e6
    summary = f"{len(trial_names)} of {len(lengths)} trials in space, {size_mb:.1f} MB"
    console.print(f"written [b]{verbatim(path)}[/], {summary}", soft_wrap=True)
    if beside.files:
        console.print(
            f"{len(beside.files)} files of trials and films are in "
            f"[b]{verbatim(beside.folder)}[/], which the page loads them from: keep both together",
            soft_wrap=True,
        )
    return [path, *beside.files]


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


def _write_together(
    folder: Path, sessions: list[Path], trial_id: str, path: Path, *, in_headset: bool
) -> list[Path]:
    """Write a page with one trial of several sessions; return its files."""
    recordings = [CachedRecording(session) for session in sessions]
    study, change_note = study_of_session(*recordings)
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
    if in_headset:
        header["headset"] = True
    path.write_text(page_of(header, bundle), encoding="utf-8")
    size_mb = path.stat().st_size / 1e6
    summary = f"{trial_id} of {len(sessions)} sessions, {size_mb:.1f} MB"
    console.print(f"written [b]{verbatim(path)}[/], {summary}", soft_wrap=True)
    return [path]
