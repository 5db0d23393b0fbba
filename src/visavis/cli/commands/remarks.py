"""note, exclude: what the lab remarks on a person or a trial after the session."""

import getpass
import shlex
from pathlib import Path
from typing import Annotated

import typer

from visavis.cli.app import ConfigOption, app, say, verbatim
from visavis.cli.commands.study import StudyFolder
from visavis.cli.studies import folder_of
from visavis.lab.clock import SystemClock
from visavis.lab.errors import UsageError
from visavis.lab.yaml_lines import did_you_mean, names_or_none
from visavis.protocol.people.file_lock import locked
from visavis.protocol.people.identifiers import means_label
from visavis.recording.manifest import read_manifest
from visavis.recording.remarks import Kind, Remark, add_remark, exclusions_in_force, remarks_of
from visavis.running.sessions.study_folder import sessions_of

LOCK_NAME = ".remarks.lock"

WhoArgument = Annotated[str, typer.Argument(help="Participant: label or number.")]
TrialOption = Annotated[
    str, typer.Option("--trial", help="One trial (T03); everything of the participant if left out.")
]
SessionOption = Annotated[
    int, typer.Option("--session", help="One session; all of the participant if left out.")
]
AuthorOption = Annotated[
    str, typer.Option("--by", help="Who says so; the name you are logged in with if left out.")
]


@app.command()
def note(
    folder: StudyFolder,
    who: WhoArgument,
    text: Annotated[str, typer.Argument(help="What there is to note.")],
    trial: TrialOption = "",
    session: SessionOption = 0,
    author: AuthorOption = "",
    config: ConfigOption = None,
) -> None:
    """Note something on a person or a trial after the session.

    The report shows it with author and date; nothing that counts is changed.

    Example: visavis note ./duel.py 2 "asked whether the people were real" --by "A. Meier"
    """
    remark = _remark(folder, config, "note", (who, session, trial), text, author)
    say(f"noted on {verbatim(remark.participant)} {remark.trial_id}".rstrip())


@app.command()
def exclude(
    folder: StudyFolder,
    who: WhoArgument,
    reason: Annotated[str, typer.Option("--reason", help="Why; it stands in the report.")],
    trial: TrialOption = "",
    session: SessionOption = 0,
    author: AuthorOption = "",
    take_back: Annotated[
        bool, typer.Option("--take-back", help="Take an earlier exclusion by hand back.")
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Leave out a person or a trial by hand, with reason and author.

    Tables, figures and the report follow at the next `analyse`; the recording stays as it is.

    Example: visavis exclude ./duel.py 2 --trial T03 --reason "the phone rang" --by "A. Meier"
    """
    kind: Kind = "include" if take_back else "exclude"
    remark = _remark(folder, config, kind, (who, session, trial), reason, author)
    what = f"{verbatim(remark.participant)} {remark.trial_id}".rstrip()
    say(f"{what} is {'taken in again' if take_back else 'left out'}, from the next analysis on:")
    say(f"  visavis analyse {verbatim(shlex.quote(str(folder_of(folder, config))))}")


def _remark(
    path: Path,
    config: Path | None,
    kind: Kind,
    about: tuple[str, int, str],
    text: str,
    author: str,
) -> Remark:
    """Add a remark to the person's folder and return it.

    Raises:
        UsageError: there is no such person, session or trial, nothing is said, or there is nothing
            to take back.
    """
    study = folder_of(path, config, "note" if kind == "note" else "exclude")
    who, session, trial = about
    label, trial_id = _place(study, who, session, trial)
    if not text.strip():
        raise UsageError("nothing is said; give a text in quotation marks")
    remark = Remark(
        kind,
        label,
        session,
        trial_id,
        " ".join(text.split()),
        " ".join(author.split()) or getpass.getuser(),
        SystemClock().wall_iso(),
    )
    folder = study / f"sub-{label}"
    with locked(study / LOCK_NAME):
        before = exclusions_in_force(remarks_of(folder))
        if kind == "include" and remark.about not in {r.about for r in before}:
            there = "; ".join(map(_words, before)) or "none"
            raise UsageError(f"{_words(remark)} was not left out by hand; left out are: {there}")
        add_remark(folder, remark)
    return remark


def _words(remark: Remark) -> str:
    session = f" session {remark.session}" if remark.session else ""
    return f"{remark.participant}{session} {remark.trial_id}".rstrip()


def _place(study: Path, who: str, session: int, trial: str) -> tuple[str, str]:
    """Return label and trial as they are written in the study.

    Raises:
        UsageError: they are not there, with those that are.
    """
    sessions = sessions_of(study)
    labels = list(dict.fromkeys(s.parent.name.removeprefix("sub-") for s in sessions))
    label = next((name for name in labels if means_label(who, name)), None)
    if label is None:
        raise UsageError(f"{who} has no session there; there are {names_or_none(labels)}")
    manifests = [read_manifest(s) for s in sessions if s.parent.name == f"sub-{label}"]
    numbers = [m.session for m in manifests]
    if session and session not in numbers:
        there = ", ".join(map(str, numbers))
        raise UsageError(f"{label} has no session {session}; there are {there}")
    trials = {
        str(t["trial_id"])
        for m in manifests
        if session in (0, m.session)
        for block in m.plan.get("blocks", ())
        for t in block["trials"]
    }
    if trial and trial.upper() not in trials:
        near = did_you_mean(trial.upper(), sorted(trials))
        raise UsageError(f"{label} has no trial {trial}{near}")
    return label, trial.upper()
