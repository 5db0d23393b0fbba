"""The application object, options shared by commands, and how errors reach the user."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import typer
from rich.console import Console
from rich.markup import escape
from rich.text import Text
from typer._completion_classes import completion_init
from typer.completion import install_callback, show_callback

from visavis.cli.command_table import LazyGroup
from visavis.lab.config_files import CONFIG_NAME, EXAMPLE, find_config
from visavis.lab.errors import ConfigError, UsageError

if TYPE_CHECKING:
    from visavis.lab.config import LabConfig


class _PlainConsole(Console):
    """Shows control characters of a text instead of sending them to the terminal.

    Names, labels and identifiers may come from strangers: an escape sequence in one could rewrite
    the operator's screen, or their clipboard.
    """

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text with markup; see `rich.console.Console.render_str`."""
        return super().render_str(CONTROL.sub(lambda c: ascii(c.group())[1:-1], text), **options)


CONTROL: Final = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that move a terminal's cursor, colour it or turn its writing, not tab and new line;
halves of characters, as in a file's name that is no UTF-8."""
console = _PlainConsole(emoji=False)
errors = _PlainConsole(stderr=True, emoji=False)


def verbatim(value: object) -> str:
    """Escape a text of the user's (a path, a label, a column) so that markup does not change it."""
    return escape(str(value))


def say(text: str, *, style: str = "") -> None:
    """Print text with markup, without hard line breaks and without automatic colours."""
    console.print(text, style=style, soft_wrap=True, highlight=False)


def say_plainly(text: str, *, style: str = "") -> None:
    """Print text without markup, so that brackets stay as they are."""
    console.print(text, style=style, soft_wrap=True, highlight=False, markup=False)


def say_json(values: object) -> None:
    """Print values as JSON: sets as sorted lists, other types that JSON lacks as text."""
    typer.echo(json.dumps(values, ensure_ascii=False, indent=1, default=as_json_value))


def as_json_value(value: object) -> object:
    """Return the JSON value for a type that JSON lacks: a sorted list for a set, else text."""
    return sorted(value) if isinstance(value, frozenset) else str(value)


def new_file(path: Path) -> Path:
    """Check that a new file can be written there, and return its path.

    Raises:
        UsageError: the file exists already, or its folder does not.
    """
    if path.exists():
        raise UsageError(f"{path} exists already; choose another name")
    if not path.parent.is_dir():
        raise UsageError(f"there is no folder {path.parent}; make it first")
    return path


def say_written(path: Path, more: str = "") -> None:
    """Print where a file was written."""
    say(f"written [b]{verbatim(path)}[/]{more}")


app = typer.Typer(
    name="visavis",
    cls=LazyGroup,
    help="Run virtual-reality perception experiments: plan, run, simulate, check, analyse.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,  # below as our own options: typer's would load pydantic at every start
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
    """Hold the options of all commands; with it typer makes a group even of one command."""


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
    """Read the lab's configuration, and print on stderr which file it is unless `quiet`.

    Without a path, the file is searched in the current folder and those above. If there is none, a
    command that `only_simulates` takes the example that comes with Visavis, with its folders in
    the current one. `with_cast` makes the lab's own people available to scenes.

    Raises:
        DesignError: a person of the lab's cast is missing.
        ConfigError: there is no configuration, or it has errors; all of them are listed.
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
    # Late: both import pydantic, which only commands that read a configuration need.
    from visavis.devices.registry import OPTION_MODELS
    from visavis.lab.config import load_config, parse_config, with_devices

    if path is None:
        config = parse_config(EXAMPLE.read_text("utf-8"), EXAMPLE, OPTION_MODELS, folder=here)
        description = f"example of Visavis, simulated; no {CONFIG_NAME} (visavis init)"
    else:
        config = load_config(path, OPTION_MODELS)
        description = f"{config.path} ({config.lab})"
    if not quiet:
        errors.print(
            f"[dim]configuration: {escape(description)}[/]", soft_wrap=True, highlight=False
        )
    if config.cast and with_cast:
        # Late: only labs with people of their own need to load characters.
        from visavis.study.cast import use_cast_of

        use_cast_of(config)
    if devices is None:
        return config
    return with_devices(config, "sim" if devices == "sim" else "real")
