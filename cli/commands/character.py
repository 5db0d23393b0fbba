"""character import, list and sheet: the people at hand, and those of the lab's own."""

from pathlib import Path
from typing import Annotated, Literal, cast

import typer
from rich.table import Table

from cli.app import (
    ConfigOption,
    JsonOption,
    app,
    console,
    load_lab,
    new_file,
    say,
    say_json,
    say_written,
    verbatim,
)
from lab.config import LabConfig
from lab.errors import UsageError
from stimuli.characters.cast import cast_names, load_character
from stimuli.characters.character import Character
from stimuli.characters.errors import CharacterError
from stimuli.characters.library import import_characters, library_names

characters = typer.Typer(
    help="People for scenes: list them, import your own, look at them.", no_args_is_help=True
)
app.add_typer(characters, name="character")

SHEET_TILE_PX = (480, 300)

LibraryOption = Annotated[
    Path | None,
    typer.Option("--library", help="Folder of imported characters; the lab's when left out."),
]


def library_of(config: LabConfig) -> Path:
    """Return the folder in which a lab keeps its characters."""
    return config.data_root / "characters"


def _row(character: Character, origin: str) -> dict[str, object]:
    return {
        "name": character.name,
        "gender": character.gender,
        "stature_m": character.stature_m,
        "age_years": character.age_years,
        "triangles": [len(mesh.triangles) for mesh in character.levels],
        "origin": origin,
        "licence": character.licence,
    }


@characters.command("list")
def list_characters(
    config: ConfigOption = None, library: LibraryOption = None, as_json: JsonOption = False
) -> None:
    """Name everybody who can stand in a scene.

    Example: visavis character list
    """
    folder = library or library_of(load_lab(config, only_simulates=True, quiet=as_json))
    rows = [_row(load_character(name), "Visavis") for name in cast_names()]
    rows += [_row(load_character(folder / f"{n}.npz"), "imported") for n in library_names(folder)]
    if as_json:
        say_json(rows)
        return
    table = Table("name", "gender", "height", "age", "triangles", "origin")
    for row in rows:
        age = "" if row["age_years"] is None else f"{row['age_years']:.0f}"
        levels = " / ".join(str(n) for n in cast("list[int]", row["triangles"]))
        table.add_row(
            str(row["name"]), str(row["gender"]), f"{row['stature_m']:.2f} m", age, levels,
            str(row["origin"]),
        )  # fmt: skip
    console.print(table)


@characters.command("sheet")
def sheet_command(
    png: Annotated[Path, typer.Argument(help="Picture to write.")],
    names: Annotated[
        list[str] | None, typer.Argument(help="Whom to draw; all imported ones when left out.")
    ] = None,
    config: ConfigOption = None,
    library: LibraryOption = None,
) -> None:
    """Draw people's faces at conversation distance: look at whom you imported before you use them.

    Example: visavis character sheet imported.png
    """
    from cli.preview.people import people_sheet
    from cli.preview.pictures import check_picture_name

    check_picture_name(png)
    new_file(png)
    folder = library or library_of(load_lab(config, only_simulates=True))
    imported = library_names(folder)
    wanted = tuple(names or imported)
    if not wanted:
        raise UsageError(f"nobody has been imported into {folder}; see visavis character import")
    strangers = [n for n in wanted if n not in (*imported, *cast_names())]
    if strangers:
        known = ", ".join((*imported, *cast_names()))
        raise UsageError(f"there is no {', '.join(strangers)} in {folder}; known: {known}")
    people = [load_character(folder / f"{n}.npz" if n in imported else n) for n in wanted]
    people_sheet(SHEET_TILE_PX, people).save(png)
    say_written(png)


@characters.command("import")
def import_command(
    source: Annotated[Path, typer.Argument(help="A .glb file, or a folder of them.")],
    config: ConfigOption = None,
    library: LibraryOption = None,
    gender: Annotated[
        str | None, typer.Option(help="female or male, where names of files do not say it.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Import glTF characters into the lab's library; one line a file.

    Example: visavis character import avatars/
    """
    if gender not in (None, "female", "male"):
        raise UsageError(f"--gender takes female or male, not {gender!r}")
    folder = library or library_of(load_lab(config, quiet=as_json))
    known = cast("Literal['female', 'male'] | None", gender)
    rows: list[dict[str, object]] = []
    failed = 0
    for result in import_characters(source, folder, gender=known):
        if result.character is None:
            failed += 1
            rows.append({"file": str(result.source), "problem": result.problem})
            line = f"[bold red]not imported[/]  {result.problem.replace('[', chr(92) + '[')}"
        else:
            rows.append({"file": str(result.source), **_row(result.character, "imported")})
            line = (
                f"[green]imported[/]  {result.character.name}: {result.character.gender}, "
                f"{result.character.stature_m:.2f} m"
            )
        if not as_json:
            say(line)
    if as_json:
        say_json(rows)
    elif failed < len(rows):
        say(f"They are in {verbatim(folder)}; name them in a scene as above.")
    if failed:
        raise CharacterError(
            f"{failed} of {len(rows)} files could not be imported; mend them as said above and "
            "import them again"
        )
