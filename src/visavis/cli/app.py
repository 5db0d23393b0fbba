"""The application object, options shared by commands, and how errors reach the user."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer
from rich.console import Console
from rich.markup import escape
from typer._completion_classes import completion_init
from typer.completion import install_callback, show_callback

from visavis.cli.command_table import LazyGroup
from visavis.lab.config_files import CONFIG_NAME, EXAMPLE, find_config
from visavis.lab.errors import ConfigError, UsageError

if TYPE_CHECKING:
    from visavis.lab.config import LabConfig

console = Console(emoji=False)
errors = Console(stderr=True, emoji=False)


def verbatim(value: object) -> str:
    """Return text of the user's (a path, a label, a column) so that markup prints it as it is."""
    return escape(str(value))


def say(text: str, *, style: str = "") -> None:
    """Print text with markup; only the terminal wraps it, and nothing in it is coloured by kind."""
    console.print(text, style=style, soft_wrap=True, highlight=False)


def say_plainly(text: str, *, style: str = "") -> None:
    """Print text as it is, brackets too."""
    console.print(text, style=style, soft_wrap=True, highlight=False, markup=False)


def say_json(found: object) -> None:
    """Print values for other programs; sets sorted, what JSON does not know as text."""
    typer.echo(json.dumps(found, ensure_ascii=False, indent=1, default=as_json_value))


def as_json_value(value: object) -> object:
    """Return what stands in JSON for a value it does not know."""
    return sorted(value) if isinstance(value, frozenset) else str(value)


def new_file(path: Path) -> Path:
    """Return a path to be written.

    Raises:
        UsageError: it exists already, or its folder does not.
    """
    if path.exists():
        raise UsageError(f"{path} exists already; choose another name")
    if not path.parent.is_dir():
        raise UsageError(f"there is no folder {path.parent}; make it first")
    return path


def say_written(path: Path, more: str = "") -> None:
    """Say where something lies now."""
    say(f"written [b]{verbatim(path)}[/]{more}")


app = typer.Typer(
    name="visavis",
    cls=LazyGroup,
    help="Run virtual-reality perception experiments: plan, run, simulate, check, analyse.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,  # as options of ours: typer's own would load pydantic at every start
)
completion_init()


def _print_version(is_asked: bool) -> None:
    if is_asked:
        from visavis.lab.version import version  # late: it loads importlib.metadata

        typer.echo(f"visavis {version()}")
        raise typer.Exit


@app.callback()
def _every_command(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Say which Visavis this is.", callback=_print_version, is_eager=True
        ),
    ] = False,
    install_completion: Annotated[
        bool,
        typer.Option(
            "--install-completion",
            help="Let this shell complete verbs and options.",
            callback=install_callback,
            is_eager=True,
        ),
    ] = False,
    show_completion: Annotated[
        bool,
        typer.Option(
            "--show-completion",
            help="Print the lines that do so, to put them elsewhere.",
            callback=show_callback,
            is_eager=True,
        ),
    ] = False,
) -> None:
    """Hold what all commands share; it makes a group of even one loaded command."""


ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", help="The lab's file; lab_config.yaml here or above when left out."),
]
StudyArgument = Annotated[
    str, typer.Argument(help="A study by name, such as stare, or its file, such as ./duel.py.")
]
SessionArgument = Annotated[
    Path,
    typer.Argument(help="A session's folder (ses-…), or a study: its folder, file, or name."),
]
OfParticipant = Annotated[
    str,
    typer.Option("--participant", help="Whose session, where a study was named; else the latest."),
]
AcceptDamage = Annotated[
    bool,
    typer.Option("--accept-damage", help="Go on with what is left of a damaged recording."),
]
DevicesOption = Annotated[
    str | None, typer.Option("--devices", help="sim or real: overrides every role.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for other programs.")]

F = TypeVar("F", bound=Callable[..., object])


def load_lab(
    path: Path | None,
    devices: str | None = None,
    *,
    only_simulates: bool = False,
    quiet: bool = False,
    with_cast: bool = True,
) -> "LabConfig":
    """Read the configuration in force and say on stderr which one that is, unless `quiet`.

    Without a path it is looked for in the current folder and those above. Where there is none, a
    command that `only_simulates` takes the example that comes with Visavis, with its folders in
    the current one. `with_cast` lets the lab's own people play from now on.

    Raises:
        DesignError: somebody of the lab's cast is not there.
        ConfigError: there is no configuration, or everything that is wrong in it.
        UsageError: `devices` is neither sim nor real.
    """
    if devices not in (None, "sim", "real"):
        raise UsageError(f"--devices takes sim or real, not {devices!r}")
    here = Path.cwd()
    path = path or find_config(here)
    if path is None and (devices == "real" or not only_simulates):
        raise ConfigError(
            f"there is no {CONFIG_NAME} in {here} or above it; run `visavis init` to write one "
            "here, or give the path of yours with --config"
        )
    # Late: both take pydantic along, which only commands that read a configuration need.
    from visavis.devices.registry import OPTION_MODELS
    from visavis.lab.config import load_config, parse_config, with_devices

    if path is None:
        config = parse_config(EXAMPLE.read_text("utf-8"), EXAMPLE, OPTION_MODELS, folder=here)
        description = (
            f"the example of Visavis, everything simulated: there is no {CONFIG_NAME} here or "
            "above (visavis init writes one)"
        )
    else:
        config = load_config(path, OPTION_MODELS)
        description = f"{config.path} ({config.lab})"
    if not quiet:
        errors.print(
            f"[dim]configuration: {escape(description)}[/]", soft_wrap=True, highlight=False
        )
    if config.cast and with_cast:
        from visavis.study.cast import use_cast_of  # late: characters, where a lab has its own

        use_cast_of(config)
    if devices is None:
        return config
    return with_devices(config, "sim" if devices == "sim" else "real")
