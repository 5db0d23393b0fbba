"""participant add, list, rename, withdraw, information: the ledger, and what people are told."""

import getpass
import shlex
from typing import Annotated, get_args

import typer
from rich.table import Table

from visavis.cli.app import (
    ConfigOption,
    DevicesOption,
    StudyArgument,
    app,
    console,
    load_lab,
    say,
    verbatim,
)
from visavis.cli.commands.session import LanguageOption, OnOption, SetOption
from visavis.cli.places_of_a_person import out_of_reach, print_places
from visavis.cli.studies import people_here
from visavis.lab.errors import UsageError
from visavis.protocol.people.exports_register import registered_exports
from visavis.protocol.people.ledger import Ledger
from visavis.recording.lock import is_held
from visavis.recording.manifest import read_manifest
from visavis.running.sessions.renaming import rename_participant
from visavis.study.information import information_at_devices, information_on_page
from visavis.study.parts import On

participant_app = typer.Typer(help="Issue, list and withdraw participant identifiers.")
app.add_typer(participant_app, name="participant")


@participant_app.command("add")
def add(
    study: StudyArgument,
    number: Annotated[
        str | None, typer.Argument(help="Number to issue; the next free one when left out.")
    ] = None,
    consent: Annotated[
        str, typer.Option("--consent", help="Version of the consent form signed.")
    ] = "",
    name: Annotated[
        str, typer.Option("--name", help="Who it is; goes to the key file, never to the data.")
    ] = "",
    replaces: Annotated[
        str | None,
        typer.Option("--replaces", help="Take over place and group of someone who withdrew."),
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Seed of a new study.")] = None,
    devices: DevicesOption = None,
    config: ConfigOption = None,
    assignments: SetOption = None,
) -> None:
    """Issue an identifier, never used again, and the first free place in the order.

    Example: visavis participant add stare 7 --consent 2
    """
    lab = load_lab(config, devices)
    here = people_here(study, lab, devices)
    requested_settings = here.requested_settings(seed=seed, assignments=assignments)
    settings = here.settle(requested_settings, seed_given=seed is not None)
    entry = here.ledger.add(
        None if number is None else here.ledger.number_of(number),
        group=here.group_of(settings),
        consent_version=consent or lab.privacy.consent_version,
        replaces=replaces,
    )
    if name and here.is_simulated:
        raise UsageError("simulated participants have no names")
    if name:
        here.key_file.identify(entry.label, {"name": name})
    group = here.study.study.procedure.shown_group(entry.group)
    console.print(
        f"[b]{verbatim(entry.label)}[/b] is participant {entry.number} of {verbatim(study)}, "
        f"place {entry.index + 1}" + (f", group {group}" if group else "")
    )
    console.print(
        f"next: visavis run {verbatim(shlex.quote(study))} --participant {verbatim(entry.label)}"
    )


@participant_app.command("list")
def list_them(
    study: StudyArgument, devices: DevicesOption = None, config: ConfigOption = None
) -> None:
    """List everyone in the ledger with what became of them.

    Example: visavis participant list stare
    """
    lab = load_lab(config, devices)
    here = people_here(study, lab, devices)
    table = Table("label", "place", "group", "consent", "status", "sessions", "added")
    entries = here.ledger.list()
    for e in entries:
        sessions = len(list(here.folder.glob(f"sub-{e.label}/ses-*/manifest.json")))
        table.add_row(
            e.label,
            str(e.index + 1),
            here.study.study.procedure.shown_group(e.group),
            e.consent_version,
            e.status,
            str(sessions),
            e.added_at[:16].replace("T", " "),
        )
    console.print(table)
    console.print(
        f"{len(entries)} in the ledger of {verbatim(here.study.name)}"
        + (" (simulated)" if here.is_simulated else "")
    )


@participant_app.command("information")
def information(
    study: StudyArgument,
    language: LanguageOption = None,
    on: OnOption = None,
    devices: DevicesOption = None,
    config: ConfigOption = None,
    assignments: SetOption = None,
) -> None:
    """Print what participants are told: the study's own words, and everything that is recorded.

    What is recorded follows from the study and the place; a page shows the same before consent.

    Example: visavis participant information stare --language de
    """
    lab = load_lab(config, devices)
    here = people_here(study, lab, devices)
    settings = here.requested_settings(assignments=assignments, language=language)
    design = here.study.experiment(settings.parameters)
    questions = here.study.questionnaires(lab.model_copy(update={"language": design.language}))
    if on not in (None, *get_args(On)):
        raise UsageError(f"--on takes {' or '.join(get_args(On))}, not {on!r}")
    is_on_page = (on or design.study.procedure.on) == "browser"
    texts = (
        design.texts.find("information", values=design.values_of(design.plan(0, 1))),
        (information_on_page if is_on_page else information_at_devices)(design, questions).as_text,
        design.texts.find("page.contact", values={"contact": lab.privacy.contact})
        if lab.privacy.contact
        else None,
    )
    say("\n\n".join(filter(None, texts)))


@participant_app.command("rename")
def rename(
    study: StudyArgument,
    participant: Annotated[str, typer.Argument(help="Label or number that is wrong.")],
    number: Annotated[str, typer.Argument(help="Number that was meant; it must be free.")],
    reason: Annotated[str, typer.Option("--reason", help="Why; it stands in the ledger.")],
    author: Annotated[
        str,
        typer.Option("--by", help="Who says so; the name you are logged in with if left out."),
    ] = "",
    devices: DevicesOption = None,
    config: ConfigOption = None,
) -> None:
    """Correct an identifier that was given by mistake, everywhere it stands.

    Ledger, folder, manifests, key file and lists name the right one; what was recorded, place and
    group stay. The wrong one is never issued again.

    Example: visavis participant rename stare 7 17 --reason "mistyped at the desk"
    """
    lab = load_lab(config, devices)
    here = people_here(study, lab, devices)
    renaming = rename_participant(
        here.folder,
        here.ledger,
        participant,
        here.ledger.number_of(number),
        reason=reason,
        author=author or getpass.getuser(),
        key_file=None if here.is_simulated else here.key_file,
    )
    label = renaming.person.label
    console.print(f"{renaming.former} is [b]{label}[/b] now: {renaming.sessions} sessions")
    for text in renaming.stale:
        console.print(
            f"[yellow]names {renaming.former}, make it again: {verbatim(text)}[/]", soft_wrap=True
        )
    say("copies that were sent to others and what was printed still bear the former identifier")


@participant_app.command("withdraw")
def withdraw(
    study: StudyArgument,
    participant: Annotated[str, typer.Argument(help="Label, such as 07H.")],
    reason: Annotated[str, typer.Option("--reason", help="Why, for the tombstone.")] = "",
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    devices: DevicesOption = None,
    config: ConfigOption = None,
) -> None:
    """Remove a person's data everywhere and leave a tombstone; cannot be undone.

    Example: visavis participant withdraw stare 07H --reason "asked by e-mail"
    """
    lab = load_lab(config, devices)
    here = people_here(study, lab, devices)
    folder, ledger = here.folder, here.ledger
    label = _label_of(ledger, participant)
    sessions = sorted(folder.glob(f"sub-{label}/ses-*/manifest.json"))
    running = [p.parent for p in sessions if is_held(p.parent)]
    at_page = bool(running) and read_manifest(running[0]).configuration.get("on") == "browser"
    if running and not at_page:
        raise UsageError(f"{running[0]} is running; end it first (Esc). Nothing was changed")
    if not yes and not typer.confirm(
        f"Remove {label}: {len(sessions)} sessions in {folder}? This cannot be undone."
    ):
        raise UsageError("nothing was removed")
    if at_page:
        ledger.begin_withdrawal(label, [folder], reason=reason)
        console.print(
            f"[yellow]{label} is at a page now.[/] `visavis serve` ends it and deletes everything "
            "within seconds; a page of `visavis run` is yours to end (Ctrl-C). Give this command "
            "again afterwards to see whether it is done"
        )
        return
    key_file = None if here.is_simulated else here.key_file
    beyond = out_of_reach([p.parent for p in sessions])
    removal = ledger.withdraw(participant, [folder], reason=reason, key_file=key_file)
    console.print(
        f"{label} is withdrawn: {len(sessions)} sessions removed, "
        f"rows cut from {len(removal.rows)} tables"
    )
    exports = [e for e in registered_exports(folder) if label in e.labels]
    print_places(removal, exports)
    for line in beyond:
        say(f"[yellow]not reached: {verbatim(line)}[/]")


def _label_of(ledger: Ledger, participant: str) -> str:
    """Return the label of a participant, even when their withdrawal is begun but not finished."""
    open_withdrawals = [e for e in ledger.list() if e.status == "withdrawing"]
    for entry in open_withdrawals:
        if participant.upper() in (entry.label, str(entry.number)):
            return entry.label
    return ledger.resolve(participant).label
