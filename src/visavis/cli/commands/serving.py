"""serve, board: a study on pages for many participants at once, and its progress."""

import asyncio
import re
import signal
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.table import Table

from visavis.cli.app import (
    ConfigOption,
    DevicesOption,
    JsonOption,
    StudyArgument,
    app,
    console,
    errors,
    load_lab,
    say,
    say_json,
    verbatim,
)
from visavis.cli.commands.session import LanguageOption, SeedOption, SetOption
from visavis.cli.ending import ENDING_SIGNALS
from visavis.cli.notifier import NOTIFIER, prepare_pages
from visavis.cli.studies import StudyHere, people_here, study_of_lab
from visavis.cli.way_in import DEFAULT_HOST, LOOPBACK, Way, listening_of, words_of_code
from visavis.lab.clock import SystemClock
from visavis.lab.errors import DesignError, UsageError
from visavis.protocol.session.operator import UnattendedOperator
from visavis.running.film_store import FilmStore, film_store, require_roles_of_pages
from visavis.running.page.arrivals import check_completion
from visavis.running.page.board import STATES, board_of
from visavis.running.page.opening_code import OpeningCode
from visavis.running.sessions.data_root import require_space
from visavis.running.sessions.session_request import Request, SessionPerson
from visavis.study.experiment import StudyExperiment

NOT_SECURE: Final = (
    "Browsers take this address for no safe one: films, figures and pictures that come damaged are "
    "not noticed (each session records checks_files: false), and no headset is entered. Serve it "
    "with --lan, or by https behind a proxy."
)

CompletionOption = Annotated[
    str,
    typer.Option(
        "--completion", help="Where people go afterwards; {id} is what their panel calls them."
    ),
]


@app.command()
def serve(
    study: StudyArgument,
    public: Annotated[
        str,
        typer.Option(
            "--public", help="Address under which people reach it: https://study.example.org"
        ),
    ] = "",
    host: Annotated[
        str, typer.Option("--host", help="Where to listen; 0.0.0.0 for other computers.")
    ] = DEFAULT_HOST,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="0: a free one.")] = 8080,
    participants: Annotated[
        str,
        typer.Option(
            "--participants",
            help="How many people may take part, then it is full: 40; or of each group: 20/group.",
        ),
    ] = "",
    completion: CompletionOption = "",
    lan: Annotated[
        bool,
        typer.Option(
            "--lan",
            help="https on the lab's network, for headsets; a code shown here opens sessions.",
        ),
    ] = False,
    certificate: Annotated[
        Path | None,
        typer.Option(
            "--certificate", help="With --lan: the lab's own (PEM), for the name in --public."
        ),
    ] = None,
    key: Annotated[
        Path | None, typer.Option("--key", help="The key of --certificate (PEM, no password).")
    ] = None,
    seed: SeedOption = None,
    devices: DevicesOption = None,
    config: ConfigOption = None,
    assignments: SetOption = None,
    language: LanguageOption = None,
) -> None:
    """Serve a study to many participants at once, each with a session of their own.

    Everybody who opens the address gets the order that the fewest have, and the same session again
    when they come back. With --devices sim all of it is a rehearsal.

    With --lan headsets on the lab's network come by https, and by a code that is shown here.

    Example: visavis serve ./lively.py --public https://study.example.org --participants 40
    """
    check_completion(completion)
    places = people_wanted(participants)
    way = Way(public.rstrip("/"), host, port, lan, certificate, key)
    way.check()
    here, base = page_study(study, devices, config, seed, assignments, language)
    asyncio.run(_serve(here, base, way, places, completion))


def people_wanted(text: str, option: str = "--participants") -> tuple[int | None, int | None]:
    """Return how many people may take part, of all and of each group; None without a limit.

    Raises:
        UsageError: it is neither NUMBER nor NUMBER/group.
    """
    match = re.fullmatch(r"([1-9][0-9]{0,6})(/group)?", text.strip())
    if match is None and text:
        raise UsageError(f"{option} takes a number such as 40, or 20/group, not {text!r}")
    if match is None:
        return None, None
    return (None, int(match[1])) if match[2] else (int(match[1]), None)


def page_study(
    study: str,
    devices: str | None,
    config: Path | None,
    seed: int | None,
    assignments: list[str] | None,
    language: str | None,
) -> tuple[StudyHere, Request]:
    """Return a study on pages in its lab, and the request that each participant completes.

    Raises:
        UsageError: the study is not declared on the kit.
    """
    lab = load_lab(config, devices)
    opened_study = study_of_lab(study, lab)
    if devices != "sim":
        lab = lab.model_copy(update={"devices": {}})
    here = StudyHere(lab, opened_study)
    requested_settings = here.requested_settings(
        seed=seed, assignments=assignments, language=language
    )
    opened_study.experiment_to_run(requested_settings.parameters)  # before anything is written
    require_space(lab)
    settings = here.settle(requested_settings, seed_given=seed is not None)
    note = here.require_same_design(settings, requested_settings)
    if note:
        NOTIFIER.warn(note)
    experiment = opened_study.experiment(settings.parameters)
    if not isinstance(experiment, StudyExperiment):
        raise UsageError(f"{opened_study.name} is not declared on the kit; it shows no page")
    base = Request(
        study=opened_study,
        experiment=experiment,
        config=lab,
        person=SessionPerson("", 0),
        seed=settings.seed,
        clock=SystemClock(),
        operator=UnattendedOperator(),
        effect=settings.effect,
        on="browser",
    )
    return here, base


def build_films(base: Request, *, begins_sessions: bool) -> "FilmStore":
    """Return a study's films; make what is missing of them, and of scenes, with a progress bar.

    Raises:
        DesignError: no page can show it, or, where sessions begin, it needs what no page has.
    """
    experiment = base.experiment
    assert isinstance(experiment, StudyExperiment)  # noqa: S101  # page_study has checked it
    if begins_sessions:
        require_roles_of_pages(experiment)
    store = film_store(experiment)
    prepare_pages(store, experiment)
    return store


async def _serve(
    here: StudyHere,
    base: Request,
    way: Way,
    wanted: tuple[int | None, int | None],
    completion: str,
) -> None:
    # Late: aiohttp comes with visavis[browser], which the other commands here do not need.
    from visavis.running.page.reception import Reception, Rules
    from visavis.running.page.server import PageServer

    listening = listening_of(way, base.config.key_root, base.clock)
    near, certificate = listening.near, listening.certificate
    key_file = None if here.is_simulated else here.key_file

    def withdraw(label: str) -> None:
        here.ledger.withdraw(label, [here.folder], reason="asked on the page", key_file=key_file)

    def warn(text: str) -> None:
        errors.print(f"[yellow]{verbatim(text)}[/]", soft_wrap=True)

    try:
        store = build_films(base, begins_sessions=True)
    except DesignError as error:
        if not board_of(here.ledger.list(), here.folder).counts["left"]:
            raise
        store = build_films(base, begins_sessions=False)
        warn(f"{error}. Nobody new is let in; people who left go on where they were")
    code = OpeningCode(say=warn) if way.is_lan else None
    reception = Reception(
        base,
        store,
        here.ledger,
        Rules(wanted[0], completion, wanted[1]),
        identify=lambda label, who: None if key_file is None else key_file.identify(label, who),
        identity_of=lambda label: None if key_file is None else key_file.identity(label),
        forget=lambda label: None if key_file is None else key_file.forget(label),
        withdraw=withdraw,
        say=warn,
        code=code,
    )
    server = PageServer(listening.names, reception)
    await server.start(listening.host, way.port, certificate.context if certificate else None)
    until = asyncio.Event()
    loop = asyncio.get_running_loop()
    for name in ENDING_SIGNALS:
        if hasattr(signal, name):
            with suppress(NotImplementedError):  # Windows: only Ctrl-C works
                loop.add_signal_handler(getattr(signal, name), until.set)
    own = f"{'https' if way.is_lan else 'http'}://{LOOPBACK[0]}:{server.port}"
    if way.certificate is not None:  # it is for no other name
        own = way.public
    mark = "[magenta]REHEARSAL[/]  " if here.is_simulated else ""
    console.print(f"{mark}For participants:", soft_wrap=True)
    addresses = [way.public] if way.public else [f"https://{n}:{server.port}" for n in near]
    if not way.is_lan:
        address = way.public or own
        addresses = [address, f"{address}/?PROLIFIC_PID={{{{%PROLIFIC_PID%}}}}"]
    for line in addresses:
        console.print(f"  [b]{verbatim(line)}[/]", soft_wrap=True, highlight=False)
    if code is not None and certificate is not None:
        for line in words_of_code(way, code.digits, certificate):
            console.print(line, soft_wrap=True, highlight=False)
    if way.is_insecure:
        warn(NOT_SECURE)
    if note := way.other_port(server.port):
        warn(note)
    console.print("For you alone; do not share it:", soft_wrap=True)
    console.print(f"  [b]{own}/board#{reception.board_key}[/]", soft_wrap=True, highlight=False)
    console.print("Ctrl-C ends it; every answer is kept, and people go on when it is back.")
    try:
        await reception.serve(server, until)
    finally:
        await server.stop()


@app.command()
def board(
    study: StudyArgument,
    devices: DevicesOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show who of a study on pages is where: trials, time, flags, who left, who stopped.

    `visavis serve` prints the address of the same as a page. Example: visavis board ./lively.py
    """
    here = people_here(study, load_lab(config, devices, quiet=as_json), devices)
    procedure = here.study.study.procedure
    study_board = board_of(here.ledger.list(), here.folder, shown_group=procedure.shown_group)
    if as_json:
        say_json(study_board.as_data())
        return
    if not study_board.places:
        say(f"No participants of {here.study.name} yet in {here.folder}.")
        return
    mark = "SIMULATED  " if here.is_simulated else ""
    table = Table(title=f"{mark}{here.study.name}", title_justify="left", box=None)
    for name in ("participant", "where", "trials", "minutes", "group", "flags"):
        table.add_column(name, justify="right" if name in ("trials", "minutes") else "left")
    for place in study_board.places:
        table.add_row(
            place.label,
            STATES.get(place.state, place.state),
            f"{place.trials_done} of {place.trials_planned}" if place.trials_planned else "–",
            "–" if place.minutes is None else f"{place.minutes:.1f}",
            place.group or "–",
            ", ".join(place.flags) or "–",
        )
    console.print(table)
    summary = ", ".join(
        f"{n} {STATES.get(state, state)}" for state, n in study_board.counts.items()
    )
    median = study_board.median_minutes
    console.print(summary + ("" if median is None else f"; median time {median:.1f} min"))
