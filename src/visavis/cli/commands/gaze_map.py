"""gaze-map: where people looked on the scene, by condition."""

from pathlib import Path
from typing import Annotated

import typer

from visavis.cli.app import AcceptDamage, ConfigOption, app, say, verbatim
from visavis.cli.commands.study import PeekOption, StudyFolder
from visavis.cli.notifier import NOTIFIER
from visavis.cli.personal_copies import protect_and_register
from visavis.cli.studies import folder_of
from visavis.lab.errors import UsageError
from visavis.running.scripts import open_study
from visavis.running.sessions.study_folder import DERIVED_FOLDER, words_on_files


@app.command("gaze-map")
def gaze_map(
    folder: StudyFolder,
    by: Annotated[str, typer.Option("--by", help="The factor whose levels get a picture each.")],
    during: Annotated[
        str, typer.Option("--during", help="Only while this was shown, such as stimulus.")
    ] = "",
    compare: Annotated[
        str,
        typer.Option("--compare", help="Two levels, as in LEVEL,LEVEL, to compare these only."),
    ] = "",
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder; derived/figures when left out.")
    ] = None,
    accept_damage: AcceptDamage = False,
    peek: PeekOption = None,
    config: ConfigOption = None,
) -> None:
    """Draw how long people looked where, by condition, and where conditions differ.

    Every pair of up to three conditions is compared; of more, the first two or those of --compare.
    Gaze ends on what was drawn: people, things, walls. The scene is that of one trial, from the
    middle of all eyes; studies in which people walk have no such place and are refused. Where
    trials showed different pictures or films, each gets maps of its own. With --during, areas of
    interest of what was shown then are outlined. Of a panorama the whole picture is drawn, with
    its areas.

    Example: visavis gaze-map data/simulated/stare --by condition
    """
    # Late: drawing and figures take a second to import, and a wrong option needs none.
    from visavis.cli.gaze_map import gaze_maps
    from visavis.cli.gaze_map_figure import difference_words, write_maps

    pair = tuple(level.strip() for level in compare.split(",")) if compare else None
    if pair is not None and len(pair) != 2:
        raise UsageError(f"--compare {compare}: give two levels, as in --compare LEVEL,LEVEL")
    where = folder_of(folder, config, "gaze-map")
    data = open_study(where, accept_damage=accept_damage)
    if words := words_on_files(data.study, [session.recording for session in data]):
        say(f"[yellow]{verbatim(words)}[/]")
    with NOTIFIER.progress("gaze on the scene, trials") as on_trial:
        maps = gaze_maps(data, by, peek=peek, on_trial=on_trial, during=during, compare=pair)
    is_simulated = any(session.is_simulated for session in data)
    out = where / DERIVED_FOLDER / "figures" if output is None else output
    out.mkdir(parents=True, exist_ok=True)
    paths = []
    for of_picture in maps:
        paths += write_maps(of_picture, data.study, out, is_simulated=is_simulated)
        picture = f"{of_picture.picture}: " if of_picture.picture else ""
        say(verbatim(f"{picture}{difference_words(of_picture, data.study)}"))
    for path in paths:
        say(f"written [b]{verbatim(path)}[/]")
    protect_and_register("gaze map", [session.path for session in data], out, paths)
