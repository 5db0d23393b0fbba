"""character import, fetch, list and sheet: the people that scenes can show."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Literal, cast

import typer
from rich.table import Table

from visavis.cli.app import (
    ConfigOption,
    JsonOption,
    app,
    console,
    load_lab,
    new_file,
    say,
    say_json,
    say_plainly,
    say_written,
    verbatim,
)
from visavis.cli.motions import JointMapOption, read_joint_map
from visavis.cli.notifier import say_when_compiling
from visavis.cli.preview.people import distance_sheet, people_sheet
from visavis.cli.preview.pictures import check_picture_name
from visavis.cli.preview.readable_gaze import LIMIT_01, readable_at
from visavis.lab.config import LabConfig
from visavis.lab.errors import UsageError
from visavis.lab.yaml_lines import did_you_mean
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.checking import findings
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.library import (
    Imported,
    import_characters,
    library_names,
    people_in,
)
from visavis.stimuli.motion.faces import EXPRESSIONS
from visavis.stimuli.rooms.portrait import LightOf

characters = typer.Typer(
    help="People for scenes: list them, import your own, look at them.", no_args_is_help=True
)
app.add_typer(characters, name="character")

SHEET_TILE_PX = (480, 300)
VALID_ADDRESS = "https://github.com/c-frame/valid-avatars-glb"
VALID_LICENCE = "MIT, T. Do 2022"
VALID_NOTE = f"""VALID: 210 adults of seven ethnicities in five outfits, whose labels people from
33 countries validated (Do, Zelenty, Gonzalez-Franco and McMahan, 2023, Frontiers in Virtual
Reality 4:1248915, doi 10.3389/frvir.2023.1248915). Licence: {VALID_LICENCE}; cite the article.

  1. As .glb they lie at {VALID_ADDRESS} (454 MB).
     There choose Code, then Download ZIP.
  2. visavis character fetch valid valid-avatars-glb-main.zip --only '*_Casual'
  3. visavis character sheet valid.png

Reading them needs `pip install visavis[avatars]`."""

LibraryOption = Annotated[
    Path | None,
    typer.Option("--library", help="Folder of imported characters; the lab's when left out."),
]


def library_of(config: LabConfig) -> Path:
    """Return the folder in which a lab keeps its characters."""
    return config.characters


def _row(character: Character, origin: str) -> dict[str, object]:
    return {
        "name": character.name,
        "gender": character.gender,
        "has_gaze": character.has_gaze,
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
    folder = library or library_of(
        load_lab(config, only_simulates=True, quiet=as_json, with_cast=False)
    )
    rows = [_row(load_character(name), "Visavis") for name in cast_names()]
    rows += [_row(load_character(folder / f"{n}.npz"), "imported") for n in library_names(folder)]
    if as_json:
        say_json(rows)
        return
    table = Table("name", "gender", "height", "age", "gaze", "triangles", "origin")
    for row in rows:
        age = "" if row["age_years"] is None else f"{row['age_years']:.0f}"
        levels = " / ".join(str(n) for n in cast("list[int]", row["triangles"]))
        table.add_row(
            str(row["name"]),
            str(row["gender"] or ""),
            f"{row['stature_m']:.2f} m",
            age,
            "" if row["has_gaze"] else "none",
            levels,
            str(row["origin"]),
        )
    console.print(table)


@characters.command("sheet")
def sheet_command(
    png: Annotated[Path, typer.Argument(help="Picture to write.")],
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Whom to draw; when left out all imported ones, or the people who come with "
            "Visavis where nobody was imported."
        ),
    ] = None,
    at: Annotated[str, typer.Option(help="Distances in metres, such as 1,2,3.5,5,8.")] = "",
    px_per_deg: Annotated[
        float, typer.Option(help="Pixels a degree of the display, for --at.")
    ] = 12.0,
    gaze: Annotated[
        bool,
        typer.Option("--gaze", help="With --at: how well one sees whether they look at one."),
    ] = False,
    face: Annotated[
        str, typer.Option(help="Expressions side by side, such as neutral,smile,frown.")
    ] = "",
    light: Annotated[LightOf, typer.Option(help="By day, or by a lamp in the evening.")] = "day",
    config: ConfigOption = None,
    library: LibraryOption = None,
) -> None:
    """Draw people's faces at conversation distance: look at people before you use them.

    With --gaze a simulated observer judges from the pixels whether eyes look at it or 10° aside;
    half of its answers are right by chance. This takes some seconds for each face.

    Example: visavis character sheet imported.png
    """
    check_picture_name(png)
    new_file(png)
    distances_m = _distances_m(at)
    if gaze and not distances_m:
        raise UsageError("--gaze needs --at with the distances in metres, such as --at 2,3.5,5")
    expressions = tuple(filter(None, map(str.strip, face.split(","))))
    for expression in (part.strip() for joint in expressions for part in joint.split("+")):
        if expression not in EXPRESSIONS:
            near = did_you_mean(expression, EXPRESSIONS)
            raise UsageError(f"there is no face {expression!r}{near}")
    if expressions and distances_m:
        raise UsageError("give --face or --at: expressions are drawn at one distance")
    if not 1 <= px_per_deg <= 120:
        raise UsageError("--px-per-deg goes from 1 to 120")
    folder = library or library_of(load_lab(config, only_simulates=True, with_cast=False))
    library_people = library_names(folder)
    requested_names = tuple(names or library_people or (() if library else cast_names()))
    if not requested_names:
        raise UsageError(f"nobody has been imported into {folder}; see visavis character import")
    unknown_names = [n for n in requested_names if n not in (*library_people, *cast_names())]
    if unknown_names:
        choices = ", ".join((*library_people, *cast_names()))
        raise UsageError(f"there is no {', '.join(unknown_names)} in {folder}; known: {choices}")
    people = [
        load_character(folder / f"{n}.npz" if n in library_people else n) for n in requested_names
    ]
    say_when_compiling()
    sheet = (
        distance_sheet(people, distances_m, px_per_deg, light)
        if distances_m
        else people_sheet(SHEET_TILE_PX, people, expressions, light)
    )
    sheet.save(png)
    say_written(png)
    if gaze:
        _tell_gaze(people, distances_m, px_per_deg)


def _tell_gaze(
    people: Sequence[Character], distances_m: Sequence[float], px_per_deg: float
) -> None:
    """Print for each person how often direct gaze is told apart from gaze 10° aside."""
    for name in [person.name for person in people if not person.has_gaze]:
        say(f"{verbatim(name)}: has no gaze that could be recognised")
    with_gaze = [person for person in people if person.has_gaze]
    for person, distance_m, right_01 in readable_at(with_gaze, distances_m, px_per_deg):
        line = f"{person.name}: gaze recognised at {distance_m:g} m in {right_01:.0%} of looks"
        if right_01 < LIMIT_01:
            line += f"  [yellow]below {LIMIT_01:.0%}: let them look from nearer[/]"
        say(line)


@characters.command("import")
def import_command(
    source: Annotated[Path, typer.Argument(help="A .glb, .vrm or .fbx file, or a folder of them.")],
    config: ConfigOption = None,
    library: LibraryOption = None,
    gender: Annotated[
        str | None, typer.Option(help="female or male, where names of files do not say it.")
    ] = None,
    joint_map: JointMapOption = None,
    without_gaze: Annotated[
        bool,
        typer.Option(
            "--without-gaze",
            help="For figures whose eyes cannot turn: bystanders, whom no scene can ask to look.",
        ),
    ] = False,
    stature: Annotated[
        float | None, typer.Option(help="Scale everybody to so many metres, with shoes.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Import glTF characters into the lab's library; one line a file. FBX files need Blender.

    Example: visavis character import avatars/
    """
    if gender not in (None, "female", "male"):
        raise UsageError(f"--gender takes female or male, not {gender!r}")
    folder = library or library_of(load_lab(config, quiet=as_json, with_cast=False))
    checked_gender = cast("Literal['female', 'male'] | None", gender)
    joints = None if joint_map is None else read_joint_map(joint_map)
    results = import_characters(
        source,
        folder,
        gender=checked_gender,
        joint_map=joints,
        gaze=not without_gaze,
        stature_m=stature,
    )
    _tell_imports(results, folder, as_json=as_json)


@characters.command("fetch")
def fetch_command(
    which: Annotated[str, typer.Argument(help="valid: the VALID avatars.")],
    download: Annotated[
        Path | None, typer.Argument(help="What you downloaded: a .zip, or the folder.")
    ] = None,
    only: Annotated[
        str, typer.Option(help="Which files, such as '*_Casual'; all when left out.")
    ] = "*",
    config: ConfigOption = None,
    library: LibraryOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say where people that others made lie, or import them from what you downloaded.

    Example: visavis character fetch valid valid-avatars-glb.zip --only '*_Casual'
    """
    if which != "valid":
        raise UsageError(f"nothing is known of {which!r}; known: valid")
    if download is None:
        if as_json:
            say_json({"name": which, "address": VALID_ADDRESS, "licence": VALID_LICENCE})
        else:
            say_plainly(VALID_NOTE)
        return
    folder = library or library_of(load_lab(config, quiet=as_json, with_cast=False))
    with people_in(download, only) as people:
        _tell_imports(import_characters(people, folder), folder, as_json=as_json)


def _distances_m(text: str) -> tuple[float, ...]:
    """Return the distances in metres of a text such as "1,2,3.5"; an empty text has none.

    Raises:
        UsageError: a part is not a number from 0.3 to 30.
    """
    try:
        distances_m = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        distances_m = (0.0,)
    if not all(0.3 <= d <= 30 for d in distances_m):
        raise UsageError(f"--at {text!r}; write metres from 0.3 to 30, such as 1,2,3.5,5,8")
    return distances_m


def _tell_imports(results: Iterable[Imported], folder: Path, *, as_json: bool) -> None:
    rows: list[dict[str, object]] = []
    failure_count = 0
    for result in results:
        if result.character is None:
            failure_count += 1
            rows.append({"file": str(result.source), "problem": result.problem})
            line = f"[bold red]not imported[/]  {verbatim(result.problem)}"
        else:
            odd = (*result.odd, *findings(result.character))
            row = _row(result.character, "imported")
            rows.append({"file": str(result.source), **row, "findings": list(odd)})
            line = (
                f"[green]imported[/]  {verbatim(result.character.name)}: "
                f"{result.character.gender or 'a figure'}, {result.character.stature_m:.2f} m"
            )
            line += "" if result.character.has_gaze else ", without gaze"
            line += "".join(f"\n  [yellow]look:[/] {verbatim(text)}" for text in odd)
        if not as_json:
            say(line)
    if as_json:
        say_json(rows)
    elif failure_count < len(rows):
        say(
            f"They are in {verbatim(folder)}; they play once `cast` in lab_config.yaml names them. "
            "Look at them first: "
            "visavis character sheet imported.png --at 1,2,3.5,5,8 --gaze"
        )
    if failure_count:
        raise CharacterError(
            f"{failure_count} of {len(rows)} files could not be imported; mend them as said above "
            "and import them again"
        )
