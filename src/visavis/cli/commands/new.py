"""new: write the files of a new study."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from visavis.cli.app import ConfigOption, app, console, load_lab, say
from visavis.cli.studies import study_of_lab
from visavis.running.new_study import new_study


@app.command()
def new(
    name: Annotated[str, typer.Argument(help="What the study is called: small letters and _.")],
    base: Annotated[
        str | None,
        typer.Option("--from", help="Begin with this study (name or file); say what differs."),
    ] = None,
    folder: Annotated[Path, typer.Option("--folder", help="Where to write.")] = Path(),
    config: ConfigOption = None,
) -> None:
    """Write a study to begin with: its file, its texts, and a test.

    Example: visavis new duel
    """
    source = None
    if base is not None:
        lab = load_lab(config, only_simulates=True, quiet=True)
        opened_study = study_of_lab(base, lab)
        opened_study.experiment_to_run({})
        source = opened_study.study
    for path in new_study(name, folder, source):
        say(f"wrote [b]{path}[/]")
    file = shlex.quote(f"./{(folder / name).as_posix()}.py")
    console.print("next, as it stands or with your changes:")
    for command in (
        f"visavis preview {file} --sheet {name}.png",
        f"visavis simulate {file} --participants 6 --output out",
        f"visavis analyse out/simulated/{name}",
        f"python -m pytest {shlex.quote(str(folder / f'test_{name}.py'))}",
    ):
        say(f"  {command}")
