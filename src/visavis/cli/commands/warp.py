"""warp: change what an observer sees of a motion, and draw the result."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import Progress

from visavis.cli.app import JsonOption, app, console, say, verbatim
from visavis.cli.motions import JointMapOption, motion_on_character
from visavis.cli.warp_sheet import write_curves, write_sheet
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.character import Character
from visavis.stimuli.motion.bvh import write_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.clip_file import write_clip
from visavis.stimuli.motion.warping.cases import CASES, SEARCHED, case_named, stage_case
from visavis.stimuli.motion.warping.clips import warp_clip
from visavis.stimuli.motion.warping.features import parse_feature
from visavis.stimuli.motion.warping.outlook import Outlook, looking_at, outlook
from visavis.stimuli.motion.warping.perceived import SeenBody, body_of
from visavis.stimuli.motion.warping.units import units_named

VIEW_RADIUS_M = 1.05
SIZE_PX = 128
OUT_NAMES = ("warped.bvh", "warped.npz", "before_after.png", "features.png", "warp.json")


@app.command()
def warp(
    clip: Annotated[
        str,
        typer.Argument(help="A BVH file, a clip of ours (.npz), or a motion by name: wave, talk …"),
    ] = "wave",
    observer: Annotated[
        str | None,
        typer.Option(help="Where the observer's eyes are, X,Y,Z in metres; the person faces −z."),
    ] = None,
    feature: Annotated[
        list[str] | None,
        typer.Option(help="KIND:PART,PART:CHANGE, such as coverage:face,right_hand:+0.25."),
    ] = None,
    units: Annotated[
        str, typer.Option(help="What may move: spine, neck_head, left_arm, right_arm, arms, all.")
    ] = "all",
    case: Annotated[
        str | None, typer.Option(help="A published case instead of the options above; see --cases.")
    ] = None,
    cases: Annotated[bool, typer.Option("--cases", help="List the published cases.")] = False,
    character: Annotated[str, typer.Option(help="Who wears the motion.")] = "anna",
    seconds: Annotated[float, typer.Option(help="How much of a motion by name.")] = 2.0,
    unit_m: Annotated[float, typer.Option(help="Metres per unit of a BVH file.")] = 0.01,
    joint_map: JointMapOption = None,
    threads: Annotated[int, typer.Option(help="Threads that share the renders.")] = 1,
    output: Annotated[Path, typer.Option("--output", "-o", help="A new folder.")] = Path("warped"),
    as_json: JsonOption = False,
) -> None:
    """Warp a motion so that an observer perceives more or less of it.

    Example: visavis warp wave --observer 1.5,1.6,-2.5 --feature coverage:face,right_hand:+0.25
    --units right_arm,spine,neck_head -o out
    """
    if cases:
        for published_case in CASES.values():
            console.print(
                f"[b]{published_case.name:<13}[/] {verbatim(published_case.about)}", highlight=False
            )
        return
    if output.exists() and any(output.iterdir()):
        raise UsageError(f"{output} is not empty; give a new folder with --output")
    # A published case brings motion, view and lamps; else they come from the options.
    who = load_character(character)
    if case is not None:
        stage = stage_case(case_named(case), who)
        motion, body, view = stage.clip, stage.body, stage.view
        targets, movable_units, things = stage.case.targets, stage.units, stage.case.things()
        lamps, settings = stage.case.lamps(), stage.case.settings
    else:
        if observer is None or not feature:
            raise UsageError("give --observer X,Y,Z and at least one --feature, or a --case")
        targets = tuple(parse_feature(text) for text in feature)
        movable_units = units_named(tuple(name.strip() for name in units.split(",")))
        motion, body, view = _seen_motion(clip, who, _point(observer), seconds, unit_m, joint_map)
        things, lamps, settings = (), (), SEARCHED
    settings = replace(settings, threads=threads)
    with Progress(console=console, transient=True, disable=as_json) as bar:
        task = bar.add_task("warping", total=None)
        warped_clip = warp_clip(
            motion,
            body,
            view,
            targets,
            movable_units,
            settings,
            progress=lambda count, total: bar.update(task, completed=count, total=total),
        )
    # The motion twice (for other programs, and with our skeleton), two figures, one record.
    output.mkdir(parents=True, exist_ok=True)
    bvh, own, sheet, curves, record = (output / name for name in OUT_NAMES)
    write_bvh(bvh, bvh_of_clip(warped_clip.clip))
    write_clip(own, warped_clip.clip)
    shows_people = write_sheet(sheet, who, motion, warped_clip.clip, body, view, things, lamps)
    write_curves(curves, warped_clip)
    summary = {
        "clip": clip if case is None else f"case {case}",
        "character": character,
        "observer_m": view.camera.pose.position_m.tolist(),
        "size_px": list(view.size_px),
        "features": [f"{t.kind}:{','.join(t.parts)}:{t.change:+g}" for t in targets],
        "units": [unit.name for unit in movable_units],
        "settings": vars(settings),
        "original": warped_clip.original.mean(axis=0).tolist(),
        "wanted": warped_clip.goal.mean(axis=0).tolist(),
        "reached": warped_clip.final.mean(axis=0).tolist(),
        "reached_share_01": float(warped_clip.is_reached.mean()),
        "pose_reached_share_01": float(warped_clip.pose_reached.mean()),
        "frame_s": warped_clip.frame_s.tolist(),
        "frame_is_reached": warped_clip.is_reached.tolist(),
    }
    record.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    if as_json:
        console.print_json(data=summary)
        return
    say(warped_clip.summary)
    if not shows_people:
        console.print("[yellow]no OpenGL here: the sheet shows body parts instead of people[/]")
    say(f"written to [b]{verbatim(output)}[/]: {', '.join(OUT_NAMES)}")


def _seen_motion(
    name: str,
    who: Character,
    eye_m: Vector,
    seconds: float,
    unit_m: float,
    joint_map: Path | None,
) -> tuple[Clip, SeenBody, Outlook]:
    """Return the motion on the character, its body, and the observer's view of it."""
    motion = motion_on_character(name, who, seconds, unit_m, joint_map)
    low, high = motion.root_m.min(axis=0), motion.root_m.max(axis=0)
    centre = (low + high) / 2 + np.array([0.0, 0.30, 0.0])
    radius = VIEW_RADIUS_M + float(np.linalg.norm(high - low)) / 2
    return motion, body_of(who), outlook(looking_at(eye_m, centre, radius), SIZE_PX)


def _point(text: str) -> Vector:
    try:
        point = np.array([float(v) for v in text.split(",")])
    except ValueError:
        point = np.zeros(0)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise UsageError(f"--observer {text!r}; give three numbers in metres, as 1.5,1.6,-2.5")
    return point
