"""examples: write ready studies and scripts, to run and to change."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from visavis.cli.app import app, console, say, verbatim
from visavis.running.new_study import write_examples


@app.command()
def examples(
    folder: Annotated[Path, typer.Argument(help="Where to write.")] = Path("examples"),
) -> None:
    """Write ready studies and scripts into a folder.

    Example: visavis examples
    """
    for path in write_examples(folder):
        say(f"wrote [b]{verbatim(str(path))}[/]")
    console.print("next:")
    for command in (
        f"cd {shlex.quote(str(folder))}",
        "visavis simulate ./glances.py --participants 8 --output out",
        "visavis analyse out/simulated/glances",
    ):
        say(f"  {verbatim(command)}")
