"""Pictures of a warp: the motion before and after as the observer sees it, and its features."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from visavis.lab.geometry import Vector
from visavis.stage.errors import StageError
from visavis.stage.stills import Stills
from visavis.stimuli.characters.body_parts import PART_INDEX, PARTS
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.motion.clip import Clip, Frames
from visavis.stimuli.motion.warping.clips import WarpedClip
from visavis.stimuli.motion.warping.outlook import Outlook
from visavis.stimuli.motion.warping.perceived import SeenBody, perceived_parts, posed_points
from visavis.stimuli.motion.warping.raster_kernels import BOTH_SIDES
from visavis.stimuli.picture import Light, Picture, PosedPeople, Prop, Room, StaticMesh
from visavis.stimuli.rooms import surfaces
from visavis.stimuli.rooms.furniture import level, place_prop
from visavis.stimuli.text_font import font_for

COLUMNS = 6
TILE_PX = 300
LABEL_PX = 34
HELD_SRGB = (40, 70, 120)
DAYLIGHT = Light("sun", np.full(3, 0.75), direction=np.array([0.35, -0.8, 0.55]), casts_shadow=True)
Tile = npt.NDArray[np.uint8]


def write_sheet(
    path: Path,
    who: Character,
    before: Clip,
    after: Clip,
    body: SeenBody,
    view: Outlook,
    things: Sequence[StaticMesh],
    lamps: Sequence[Light] = (),
) -> bool:
    """Draw both clips at even times, one row each; tell whether people could be drawn.

    `lamps` burn instead of daylight. Without OpenGL the rows show the perceived parts in colours.
    """
    times = np.linspace(0.05, 0.95, COLUMNS) * before.duration_s
    shows_people = True
    try:
        rows = _people(who, (before, after), body, view, things, lamps, times)
    except StageError:
        rows, shows_people = _parts((before, after), body, view, times), False
    sheet = Image.new("RGB", (COLUMNS * TILE_PX, 2 * (TILE_PX + LABEL_PX)), (250, 250, 250))
    draw = ImageDraw.Draw(sheet)
    for r, (label, row) in enumerate(zip(("original", "warped"), rows, strict=True)):
        top = r * (TILE_PX + LABEL_PX)
        for c, (t, tile) in enumerate(zip(times, row, strict=True)):
            picture = Image.fromarray(tile).resize((TILE_PX, TILE_PX), Image.Resampling.NEAREST)
            sheet.paste(picture, (c * TILE_PX, top + LABEL_PX))
            text = f"{label}, {t:.2f} s" if c == 0 else f"{t:.2f} s"
            draw.text((c * TILE_PX + 8, top + 7), text, (30, 30, 30), font_for(text, 18))
    sheet.save(path)
    return shows_people


def _people(
    who: Character,
    clips: Sequence[Clip],
    body: SeenBody,
    view: Outlook,
    things: Sequence[StaticMesh],
    lamps: Sequence[Light],
    times: Vector,
) -> list[list[Tile]]:
    floor = level(
        "floor", (-6, -6), (6, 6), 0.0, (176, 174, 170), surfaces.plaster(3), roughness_01=0.9
    )
    room = Room(
        "sheet",
        (floor, *(place_prop(f"thing_{i}", m, (0, 0, 0), 0.0) for i, m in enumerate(things))),
        tuple(replace(lamp, casts_shadow=True) for lamp in lamps) or (DAYLIGHT,),
        np.full(3, 0.1 if lamps else 0.55),
        np.full(3, 0.08 if lamps else 0.42),
        (196, 202, 208),
    )
    with Stills() as stills:
        return [
            [
                stills.image(_picture(room, who, clip, body, float(t)), view.camera, (TILE_PX,) * 2)
                for t in times
            ]
            for clip in clips
        ]


def _picture(room: Room, who: Character, clip: Clip, body: SeenBody, t_s: float) -> Picture:
    pose = clip.at(t_s)
    room = replace(room, props=(*room.props, *_object_in_hand(body, pose)))
    people = PosedPeople(pose.root_m[None], pose.orientation_wxyz[None], np.zeros((1, len(MORPHS))))
    return Picture(round(t_s * 1e9), room, (who,), people)


def _object_in_hand(body: SeenBody, pose: Frames) -> tuple[Prop, ...]:
    """Return the object that the body holds, where it is in a pose."""
    is_held = body.labels % BOTH_SIDES == PART_INDEX["held_object"]
    if not is_held.any():
        return ()
    corners = posed_points(body, pose.root_m, pose.orientation_wxyz)[body.triangles[is_held]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    count = 3 * len(corners)
    mesh = StaticMesh(
        corners.reshape(-1, 3).astype(np.float32),
        np.repeat(normals, 3, axis=0).astype(np.float32),
        np.tile(np.array(HELD_SRGB, dtype=np.uint8), (count, 1)),
        np.arange(count, dtype=np.int32).reshape(-1, 3),
    )
    return (place_prop("held", mesh, (0, 0, 0), 0.0),)


def _parts(clips: Sequence[Clip], body: SeenBody, view: Outlook, times: Vector) -> list[list[Tile]]:
    table = (255 * mpl.colormaps["tab20"](np.arange(len(PARTS)) % 20)[:, :3]).astype(np.uint8)
    table[0] = 40
    rows = []
    for clip in clips:
        poses = clip.at(times)
        rows.append(list(table[perceived_parts(body, view, poses.root_m, poses.orientation_wxyz)]))
    return rows


def write_curves(path: Path, warped_clip: WarpedClip) -> None:
    """Plot every feature over the clip: original, wanted, reached."""
    from matplotlib.figure import Figure

    n = len(warped_clip.targets)
    figure = Figure(figsize=(7.5, 2.3 * n + 0.5), layout="constrained")
    for f, target in enumerate(warped_clip.targets):
        axes = figure.add_subplot(n, 1, f + 1)
        axes.plot(warped_clip.frame_s, warped_clip.original[:, f], color="0.55", label="original")
        axes.plot(warped_clip.frame_s, warped_clip.goal[:, f], "k--", lw=1.0, label="wanted")
        axes.plot(warped_clip.frame_s, warped_clip.final[:, f], color="tab:blue", label="reached")
        axes.set_ylabel(f"{target.kind.replace('_', ' ')}\n{', '.join(target.parts)} [1]")
        axes.set_ylim(bottom=0)
        axes.spines[["top", "right"]].set_visible(False)
        if f == 0:
            axes.legend(frameon=False, ncols=3, loc="lower right")
    axes.set_xlabel("time in the clip [s]")
    figure.savefig(path, dpi=150)
