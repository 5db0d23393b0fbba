"""serve, board: a study on pages for many participants at once, and its progress."""

import asyncio
import re
import signal
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final
from urllib.parse import urlsplit

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
from visavis.cli.commands.session import ENDING_SIGNALS, LanguageOption, SeedOption, SetOption
from visavis.cli.notifier import NOTIFIER, prepare_pages
from visavis.cli.studies import StudyHere, people_here, study_of_lab
from visavis.lab.clock import SystemClock
from visavis.lab.errors import ConfigError, DesignError, UsageError
from visavis.protocol.session.operator import UnattendedOperator
from visavis.running.film_store import FilmStore, film_store, require_roles_of_pages
from visavis.running.page.arrivals import check_completion
from visavis.running.page.board import STATES, board_of
from visavis.running.sessions.data_root import require_space
from visavis.running.sessions.session_request import Request, SessionPerson
from visavis.study.experiment import StudyExperiment

if TYPE_CHECKING:
    from visavis.running.page.lan import Certificate

EVERYWHERE: Final = ("0.0.0.0", "::")  # noqa: S104  # refused without a name to come under

LOOPBACK: Final = ("127.0.0.1", "localhost")
DEFAULT_HOST: Final = LOOPBACK[0]
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


@dataclass(frozen=True)
class Way:
    """How people's browsers reach a server.

    `public` is the address that whoever serves gave, `host` and `port` are where it listens. With
    `is_lan` it speaks https on the lab's network, by the `certificate` and `key` of the lab or by
    one of its own.
    """

    public: str
    host: str
    port: int
    is_lan: bool = False
    certificate: Path | None = None
    key: Path | None = None

    @property
    def name(self) -> str:
        """The name in the address that was given, "" without one."""
        return urlsplit(self.public).hostname or ""

    @property
    def is_insecure(self) -> bool:
        """Whether browsers take the given address for no safe one, as they do http of a network."""
        return urlsplit(self.public).scheme == "http" and self.name not in LOOPBACK

    def other_port(self, port: int) -> str:
        """Return what to say where people's browsers come to another port than is listened at with
        `is_lan`; "" where they do not.
        """
        parts = urlsplit(self.public)
        typed = parts.port or 443
        if not self.is_lan or not self.public or typed == port:
            return ""
        return (
            f"{self.public} leads browsers to port {typed}, and this listens at {port}: unless "
            f"something leads from there to here, say --public https://{parts.hostname}:{port}"
        )

    def check(self) -> None:
        """Check that the options fit together.

        Raises:
            UsageError: saying which do not, and what to do.
        """
        parts = urlsplit(self.public)
        if self.public and (parts.scheme not in ("http", "https") or not parts.hostname):
            raise UsageError(f"--public takes an address, https://…, not {self.public!r}")
        if parts.path.strip("/") or parts.query or parts.fragment:
            raise UsageError(
                f"--public takes the name of a server alone, not {self.public!r}: pages lie at "
                "its root"
            )
        if self.is_lan:
            if self.public and parts.scheme != "https":
                raise UsageError(f"--lan speaks https; say --public https://{parts.netloc}")
            if (self.certificate is None) != (self.key is None):
                raise UsageError("--certificate and --key go together: two PEM files")
            if self.certificate is not None and not self.public:
                raise UsageError(
                    "say with --public which name of the certificate people type, such as "
                    f"--public https://study.example.org:{self.port}"
                )
        elif self.certificate is not None or self.key is not None:
            raise UsageError("--certificate and --key are for --lan; without it a proxy has them")
        elif self.host in EVERYWHERE and not self.public:
            raise UsageError(
                f"--host {self.host} listens to other computers; say with --public under which "
                "address they come, such as http://192.168.1.5:8080, or use --lan"
            )


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
    from visavis.running.page.lan import addresses_here
    from visavis.running.page.opening_code import OpeningCode
    from visavis.running.page.reception import Reception, Rules
    from visavis.running.page.server import PageServer

    listens_everywhere = way.host in EVERYWHERE or (way.is_lan and way.host == DEFAULT_HOST)
    near = (addresses_here() if listens_everywhere else (way.host,)) if way.is_lan else ()
    if way.is_lan and not (way.name or near):
        raise UsageError("this computer has no address on a network; join one, or say --host")
    names = tuple(dict.fromkeys(filter(None, (way.name, *near, *LOOPBACK))))
    certificate = _certificate(way, names, base) if way.is_lan else None
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
    server = PageServer((*names, way.host), reception)
    host = EVERYWHERE[0] if way.is_lan and listens_everywhere else way.host
    await server.start(host, way.port, certificate.context if certificate else None)
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
        for line in _on_a_lan(way, code.digits, certificate):
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


def _on_a_lan(way: Way, digits: str, own_certificate: "Certificate") -> Iterator[str]:
    """Yield what whoever serves on a network reads: the code, and how to know the server again."""
    yield "Code that opens a session:"
    yield f"  [b]{digits[:3]} {digits[3:]}[/]"
    if way.certificate is None:
        yield (
            "Browsers warn, as this computer made its certificate itself: go on (Advanced) if the "
            "one they show has this SHA-256:"
        )
    else:
        yield "SHA-256 of the certificate:"
    half = len(own_certificate.fingerprint) // 2
    yield f"  {own_certificate.fingerprint[:half]}"
    yield f"  {own_certificate.fingerprint[half + 1 :]}"


def _certificate(way: Way, names: tuple[str, ...], base: Request) -> "Certificate":
    """Return the certificate that a server on a network shows.

    Raises:
        UsageError: the lab's own does not hold.
        ConfigError: none can be made, as a library is not installed.
    """
    # Late: as in _serve.
    from visavis.running.page.lan import certificate_of

    if way.certificate is not None and way.key is not None:
        return certificate_of(way.certificate, way.key, [way.name])
    try:
        # cryptography comes with visavis[lan], which whoever has a certificate does not need.
        from visavis.running.page.own_certificate import own_certificate
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"a certificate of its own needs {error.name}, which is not installed; run: pip "
            "install 'visavis[lan]', or give the lab's with --certificate and --key, or join one "
            "headset by cable and serve without --lan (adb reverse tcp:8080 tcp:8080)"
        ) from error
    now = datetime.fromisoformat(base.clock.wall_iso())
    return own_certificate(base.config.key_root, names, now)


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
