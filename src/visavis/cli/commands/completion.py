"""completion: let a shell complete commands and options."""

from enum import StrEnum
from typing import Annotated, Any

import typer

from visavis.cli.app import app, console, say, verbatim
from visavis.lab.errors import UsageError


class Shell(StrEnum):
    """Shells that complete."""

    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"
    POWERSHELL = "powershell"
    PWSH = "pwsh"


@app.command()
def completion(
    shell: Annotated[
        Shell | None, typer.Option(help="Which shell; the one you type in when left out.")
    ] = None,
    show: Annotated[bool, typer.Option("--show", help="Print it, install nothing.")] = False,
) -> None:
    """Let your shell complete the commands and their options.

    Example: visavis completion
    """
    from typer import completion as of_typer

    typer_completion: Any = of_typer  # Any: the module does not declare what it exports
    if show:
        script = typer_completion.get_completion_script(
            prog_name="visavis", complete_var="_VISAVIS_COMPLETE", shell=str(shell or Shell.BASH)
        )
        console.print(script, markup=False, highlight=False, soft_wrap=True)
        return
    try:
        shell_name, path = typer_completion.install(
            shell=None if shell is None else str(shell),
            prog_name="visavis",
            complete_var="_VISAVIS_COMPLETE",
        )
    except (typer.Exit, OSError) as error:
        raise UsageError(
            "this shell is not known; name one with --shell, or print it with --show"
        ) from error
    say(
        f"completion for {shell_name} is installed in [b]{verbatim(str(path))}[/]; open a new "
        "terminal"
    )
