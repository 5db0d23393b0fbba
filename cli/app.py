"""The application object, options shared by commands, and how errors reach the user."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TypeVar

import typer
from rich.console import Console

from cli.command_table import LazyGroup
from lab.config import LabConfig, load_config, with_devices
from lab.errors import ConfigError, UsageError

CONFIG_NAME = "lab_config.yaml"
REPOSITORY = Path(__file__).resolve().parent.parent

console = Console()
errors = Console(stderr=True)

app = typer.Typer(
    name="visavis",
    cls=LazyGroup,
    help="Run virtual-reality perception experiments: plan, run, simulate, check, analyse.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,
)


@app.callback()
def _every_command() -> None:
    """Hold what all commands share: nothing; it makes a group of even one loaded command."""


ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", help="The lab's configuration; ./lab_config.yaml when left out."),
]
StudyArgument = Annotated[str, typer.Argument(help="Name of the study, such as stare.")]
DevicesOption = Annotated[
    str | None, typer.Option("--devices", help="sim or real: overrides every role.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for other programs.")]

F = TypeVar("F", bound=Callable[..., object])


def load_lab(path: Path | None, devices: str | None = None) -> LabConfig:
    """Read the lab's configuration; without a path, here and then as shipped.

    Raises:
        ConfigError: listing everything that is wrong in the file.
        UsageError: `devices` is neither sim nor real.
    """
    if path is None:
        here = Path.cwd() / CONFIG_NAME
        path = here if here.exists() else REPOSITORY / CONFIG_NAME
    if not path.exists():
        raise ConfigError(
            f"no lab configuration at {path}; run `visavis init` to write one, "
            "or give its path with --config"
        )
    from devices.option_models import option_models  # pydantic, only for commands that need it

    config = load_config(path, option_models())
    if devices is None:
        return config
    if devices not in ("sim", "real"):
        raise UsageError(f"--devices takes sim or real, not {devices!r}")
    return with_devices(config, "sim" if devices == "sim" else "real")
