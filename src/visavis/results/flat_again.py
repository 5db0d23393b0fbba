"""Flat stimuli of a recorded frame, made again from the event that describes them."""

import ast
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from visavis.lab.config import Screen
from visavis.lab.errors import DataError
from visavis.lab.geometry import Pose
from visavis.lab.luminance import LUMINANCE_KEY, table_of_entry
from visavis.lab.screen import PlacedScreen
from visavis.protocol.plan.shown_scene import RecordedScene, of_part
from visavis.stimuli.flat import KINDS, Flat, Image, Panorama, Video, rgb_of
from visavis.stimuli.gaze_window import GAZE_WINDOW, NO_WINDOW, GazeWindow, WindowPlace
from visavis.stimuli.own_room import Room
from visavis.stimuli.panels import IN_HEADSET, Surface
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import DRESSED_BY, FlatScene
from visavis.stimuli.view_turns import VIEW_TURNED, read_turns

LAST_SAMPLES = 3
"""How many samples of the head may have been the newest when something was shown."""


def flat_views(record: RecordedScene, folder: Path) -> Iterator[SceneFrame]:
    """Yield the frames of flat stimuli that a recorded frame may be, the likeliest first; none
    where no event describes them.

    Raises:
        DataError: the event cannot be read.
    """
    payload = record.with_onset("shown")
    if payload is None or "option_items" not in payload:
        return
    screen = record.recording.manifest.configuration.get("screen")
    surface, heads = IN_HEADSET, _heads(record)
    if screen is not None:
        lab_screen = Screen(**screen)
        upright = Pose(
            np.array([0.0, lab_screen.eye_height_m, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])
        )
        luminance = table_of_entry(record.recording.manifest.configuration.get(LUMINANCE_KEY))
        flat = replace(lab_screen.flat, luminance=luminance)
        surface, heads = Surface(PlacedScreen(flat, upright)), heads[:1]
    # The recording has the areas: their files are not needed.
    items = tuple(map(_without_areas, read_items_text(str(payload["option_items"]))))
    panorama: Panorama | None = None
    if "option_panorama" in payload:
        (panorama,) = map(_without_areas, read_items_text(f"({payload['option_panorama']},)"))
    window: GazeWindow | None = None
    if f"option_{GAZE_WINDOW}" in payload:
        (window,) = read_items_text(f"({payload[f'option_{GAZE_WINDOW}']},)")
    window_at = None if window is None else _window_at(record)
    turns = read_turns(record.since(VIEW_TURNED))

    def scenes() -> list[FlatScene]:
        return [
            FlatScene(
                name=record.scene.name,
                agents=(),
                brightness_01=record.scene.brightness_01,
                dressed_by=DRESSED_BY,
                items=items,
                background_srgb=rgb_of(read_colour(payload["option_background"])),
                head=head,
                surface=surface,
                folder=folder,
                answered_by=str(payload.get("option_answered_by", "")),
                moves_since_ns=int(payload.get("moves_since_ns", 0)),
                panorama=panorama,
                turns=turns,
                gaze_window=window,
            )
            for head in heads
        ]

    # All frames of one showing have one scene, whose pictures are then made once.
    key = ("flat", record.description["scene"], folder, len(turns.turns))
    for scene in record.once(key, scenes):
        # What moves stood still between two frames.
        t_ns = record.t_ns if scene.moves else record.t_scene_ns
        turned_deg = turns.at(record.t_scene_ns)
        nobody = np.zeros((0, 3)), np.zeros(0)
        yield SceneFrame(scene, t_ns, *nobody, turned_deg=turned_deg, window_at=window_at)


def _window_at(record: RecordedScene) -> WindowPlace:
    """Return where the window was, for which a recorded frame was drawn, that followed gaze."""
    rows = of_part(record.recording, GAZE_WINDOW, record.part)
    i = int(np.searchsorted(rows["t_drawn_ns"], record.t_ns, side="right")) - 1
    if i < 0 or not rows["valid"][i]:
        return NO_WINDOW
    place, direction = rows["origin_world_m"][i], rows["direction_world"][i]
    return WindowPlace.of(int(rows["t_sample_ns"][i]), place, direction)


def read_items_text(text: str) -> tuple[Any, ...]:
    """Return flat stimuli, a room, or a window after gaze, from the text by which the event "shown"
    describes them.

    Raises:
        DataError: it is no such text.
    """
    try:
        tree = ast.parse(text, mode="eval").body
        calls = tree.elts if isinstance(tree, ast.Tuple) else []
        return tuple(_item(call) for call in calls)
    except (SyntaxError, ValueError, KeyError, TypeError) as error:
        raise DataError(f"no flat stimuli are described by {text[:60]!r}") from error


def _without_areas(stimulus: Any) -> Any:
    has_areas = isinstance(stimulus, Image | Video | Panorama)
    return replace(stimulus, areas="") if has_areas else stimulus


def _item(call: ast.expr) -> Flat | Panorama | Room | GazeWindow:
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name) or call.args:
        raise ValueError("no stimulus")
    values = {str(k.arg): ast.literal_eval(k.value) for k in call.keywords}
    kinds: dict[str, type[Flat | Panorama | Room | GazeWindow]] = {
        **KINDS,
        "Room": Room,
        "GazeWindow": GazeWindow,
    }
    return kinds[call.func.id](**values)


def read_colour(text: str) -> str | tuple[int, int, int]:
    """Return a colour from its text in an event: a name, "#rrggbb", or "(r, g, b)"."""
    if text.startswith("("):
        red, green, blue = ast.literal_eval(text)
        return red, green, blue
    return text


def _heads(record: RecordedScene) -> list[Pose]:
    """Return where the head was when the stimuli were shown, newest sample first."""
    head = of_part(record.recording, "head", record.part)
    rows = np.flatnonzero(head["valid"] & (head["t_host_ns"] <= record.since_ns))
    return [
        Pose(
            head["position_m"][i].astype(np.float64),
            head["orientation_wxyz"][i].astype(np.float64),
        )
        for i in rows[::-1][:LAST_SAMPLES]
    ] or [Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))]
