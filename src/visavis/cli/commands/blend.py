"""blend: make a walk of examples by adjectives, features or weights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import pandas as pd
import typer

from visavis.cli.app import JsonOption, app, errors, new_file, say, say_json, say_written, verbatim
from visavis.cli.reach_map import write_reach_map
from visavis.cli.walk_film import write_walk_film
from visavis.experiments.adjectives.pairs import FACTORS
from visavis.experiments.adjectives.raters import expected_impressions
from visavis.lab.errors import ConfigError, UsageError
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.gltf.exporting import glb_of_character, write_glb
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.bvh import write_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.clip_file import write_clip
from visavis.stimuli.motion.synthesis.example_blend import Blend, shares_of
from visavis.stimuli.motion.synthesis.example_files import ExampleFolder, read_examples
from visavis.stimuli.motion.synthesis.examples import Examples, is_walk
from visavis.stimuli.motion.synthesis.gesture_styles import GESTURES, gesture_examples
from visavis.stimuli.motion.synthesis.reach import reach_of
from visavis.stimuli.motion.synthesis.style_weights import MIN_SPARE, StyleWeights, fit_weights
from visavis.stimuli.motion.synthesis.walk_features import (
    FEATURES,
    GROUPS,
    feature_table,
    features_of,
    unit_of,
)
from visavis.stimuli.motion.synthesis.walk_styles import style_names, walk_examples, walk_set
from visavis.study.live import Live, Slider

SETS: Final = ("set_a", "set_b", *GESTURES)
FILMS: Final = (".mp4", ".webm", ".avi")
SUFFIXES: Final = (".bvh", ".npz", ".glb", *FILMS)
REACH_BLENDS: Final = 1500
"""Blends that are measured for a map of what can be reached."""
MIDDLE: Final = 0.5
"""Where a parameter stands that nobody has set."""


@app.command()
def blend(
    examples: Annotated[
        str,
        typer.Option(
            help="set_a, set_b (walks), waves, beats, or a folder of BVH files with a table (.csv)."
        ),
    ] = "set_b",
    adjectives: Annotated[
        str, typer.Option(help="NAME=VALUE,… from 0 to 1; activeness=.8,clearness=.2.")
    ] = "",
    features: Annotated[
        str, typer.Option(help="The same with groups of features, or single ones.")
    ] = "",
    weights: Annotated[
        str, typer.Option(help="Weights of the examples themselves: misery_slow=1,neutral_fast=2.")
    ] = "",
    ratings: Annotated[
        Path | None,
        typer.Option(help="Adjectives as people rated them: impressions.csv of an analysed study."),
    ] = None,
    character: Annotated[str, typer.Option(help="Who walks in a film, .glb or page.")] = "luca",
    rounds: Annotated[int, typer.Option(help="Cycles in the file.")] = 1,
    unit_m: Annotated[float, typer.Option(help="Metres per unit of a folder's BVH files.")] = 0.01,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help=f"A new file: {', '.join(SUFFIXES)}.")
    ] = None,
    page: Annotated[
        bool, typer.Option("--page", help="Open a page on which sliders blend, to play with.")
    ] = False,
    reach: Annotated[
        Path | None,
        typer.Option(help="A new .png: which groups of features blends come to, and which none."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Blend example walks by adjectives, features or weights, and write the walk.

    Without values it lists what can be given. Parameters that are left out stand at 0.5. With
    --page sliders begin at the values given: adjectives, where there are none.

    Example: visavis blend --examples set_b --adjectives activeness=.8,clearness=.2 -o walk.bvh
    """
    if sum(map(bool, (adjectives, features, weights))) > 1:
        raise UsageError("give one of --adjectives, --features and --weights, not several")
    if output is not None:
        if output.suffix.lower() not in SUFFIXES:
            raise UsageError(f"{output}: name a file that ends in {', '.join(SUFFIXES)}")
        new_file(output)
    if not 1 <= rounds <= 100:
        raise UsageError(f"--rounds {rounds}; give 1 to 100")
    if reach is not None and reach.suffix.lower() != ".png":
        raise UsageError(f"--reach {reach}: name a file that ends in .png")
    if page and (output is not None or as_json):
        raise UsageError("--page shows the walk; give -o or --json without it")
    folder = None if examples in SETS else read_examples(_folder(examples), unit_m=unit_m)
    walks = _set(examples) if folder is None else folder.examples
    impressions = _impressions_of(walks, folder, ratings)
    if reach is not None:
        _map_reach(new_file(reach), walks, as_json)
        return
    if page:
        options = _Options(adjectives, features, weights)
        space = _space(walks, impressions, options, most_weight=1.0)
        on_body = _examples_on(examples, load_character(character), unit_m)
        _show_page(space, on_body, character, examples)
        return
    if not (adjectives or features or weights):
        _list(walks, impressions, as_json, is_simulated=folder is None and ratings is None)
        return
    shares = _space(walks, impressions, _Options(adjectives, features, weights)).shares()
    blend_of_walks = Blend(walks, shares)
    if output is not None and output.suffix.lower() in (*FILMS, ".glb"):
        who = load_character(character)
        own = Blend(_examples_on(examples, who, unit_m), shares)
        if output.suffix.lower() == ".glb":
            write_glb(output, glb_of_character(who, _rounds(own, rounds), name=output.stem))
        else:
            write_walk_film(output, who, replace(own, in_place=True), rounds)
    elif output is not None:
        clip = _rounds(blend_of_walks, rounds)
        if output.suffix.lower() == ".bvh":
            write_bvh(output, bvh_of_clip(clip))
        else:
            write_clip(output, clip)
    _tell(blend_of_walks, as_json)
    if output is not None and not as_json:
        say_written(output)


def _set(which: str) -> Examples:
    return gesture_examples(which) if which in GESTURES else walk_set(which)


def _folder(examples: str) -> Path:
    folder = Path(examples)
    if not folder.is_dir():
        raise UsageError(f"--examples {examples!r} is neither {', '.join(SETS)} nor a folder")
    return folder


def values_of(text: str, names: Sequence[str], option: str, most: float = 1.0) -> dict[str, float]:
    """Read NAME=VALUE,… with values from 0 to `most`.

    Raises:
        UsageError: a name is not among `names`, or a value is no such number.
    """
    values: dict[str, float] = {}
    for part in text.split(","):
        name, _, number = (piece.strip() for piece in part.partition("="))
        if name not in names:
            raise UsageError(f"{option}: there is no {name!r}; there are {', '.join(names)}")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not 0.0 <= value <= most or name in values:
            raise UsageError(
                f"{option}: {part.strip()!r}; give every name once, with a number from 0 to "
                f"{most:g}, as {names[0]}=0.8"
            )
        values[name] = value
    return values


@dataclass(frozen=True, eq=False)
class _Impressions:
    """Adjectives of the examples: their names, and values (n, d) from 0 to 1."""

    names: tuple[str, ...]
    points: Vector


def _impressions_of(
    walks: Examples, folder: ExampleFolder | None, ratings: Path | None
) -> _Impressions:
    if ratings is None:
        if folder is None and is_walk(walks):
            return _Impressions(FACTORS, expected_impressions(walks))
        if folder is None:
            return _Impressions((), np.empty((len(walks), 0)))
        return _Impressions(folder.parameters, folder.points)
    try:
        table = pd.read_csv(ratings)
    except (OSError, ValueError) as problem:
        raise UsageError(f"--ratings {ratings}: it cannot be read as a table: {problem}") from None
    if "name" not in table or sorted(table["name"].astype(str)) != sorted(walks.names):
        raise UsageError(
            f"--ratings {ratings}: its column name has not just the examples; give one row for "
            f"each of {', '.join(walks.names)}"
        )
    values = table.set_index("name").loc[list(walks.names)].apply(pd.to_numeric, errors="coerce")
    wrong = ~values.apply(lambda column: column.between(0.0, 1.0))
    if wrong.to_numpy().any():
        column = next(str(c) for c in values if wrong[c].any())
        raise UsageError(f"--ratings {ratings}: {column} is not from 0 to 1 in every row")
    return _Impressions(tuple(map(str, values.columns)), values.to_numpy(dtype=np.float64))


@dataclass(frozen=True)
class _Options:
    """The options that say what to blend, as they were given; one of them at most."""

    adjectives: str
    features: str
    weights: str


@dataclass(frozen=True, eq=False)
class _Space:
    """Parameters by which examples are blended: their names, where the examples stand (n, d), and
    the values asked for; without points the parameters are the examples' weights.
    """

    option: str
    names: tuple[str, ...]
    points: Vector | None
    values: Mapping[str, float]

    def start(self, name: str) -> float:
        """Return the value of a parameter, where none is given the middle."""
        usual = MIDDLE if self.points is not None or not self.values else 0.0
        return self.values.get(name, usual)

    def shares(self) -> Vector:
        """Return the examples' weights."""
        values = np.array([self.start(name) for name in self.names])
        if self.points is None:
            return shares_of(values, len(self.names))
        return _fit(self.points, len(self.names)).at(values)


def _space(
    walks: Examples, impressions: _Impressions, options: _Options, most_weight: float = np.inf
) -> _Space:
    """Return the parameters of whichever option is given, else the adjectives.

    Raises:
        UsageError: a name or a value cannot be, or there are no adjectives.
    """
    if options.weights:
        values = values_of(options.weights, walks.names, "--weights", most_weight)
        return _Space("--weights", walks.names, None, values)
    if options.features:
        table = feature_table(walks)
        values = values_of(options.features, (*GROUPS, *FEATURES), "--features")
        # The four groups, and every single feature that is asked for besides.
        single = [name for name in values if name in FEATURES]
        columns = [table.scaled_01[:, FEATURES.index(name)] for name in single]
        points = np.column_stack([table.primary, *columns])
        return _Space("--features", (*GROUPS, *single), points, values)
    if not impressions.names:
        raise UsageError(
            "--adjectives: these examples have none; give a folder whose table has columns with "
            "numbers from 0 to 1, or use --ratings, --features or --weights"
        )
    values = (
        values_of(options.adjectives, impressions.names, "--adjectives")
        if options.adjectives
        else {}
    )
    # The four primary parameters where there are such, and every pair asked for besides.
    names = tuple(
        n for n in impressions.names if n in values or n in FACTORS or len(impressions.names) <= 4
    )
    points = impressions.points[:, [impressions.names.index(name) for name in names]]
    return _Space("--adjectives", names, points, values)


def _show_page(space: _Space, on_body: Examples, character: str, examples: str) -> None:
    """Show the page on which sliders blend, until Ctrl-C."""
    try:
        # Late: aiohttp comes with visavis[browser], which blends into files do not need.
        from visavis.cli.blend_page import show_page
        from visavis.running.page.playground import Play
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"--page needs {error.name}, which is not installed; run: pip install "
            "'visavis[browser]'"
        ) from error
    points = space.points
    at = None if points is None else dict(zip(on_body.names, points, strict=True))
    live = Live(on_body, at=at, character=character)
    sliders = [Slider(name, start=space.start(name)) for name in space.names]
    command = f"visavis blend --examples {examples}"
    title = f"Blend of {len(on_body)} motions"
    show_page(Play(live, sliders, title, command, space.option))


def _fit(points: Vector, dimensions: int) -> StyleWeights:
    fit = fit_weights(points)
    if fit.is_spare:
        errors.print(
            f"[yellow]{dimensions} parameters of {len(points)} examples: weights are unsteady; "
            f"give at least {dimensions + MIN_SPARE} examples, or fewer parameters[/]",
            soft_wrap=True,
        )
    return fit


def _rounds(blend_of_walks: Blend, rounds: int) -> Clip:
    """Return cycles one after another; the last frame is the first again, further on."""
    one = blend_of_walks.sampled()
    n = len(one.root_m) * rounds + 1
    frames = blend_of_walks.at(np.arange(n) * one.frame_s)
    return Clip(blend_of_walks.skeleton, one.frame_s, frames.root_m, frames.orientation_wxyz)


def _examples_on(examples: str, who: Character, unit_m: float) -> Examples:
    """Return the examples on a character's own skeleton."""
    if examples in GESTURES:
        return gesture_examples(examples, who.skeleton)
    if examples in SETS:
        return walk_examples(style_names(examples), build_of_character(who))
    return read_examples(Path(examples), who.skeleton, unit_m=unit_m).examples


def _map_reach(path: Path, walks: Examples, as_json: bool) -> None:
    """Draw what blends of the examples come to, and say it in shares."""
    reach = reach_of(walks, tuple(GROUPS), REACH_BLENDS, np.random.default_rng(1))
    write_reach_map(path, reach, feature_table(walks).primary)
    shares = {
        f"{reach.names[i]} by {reach.names[j]}": share for (i, j), share in reach.planes.items()
    }
    if as_json:
        say_json({"blends": len(reach.points), "reached": shares})
        return
    for plane, share in shares.items():
        say(f"{plane}: blends come to {share:.0%} of the plane")
    say_written(path)


def _list(walks: Examples, impressions: _Impressions, as_json: bool, *, is_simulated: bool) -> None:
    table = feature_table(walks)
    if as_json:
        say_json(
            {
                "examples": list(walks.names),
                "adjectives": list(impressions.names),
                "features": {name: list(table.values[:, i]) for i, name in enumerate(FEATURES)},
                "groups": dict(zip(FEATURES, table.group_of, strict=True)),
            }
        )
        return
    say(f"[b]{len(walks)} examples[/]: {verbatim(', '.join(walks.names))}")
    say(f"[b]adjectives[/]: {verbatim(', '.join(impressions.names) or 'none')}")
    if is_simulated and impressions.names:
        say("[dim]from simulated raters; people have not rated these walks[/]")
    for group in GROUPS:
        members = [name for name, g in zip(FEATURES, table.group_of, strict=True) if g == group]
        say(f"[b]features, {group}[/]: {', '.join(members)}")


def _tell(blend_of_walks: Blend, as_json: bool) -> None:
    walks = blend_of_walks.examples
    features = features_of(replace(blend_of_walks, in_place=False).sampled())
    if as_json:
        say_json(
            {
                "weights": dict(zip(walks.names, blend_of_walks.weights.tolist(), strict=True)),
                "cycle_s": blend_of_walks.cycle_s,
                "speed_mps": float(
                    np.hypot(*blend_of_walks.travel_m[[0, 2]]) / blend_of_walks.cycle_s
                ),
                "features": features,
            }
        )
        return
    heavy = sorted(zip(blend_of_walks.weights, walks.names, strict=True), reverse=True)
    text = ", ".join(f"{name} {weight:.2f}" for weight, name in heavy if weight >= 0.005)
    say(f"[b]weights[/]: {verbatim(text)}")
    speed = float(np.hypot(*blend_of_walks.travel_m[[0, 2]]) / blend_of_walks.cycle_s)
    say(f"a cycle of {blend_of_walks.cycle_s:.2f} s, {speed:.2f} m/s; {_some(features)}")


def _some(features: Mapping[str, float]) -> str:
    names = ("step_length_fb", "mean_torso_fb", "sd_left_upper_arm_fb")
    return ", ".join(f"{name} {features[name]:.2f} {unit_of(name)}" for name in names)
